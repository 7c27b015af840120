# ruff: noqa
"""Network `mixture`: no memory, inputs of the present and the last 2.4 s in the agent frame."""

from __future__ import annotations
import math, glob
import numpy as np, torch
from torch import nn, Tensor
import torch.nn.functional as F
from numba import njit
from rows import P, DT, H, K


# ------------------------------------------------------------------ scenery on the fly
@njit(cache=True, fastmath=True)
def _look(sdf, off, sx, sy, ox, oy, res, x, y):
    i = int(math.floor((x - ox) / res))
    j = int(math.floor((y - oy) / res))
    if i < 0 or j < 0 or i >= sx or j >= sy:
        return 240
    return sdf[off + i * sy + j]


@njit(cache=True, fastmath=True, nogil=True)
def rays(sdf, off, shape, origin, res, m, pos, heading, n, far):
    Q = len(m)
    out = np.empty((Q, n), np.float32)
    for q in range(Q):
        k = m[q]
        sx, sy, o = shape[k, 0], shape[k, 1], off[k]
        ox, oy, r = origin[k, 0], origin[k, 1], res[k]
        for b in range(n):
            a = heading[q] + 2 * math.pi * b / n
            c, s = math.cos(a), math.sin(a)
            d = 0.0
            while d < far:
                x, y = pos[q, 0] + c * d, pos[q, 1] + s * d
                v = _look(sdf, o, sx, sy, ox, oy, r, x, y) / 40.0 - 1.0
                if v <= 0.02:
                    break
                d += (
                    max(v * 0.98, 0.05)
                    if v < 4.9
                    else (4.9 if 0 <= x - ox < sx * r and 0 <= y - oy < sy * r else 0.5)
                )
            out[q, b] = min(d, far)
    return out


@njit(cache=True, fastmath=True, nogil=True)
def crops(sdf, off, shape, origin, res, m, pos, heading, n, cell, x0, out):
    """out [Q, n, n] uint8 : distance code at (forward i, left j)."""
    for q in range(len(m)):
        k = m[q]
        sx, sy, o = shape[k, 0], shape[k, 1], off[k]
        ox, oy, r = origin[k, 0], origin[k, 1], res[k]
        c, s = math.cos(heading[q]), math.sin(heading[q])
        for i in range(n):
            u = x0 + (i + 0.5) * cell
            for j in range(n):
                v = (j + 0.5 - n / 2) * cell
                out[q, i, j] = _look(
                    sdf, o, sx, sy, ox, oy, r, pos[q, 0] + c * u - s * v, pos[q, 1] + s * u + c * v
                )
    return out


class Data:
    """Rows of several files in memory, maps in one flat array."""

    def __init__(self, files, weights=None):
        cols, sdf, shape, origin, res, w, kinds = {}, [], [], [], [], [], []
        nm = 0
        for f in files:
            z = np.load(f)
            for k in ("hist", "hm", "nb", "nm", "last", "vel", "cov", "age", "y", "pos", "heading", "source"):
                cols.setdefault(k, []).append(z[k])
            cols.setdefault("map", []).append(z["map"] + nm)
            nm += len(z["shape"])
            sdf.append(z["sdf"])
            shape.append(z["shape"])
            origin.append(z["origin"])
            res.append(z["res"])
            kind = f.split("/")[-1].rsplit("_", 1)[0]
            kinds += [kind] * len(z["y"])
        for k, v in cols.items():
            setattr(self, k, np.concatenate(v))
        self.kind = np.array(kinds)
        self.sdf = np.concatenate(sdf)
        self.shape = np.concatenate(shape).astype(np.int64)
        self.origin = np.concatenate(origin)
        self.res = np.concatenate(res)
        n = self.shape.prod(1)
        self.off = np.concatenate([[0], np.cumsum(n)[:-1]])

    def __len__(self):
        return len(self.y)

    def maps(self):
        return self.sdf, self.off, self.shape, self.origin, self.res

    @staticmethod
    def of_place(rec, d):
        self = Data.__new__(Data)
        for k in ("hist", "hm", "nb", "nm", "last", "vel", "cov", "age", "y", "pos", "heading"):
            setattr(self, k, d[k])
        self.source = np.zeros(len(d["y"]), np.int8)
        self.map = np.zeros(len(d["y"]), np.int64)
        self.kind = np.full(len(d["y"]), rec.name)
        self.sdf = np.clip((rec.map.sdf + 1) * 40, 0, 240).astype(np.uint8).ravel()
        self.shape = np.array([rec.map.sdf.shape])
        self.off = np.array([0])
        self.origin = rec.map.origin[None]
        self.res = np.array([rec.map.res])
        return self


def batch(D, idx, cfg, rng=None):
    """Tensors of some rows, augmented where rng is given."""
    g = lambda a: torch.from_numpy(np.ascontiguousarray(a[idx]))
    hist, hm, nb, nmk, last, vel, y = (
        g(getattr(D, k)).clone() for k in ("hist", "hm", "nb", "nm", "last", "vel", "y")
    )
    cov, age = g(D.cov), g(D.age)
    m = D.map[idx].astype(np.int64)
    pos, head = D.pos[idx], D.heading[idx]
    out = {}
    Q = len(idx)
    if rng is not None:
        nomap = torch.from_numpy(rng.random(Q) < cfg.get("map_drop", 0.03))
        shift = rng.normal(0, 0.06, (Q, 2)) * (rng.random((Q, 1)) < 0.3)
        nonb = torch.from_numpy(rng.random(Q) < 0.03)
        nmk[nonb] = 0
        drop = torch.from_numpy((rng.random((Q, K)) < 0.05) & (rng.random((Q, 1)) < 0.3))
        nmk[drop] = 0
        flip = torch.from_numpy(rng.random(Q) < 0.5)
        # rows shown with a shorter past
        short = rng.random(Q) < 0.15
        keep = rng.integers(0, H + 1, Q)
        cut = torch.from_numpy(short[:, None] & (np.arange(H) >= keep[:, None]))
        hm[cut] = 0
        pos = pos + shift
    far = 10.0
    if cfg.get("nohist"):
        hm[:] = 0
        last[:] = 0
        hist[:, 0] = 0
    if cfg.get("nonb"):
        nmk[:] = 0
    if cfg.get("near"):
        nmk[:, cfg["near"] :] = 0
    if cfg.get("rays"):
        r = torch.from_numpy(rays(*D.maps(), m, pos, head, cfg["rays"], far))
        if rng is not None:
            r[nomap] = far
        out["rays"] = r
    if cfg.get("crop"):
        n, cell, x0 = cfg["crop"]
        c = torch.from_numpy(crops(*D.maps(), m, pos, head, n, cell, x0, np.empty((Q, n, n), np.uint8)))
        if rng is not None:
            c[nomap] = 240
        out["crop"] = c
    if rng is not None:
        f = flip[:, None, None]
        sg = torch.tensor([1.0, -1.0])
        hist = torch.where(f, hist * sg, hist)
        nb = torch.where(f, nb * torch.tensor([1.0, -1.0, 1.0, -1.0]), nb)
        y = torch.where(f, y * sg, y)
        last = torch.where(f[:, 0], last * sg, last)
        vel = torch.where(f[:, 0], vel * sg, vel)
        if "rays" in out:
            out["rays"] = torch.where(f[:, 0], torch.roll(out["rays"].flip(-1), 1, -1), out["rays"])
        if "crop" in out:
            out["crop"] = torch.where(f, out["crop"].flip(-1), out["crop"])
    return dict(out, hist=hist, hm=hm, nb=nb, nm=nmk, last=last, vel=vel, cov=cov, age=age, y=y)


def mirrored(b):
    sg = torch.tensor([1.0, -1.0])
    o = dict(b)
    for k in ("hist", "last", "vel", "y"):
        o[k] = b[k] * sg
    o["nb"] = b["nb"] * torch.tensor([1.0, -1.0, 1.0, -1.0])
    if "rays" in b:
        o["rays"] = torch.roll(b["rays"].flip(-1), 1, -1)
    if "crop" in b:
        o["crop"] = b["crop"].flip(-1)
    return o


def mlp(*w, last=True):
    l = []
    for i, (a, b) in enumerate(zip(w[:-1], w[1:])):
        l.append(nn.Linear(a, b))
        if last or i < len(w) - 2:
            l.append(nn.ReLU())
    return nn.Sequential(*l)


class Rays(nn.Module):
    """Patches of 8 beams, every 4, share a projection; then one layer over all patches."""

    def __init__(self, n, out):
        super().__init__()
        self.a = nn.Linear(16, 32)
        self.fc = nn.Linear(n // 4 * 32, out)

    def forward(self, r):
        x = (
            torch.cat([1 - r / 10, torch.exp(-r)], 1).unflatten(1, (2, -1, 4)).transpose(1, 2).flatten(2)
        )  # B n/4 8
        x = torch.cat([torch.roll(x, 1, 1), x], -1)
        return F.relu(self.fc(F.relu(self.a(x)).flatten(1)))


class Crop(nn.Module):
    def __init__(self, n, out, ch=(16, 32, 48)):
        super().__init__()
        self.c = nn.Sequential(
            nn.Conv2d(2, ch[0], 5, 2, 2),
            nn.ReLU(),
            nn.Conv2d(ch[0], ch[1], 3, 2, 1),
            nn.ReLU(),
            nn.Conv2d(ch[1], ch[2], 3, 2, 1),
            nn.ReLU(),
        )
        self.fc = nn.Linear((n // 8) ** 2 * ch[2], out)

    def forward(self, c):
        d = c.float() / 40 - 1
        x = torch.stack([(d <= 0).float(), torch.exp(-d.clamp(min=0) * 1.5)], 1).contiguous(
            memory_format=torch.channels_last
        )
        return F.relu(self.fc(self.c(x).flatten(1)))


class Patches(nn.Module):
    """Distance field on 32 x 32 points: patches of 4 x 4 share a projection, 2 x 2 of them the next, then one layer."""

    def __init__(self, n, out, w=(48, 96)):
        super().__init__()
        self.a = nn.Linear(32, w[0])
        self.b = nn.Linear(4 * w[0], w[1])
        self.fc = nn.Linear((n // 8) ** 2 * w[1], out)
        self.n = n

    def forward(self, c):
        d = c.float() / 40 - 1
        x = torch.stack([((0.3 - d) / 0.6).clamp(0, 1), torch.exp(-d.clamp(min=0))], -1)  # B n n 2
        k = self.n // 4
        x = x.view(-1, k, 4, k, 8).transpose(2, 3).reshape(-1, k, k, 32)
        x = F.relu(self.a(x))
        w = x.shape[-1]
        x = x.view(-1, k // 2, 2, k // 2, 2 * w).transpose(2, 3).reshape(-1, k // 2, k // 2, 4 * w)
        return F.relu(self.fc(F.relu(self.b(x)).flatten(1)))


class Mixture(nn.Module):
    def __init__(self, cfg):
        super().__init__()
        self.cfg = cfg
        w = cfg.get("width", 256)
        M = self.M = cfg.get("modes", 6)
        self.own = mlp(2 * (H + 1) + H + 2 + 2 + 3 + 3 + 1, 128, 128)
        self.nb1 = nn.Linear(10, 96)
        self.nb2 = nn.Linear(96, 96)
        self.toself = nn.Linear(128, 96)
        size = 128 + 96 * 2
        if cfg.get("rays"):
            self.rays = Rays(cfg["rays"], 128)
            size += 128
        if cfg.get("crop"):
            self.crop = (
                Crop(cfg["crop"][0], 128, cfg.get("ch", (16, 32, 48)))
                if cfg.get("conv")
                else Patches(cfg["crop"][0], 128)
            )
            size += 128
        self.t1 = nn.Linear(size, w)
        self.t2 = nn.Linear(w, w)
        self.t3 = nn.Linear(w, w)
        self.point = nn.Linear(w, 2 * P)
        self.modes = nn.Linear(w, M * (2 * P + 3 * P) + M)
        nn.init.zeros_(self.point.weight)
        nn.init.zeros_(self.point.bias)
        with torch.no_grad():
            self.modes.weight *= 0.3

    def features(self, b):
        h = (b["hist"] * torch.cat([torch.ones_like(b["hm"][:, :1]), b["hm"]], 1)[..., None]).flatten(1)
        age = b["age"].float()
        speed = b["vel"].norm(dim=-1, keepdim=True)
        known = (age >= 1).float()[:, None]
        own = torch.cat(
            [
                h,
                b["hm"],
                b["vel"],
                b["last"] * 0.5 * known,
                b["cov"].clamp(min=0).sqrt() * torch.tensor([5.0, 3.0, 1.0]),
                known,
                (age >= 2).float()[:, None],
                (age.clamp(max=10) / 10)[:, None],
                speed,
            ],
            1,
        )
        return own

    def forward(self, b):
        own = self.own(self.features(b))
        p, v = b["nb"][..., :2], b["nb"][..., 2:]
        rv = v - b["vel"][:, None]
        d = p.norm(dim=-1, keepdim=True)
        # time and distance of the closest approach
        tca = (-(p * rv).sum(-1, keepdim=True) / (rv.square().sum(-1, keepdim=True) + 0.05)).clamp(0, 4)
        dca = (p + tca * rv).norm(dim=-1, keepdim=True)
        f = torch.cat([p * 0.25, rv, v, torch.exp(-d), 1 / (1 + d), tca * 0.3, torch.exp(-dca)], -1)
        e = F.relu(self.nb2(F.relu(self.nb1(f) + self.toself(own)[:, None])))
        mask = b["nm"][..., None] > 0
        fade = ((8 - d) / 2).clamp(0, 1).to(e.dtype)  # nobody appears suddenly at the edge of sight
        e = e * (fade * mask)
        top = e.amax(1)
        mean = e.sum(1) * 0.25
        parts = [own, top, mean]
        if "rays" in b and hasattr(self, "rays"):
            parts.append(self.rays(b["rays"]))
        if "crop" in b and hasattr(self, "crop"):
            parts.append(self.crop(b["crop"]))
        x = F.relu(self.t1(torch.cat([q.to(own.dtype) for q in parts], 1)))
        x = x + F.relu(self.t2(x))
        x = x + F.relu(self.t3(x))
        k = torch.arange(1, P + 1) * DT
        prior = b["vel"][:, None] * k[:, None]
        point = prior + self.point(x).float().unflatten(1, (P, 2)).cumsum(1) * DT
        z = self.modes(x).float()
        M = self.M
        mu, sp, lw = z.split([M * 2 * P, M * 3 * P, M], 1)
        mu = mu.unflatten(1, (M, P, 2)).cumsum(2) * DT
        sp = sp.unflatten(1, (M, P, 3))
        gate = torch.ones(M)
        gate[0] = 0 if self.cfg.get("prior_mode", True) else 1
        mu = prior[:, None] + mu * gate[:, None, None]
        grow = 0.05 + 0.25 * k
        sd = F.softplus(sp[..., :2] + 0.5) * grow[:, None] + 0.01
        rho = 0.95 * torch.tanh(sp[..., 2])
        return dict(point=point, mu=mu, sd=sd, rho=rho, logw=F.log_softmax(lw, 1))


def forward(net, b, sym):
    """Exact mirror symmetry: the point forecast is the mean over the world and its mirror image, the modes are their union."""
    if not sym:
        return net(b)
    q = mirrored(b)
    o = net({k: torch.cat([b[k], q[k]]) for k in b})
    B = len(b["y"])
    sg = torch.tensor([1.0, -1.0])
    f = {k: v.split(B) for k, v in o.items()}
    return dict(
        point=0.5 * (f["point"][0] + f["point"][1] * sg),
        mu=torch.cat([f["mu"][0], f["mu"][1] * sg], 1),
        sd=torch.cat(f["sd"], 1),
        rho=torch.cat([f["rho"][0], -f["rho"][1]], 1),
        logw=torch.cat(f["logw"], 1) - math.log(2),
    )


def logpdf(o, y):
    """Log density of each mode at each step. [B, M, P]"""
    e = (y[:, None] - o["mu"]) / o["sd"]
    r = o["rho"]
    q = 1 - r * r
    z = (e[..., 0] ** 2 - 2 * r * e[..., 0] * e[..., 1] + e[..., 1] ** 2) / q
    return -0.5 * z - o["sd"].log().sum(-1) - 0.5 * q.log() - math.log(2 * math.pi)


def losses(o, y, cfg):
    ade = (o["point"] - y).norm(dim=-1).mean(1)
    lp = logpdf(o, y)
    joint = torch.logsumexp(o["logw"] + lp.mean(-1) * cfg.get("sharp", 3.0), 1) / cfg.get(
        "sharp", 3.0
    )  # path likelihood, tempered
    step = torch.logsumexp(o["logw"][:, :, None] + lp, 1).mean(
        1
    )  # marginal of every step: what coverage measures
    best = (o["mu"] - y[:, None]).norm(dim=-1).mean(-1)
    return ade, -joint, -step, best.min(1).values
