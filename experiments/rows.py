# ruff: noqa
"""From detections to the rows of the network: causal tracking, inputs in the agent frame, targets. Numba, one code path."""

from __future__ import annotations
from dataclasses import dataclass, field
import math
import numpy as np
from numba import njit
from scipy import ndimage
from scipy.interpolate import CubicSpline

H = 8  # history steps of 0.3 s
K = 16  # neighbours
RANGE = 8.0
P = 10
DT = 0.3
STAND = 0.2
LOST = 2.0


@dataclass
class Map:
    sdf: np.ndarray  # [X,Y] float32 m, clipped
    origin: np.ndarray
    res: float

    @staticmethod
    def of(occ, origin, res):
        if occ.any():
            o = ndimage.distance_transform_edt(~occ)
            i = ndimage.distance_transform_edt(occ)
            d = np.where(occ, 0.5 - i, o - 0.5) * res
        else:
            d = np.full(occ.shape, 9.0)
        return Map(np.clip(d, -1, 9).astype(np.float32), np.asarray(origin, float), float(res))

    def dist(self, p):
        c = np.floor((p - self.origin) / self.res).astype(int)
        ok = ((c >= 0) & (c < self.sdf.shape)).all(-1)
        c = np.where(ok[..., None], c, 0)
        return np.where(ok, self.sdf[c[..., 0], c[..., 1]], 9.0)


FREE = Map(np.full((2, 2), 9.0, np.float32), np.zeros(2), 0.1)


@dataclass
class Rec:
    """Detections of a place sorted by (track, time), its map, and the truth of the persons."""

    name: str
    t: np.ndarray
    tid: np.ndarray
    pos: np.ndarray
    person: np.ndarray
    map: Map
    interval: float
    truth: object  # truth(person[M], t[M,P]) -> path [M,P,2], known [M]
    vel: np.ndarray | None = None  # true velocity (tracker 'truth')


@njit(cache=True)
def _track(t, tid, pos, q, r, s0, lost):
    M = len(t)
    sp = np.empty((M, 2))
    sv = np.empty((M, 2))
    sc = np.empty((M, 3))
    age = np.zeros(M, np.int64)
    life = np.zeros(M, np.int64)
    n = -1
    for m in range(M):
        if m == 0 or tid[m] != tid[m - 1] or t[m] - t[m - 1] > lost + 1e-6:
            n += 1
            sp[m] = pos[m]
            sv[m] = 0.0
            sc[m, 0] = r * r
            sc[m, 1] = 0.0
            sc[m, 2] = s0 * s0
            age[m] = 0
        else:
            d = t[m] - t[m - 1]
            pp, pv, vv = sc[m - 1, 0], sc[m - 1, 1], sc[m - 1, 2]
            pp = pp + 2 * d * pv + d * d * vv + q * d**3 / 3
            pv = pv + d * vv + q * d * d / 2
            vv = vv + q * d
            s = pp + r * r
            gp, gv = pp / s, pv / s
            for c in range(2):
                x = sp[m - 1, c] + d * sv[m - 1, c]
                i = pos[m, c] - x
                sp[m, c] = x + gp * i
                sv[m, c] = sv[m - 1, c] + gv * i
            sc[m, 0] = (1 - gp) * pp
            sc[m, 1] = (1 - gp) * pv
            sc[m, 2] = vv - gv * pv
            age[m] = age[m - 1] + 1
        life[m] = n
    return sp, sv, sc, age, life


@njit(cache=True)
def _headings(sv, age, stand):
    M = len(age)
    h = np.zeros(M)
    known = np.zeros(M, np.bool_)
    for m in range(M):
        sp = math.hypot(sv[m, 0], sv[m, 1])
        if sp >= stand:
            h[m] = math.atan2(sv[m, 1], sv[m, 0])
            known[m] = True
        elif age[m] > 0 and known[m - 1]:
            h[m] = h[m - 1]
            known[m] = True
        elif sp > 0:
            h[m] = math.atan2(sv[m, 1], sv[m, 0])
        elif age[m] > 0:
            h[m] = h[m - 1]
    return h


@njit(cache=True)
def _features(rows, t, sp, sv, life, age, det, heading, order, torder, max_age, nH, nK, rng_m):
    Q = len(rows)
    hist = np.zeros((Q, nH + 1, 2), np.float32)
    hm = np.zeros((Q, nH), np.float32)
    nb = np.zeros((Q, nK, 4), np.float32)
    nm = np.zeros((Q, nK), np.float32)
    last = np.zeros((Q, 2), np.float32)
    M = len(t)
    near = np.empty(nK)
    who = np.empty(nK, np.int64)
    for i in range(Q):
        m = rows[i]
        now = t[m]
        c, s = math.cos(heading[m]), math.sin(heading[m])
        x0, y0 = sp[m, 0], sp[m, 1]
        dx, dy = det[m, 0] - x0, det[m, 1] - y0
        hist[i, 0, 0] = c * dx + s * dy
        hist[i, 0, 1] = -s * dx + c * dy
        j = m
        for k in range(1, nH + 1):
            a = now - 0.3 * k
            while j > 0 and life[j - 1] == life[m] and t[j] > a + 1e-6:
                j -= 1
            if t[j] > a + 1e-6:
                break  # before birth
            px, py = det[j, 0], det[j, 1]
            if j < m:
                w = (a - t[j]) / (t[j + 1] - t[j])
                if w > 0:
                    px += w * (det[j + 1, 0] - px)
                    py += w * (det[j + 1, 1] - py)
            dx, dy = px - x0, py - y0
            hist[i, k, 0] = c * dx + s * dy
            hist[i, k, 1] = -s * dx + c * dy
            hm[i, k - 1] = 1.0
        if age[m] > 0:
            d = t[m] - t[m - 1]
            dx, dy = (det[m, 0] - det[m - 1, 0]) / d, (det[m, 1] - det[m - 1, 1]) / d
            last[i, 0] = c * dx + s * dy
            last[i, 1] = -s * dx + c * dy
        # neighbours
        lo = np.searchsorted(torder, now - max_age)
        hi = np.searchsorted(torder, now + 1e-6)
        n = 0
        for z in range(lo, hi):
            r = order[z]
            if life[r] == life[m]:
                continue
            if r + 1 < M and life[r + 1] == life[r] and t[r + 1] <= now + 1e-6:
                continue
            e = now - t[r]
            dx, dy = sp[r, 0] + e * sv[r, 0] - x0, sp[r, 1] + e * sv[r, 1] - y0
            d2 = dx * dx + dy * dy
            if d2 > rng_m * rng_m:
                continue
            if n < nK:
                w = n
                n += 1
            elif d2 < near[nK - 1]:
                w = nK - 1
            else:
                continue
            while w > 0 and near[w - 1] > d2:
                near[w] = near[w - 1]
                who[w] = who[w - 1]
                w -= 1
            near[w] = d2
            who[w] = r
        for w in range(n):
            r = who[w]
            e = now - t[r]
            dx, dy = sp[r, 0] + e * sv[r, 0] - x0, sp[r, 1] + e * sv[r, 1] - y0
            nb[i, w, 0] = c * dx + s * dy
            nb[i, w, 1] = -s * dx + c * dy
            nb[i, w, 2] = c * sv[r, 0] + s * sv[r, 1]
            nb[i, w, 3] = -s * sv[r, 0] + c * sv[r, 1]
            nm[i, w] = 1.0
    return hist, hm, nb, nm, last


def build(rec: Rec, tracker, rng=None, most=None, min_age=0, which=None):
    """Rows of a recording. tracker: (q, r, s0) or 'truth'. Returns a dict of arrays."""
    if tracker == "truth":
        _, _, _, age, life = _track(rec.t, rec.tid, rec.pos, 0.1, 0.1, 1.0, LOST)
        sp, sv = rec.pos.copy(), rec.vel.copy()
        sc = np.zeros((len(rec.t), 3))
    else:
        sp, sv, sc, age, life = _track(rec.t, rec.tid, rec.pos, *tracker, LOST)
    heading = _headings(sv, age, STAND)
    rows = np.flatnonzero(age >= min_age) if which is None else which
    if most is not None and len(rows) > 3 * most:
        rows = np.sort(rng.choice(rows, 3 * most, replace=False))
    path, known = rec.truth(rec.person[rows], rec.t[rows][:, None] + DT * np.arange(1, P + 1))
    if which is None:
        rows, path = rows[known], path[known]
    if most is not None and len(rows) > most:
        pick = np.sort(rng.choice(len(rows), most, replace=False))
        rows, path = rows[pick], path[pick]
    order = np.argsort(rec.t, kind="stable")
    max_age = max(1.25 * rec.interval, 0.35)
    hist, hm, nb, nm, last = _features(
        rows, rec.t, sp, sv, life, age, rec.pos, heading, order, rec.t[order], max_age, H, K, RANGE
    )
    c, s = np.cos(heading[rows]), np.sin(heading[rows])

    def local(v):
        cc, ss = (c, s) if v.ndim == 2 else (c[:, None], s[:, None])
        return np.stack([cc * v[..., 0] + ss * v[..., 1], -ss * v[..., 0] + cc * v[..., 1]], -1).astype(
            np.float32
        )

    return dict(
        hist=hist,
        hm=hm,
        nb=nb,
        nm=nm,
        last=last,
        vel=local(sv[rows]),
        cov=sc[rows].astype(np.float32),
        age=age[rows].astype(np.int32),
        y=local(path - sp[rows][:, None]),
        pos=sp[rows],
        heading=heading[rows],
        t=rec.t[rows],
        tid=rec.tid[rows],
        det=rec.pos[rows],
        row=rows,
    )


# ---- truth by spline through the detections of each life (real places)
class SplineTruth:
    def __init__(self, t, tid, pos, gap=0.6):
        self.parts = {}
        for k in np.unique(tid):
            m = tid == k
            tt, pp = t[m], pos[m]
            if len(tt) > 2:
                self.parts[k] = (
                    tt,
                    CubicSpline(tt, pp),
                    np.concatenate([[0], np.cumsum(np.diff(tt) > gap + 1e-6)]),
                )

    def __call__(self, person, t):
        out = np.zeros((*t.shape, 2))
        ok = np.zeros(len(t), bool)
        for k in np.unique(person):
            if k not in self.parts:
                continue
            tt, sp, piece = self.parts[k]
            m = np.flatnonzero(person == k)
            out[m] = sp(t[m])
            end = t[m, -1]
            first = np.searchsorted(tt, t[m, 0] - DT + 1e-6) - 1
            last = np.minimum(np.searchsorted(tt, end - 1e-6), len(tt) - 1)
            ok[m] = (end <= tt[-1] + 1e-6) & (piece[last] == piece[np.maximum(first, 0)])
        return out, ok


class GridTruth:
    """Persons sampled every dt from their own start; flat arrays."""

    def __init__(self, start_index, count, t0, dt, pos):
        self.a, self.n, self.t0, self.dt, self.pos = start_index, count, t0, dt, pos

    def __call__(self, person, t):
        u = (t - self.t0[person][:, None]) / self.dt
        ok = (u[:, -1] <= self.n[person] - 1 + 1e-6) & (u[:, 0] >= -1e-6)
        u = np.clip(u, 0, self.n[person][:, None] - 1.0)
        i = np.minimum(u.astype(int), np.maximum(self.n[person][:, None] - 2, 0))
        w = (u - i)[..., None]
        i = i + self.a[person][:, None]
        j = np.minimum(i + 1, len(self.pos) - 1)
        return self.pos[i] * (1 - w) + self.pos[j] * w, ok
