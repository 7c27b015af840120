# ruff: noqa
"""Figures of a network on simulated sets and real places."""

import sys, numpy as np, torch, json
from net import *
from rows import build
import functools


@functools.lru_cache(None)
def real(name):
    from places import place, tracker_of

    r = place(name)
    return Data.of_place(r, build(r, tracker_of(name), min_age=3))


@torch.no_grad()
def predict(net, D, cfg, idx=None, bs=1024, sym=False):
    idx = np.arange(len(D)) if idx is None else idx
    outs = []
    for i in range(0, len(idx), bs):
        b = batch(D, idx[i : i + bs], cfg)
        o = forward(net, b, sym or cfg.get("sym"))
        outs.append(o)
    return {k: torch.cat([o[k] for o in outs]) for k in outs[0]}


@torch.no_grad()
def coverage(o, y, steps=(0, 4, 9), n=200, levels=(0.5, 0.9, 0.95)):
    """Share of truths inside the highest-density regions of the mixture at some steps (by sampling)."""
    g = torch.Generator().manual_seed(0)
    res = []
    B, M = o["logw"].shape
    for s in steps:
        k = torch.multinomial(o["logw"].exp(), n, True, generator=g)  # B n
        mu, sd, rho = (o[q][:, :, s] for q in ("mu", "sd", "rho"))
        gm = lambda a: a.gather(1, k[..., None].expand(-1, -1, 2)) if a.ndim == 3 else a.gather(1, k)
        e = torch.randn(B, n, 2, generator=g)
        r = gm(rho)
        z = torch.stack([e[..., 0], r * e[..., 0] + (1 - r * r).sqrt() * e[..., 1]], -1) * gm(sd) + gm(mu)

        def dens(x):  # B m 2
            d = (x[:, :, None] - mu[:, None]) / sd[:, None]
            r = rho[:, None]
            q = 1 - r * r
            lp = (
                -0.5 * (d[..., 0] ** 2 - 2 * r * d[..., 0] * d[..., 1] + d[..., 1] ** 2) / q
                - sd.log().sum(-1)[:, None]
                - 0.5 * q.log()
            )
            return torch.logsumexp(lp + o["logw"][:, None], -1)

        rank = (dens(z) > dens(y[:, s : s + 1])).float().mean(1)  # share of the mass that is denser
        res.append([float((rank <= l).float().mean()) for l in levels])
    return res


def figures(net, D, cfg, most=4000, seed=0, cover=False, sel=None, sym=False):
    idx = np.arange(len(D)) if sel is None else np.flatnonzero(sel)
    if len(idx) > most:
        idx = np.sort(np.random.default_rng(seed).choice(idx, most, replace=False))
    o = predict(net, D, cfg, idx, sym=sym)
    y = torch.from_numpy(D.y[idx])
    k = torch.arange(1, P + 1) * DT
    vel = torch.from_numpy(D.vel[idx])
    kal = (vel[:, None] * k[:, None] - y).norm(dim=-1).mean()
    cv = (
        (torch.from_numpy(D.hist[idx][:, :1]) + torch.from_numpy(D.last[idx])[:, None] * k[:, None] - y)
        .norm(dim=-1)
        .mean()
    )
    ade, nll, step, best = losses(o, y, cfg)
    f = dict(
        n=len(idx),
        cv=float(cv),
        kal=float(kal),
        ade=float(ade.mean()),
        nll=float(step.mean()),
        min6=float(best.mean()),
    )
    if cover:
        f["cover"] = coverage({q: v[:2000] for q, v in o.items()}, y[:2000])
    return f


def show(name, f):
    c = " ".join("/".join("%2.0f" % (100 * v) for v in row) for row in f.get("cover", []))
    return "%-11s n %5d cv %.3f kal %.3f net %.3f  /cv %.3f /kal %.3f /best %.3f nll %.2f min6 %.3f %s" % (
        name,
        f["n"],
        f["cv"],
        f["kal"],
        f["ade"],
        f["ade"] / f["cv"],
        f["ade"] / f["kal"],
        f["ade"] / min(f["cv"], f["kal"]),
        f["nll"],
        f["min6"],
        c,
    )
