# ruff: noqa
"""Simulated worlds of many kinds. `world(kind, seed)` -> World (map, true tracks at 0.1 s)."""

from __future__ import annotations
import math
from dataclasses import dataclass
import numpy as np
from numba import njit
from scipy import ndimage
from rows import Map, Rec, GridTruth
from pedpred.scenes import OccupancyMap
from pedpred.simulation.ground import ground_of
from pedpred.simulation.routing import routes_to
from pedpred.simulation.settings import RoutingSettings
from pedpred.simulation.kernel import border, way

RES = 0.1
STEP = 0.05
EVERY = 2  # records each 0.1 s

# person parameters: columns
V0, TAU, RAD, TGAP, STOPRATE, STOPMEAN, CSM, PGROUP = range(8)


@njit(cache=True, nogil=True)
def walk(
    steps,
    skip,
    start_t,
    entry,
    plan,
    pausing,
    pp,
    group,
    ground,
    routes,
    use_map,
    mp,
    noise_seed,
    reach,
    loop,
):
    """mp: V0p, sigma, antic, U0, R, unseen, noise, wander_sd, wander_tau, speed_sd, A, D, Aw, Dw, spawn_gap"""
    np.random.seed(noise_seed)
    N = len(start_t)
    pos = entry.copy()
    vel = np.zeros((N, 2))
    state = np.zeros(N, np.int64)  # 0 waiting,1 active,2 gone
    leg = np.zeros(N, np.int64)
    pause = np.zeros(N)
    ou = np.zeros((N, 2))
    e = np.zeros((N, 2))
    ed = np.zeros((N, 2))
    acc = np.zeros((N, 2))
    nz = np.zeros((N, 2))
    cap = steps // 2 * min(N, 4000) + 1
    cnt = 0
    act = np.empty(N, np.int64)
    na = 0
    rec_k = np.empty(cap, np.int32)
    rec_n = np.empty(cap, np.int32)
    rec = np.empty((cap, 4), np.float32)
    Vs, sig, antic, U0, R, unseen, nzs, wsd, wtau, ssd, A, D, Aw, Dw, gap0 = mp
    cosphi = math.cos(math.radians(100.0))
    first = 0
    for step in range(steps):
        now = step * 0.05
        # spawn
        for n in range(first, N):
            if start_t[n] > now:
                break
            if state[n] != 0:
                if n == first:
                    first += 1
                continue
            free = True
            for z in range(na):
                m = act[z]
                dx, dy = pos[m, 0] - entry[n, 0], pos[m, 1] - entry[n, 1]
                if dx * dx + dy * dy < gap0 * gap0:
                    free = False
                    break
            if free:
                state[n] = 1
                act[na] = n
                na += 1
                if use_map:
                    a, b = way(entry[n, 0], entry[n, 1], plan[n, 0], routes)
                else:
                    a, b = (
                        routes.target[plan[n, 0], 0] - entry[n, 0],
                        routes.target[plan[n, 0], 1] - entry[n, 1],
                    )
                    l = math.hypot(a, b) + 1e-9
                    a /= l
                    b /= l
                if pausing[n, 0] >= 0:
                    f = 0.8 if now > 0.3 else np.random.random()
                    vel[n, 0], vel[n, 1] = a * pp[n, 0] * f, b * pp[n, 0] * f
                e[n, 0], e[n, 1] = a, b
                ou[n, 0], ou[n, 1] = np.random.randn(), np.random.randn()
                if pausing[n, 0] < 0:
                    pause[n] = now - pausing[n, 0]  # begins standing
        # directions
        k = 0
        while k < na:
            n = act[k]
            g = plan[n, leg[n]]
            tx, ty = routes.target[g, 0] - pos[n, 0], routes.target[g, 1] - pos[n, 1]
            if tx * tx + ty * ty <= reach * reach:
                last = leg[n] + 1 >= plan.shape[1] or plan[n, leg[n] + 1] < 0
                if last and not loop:
                    state[n] = 2
                    act[k] = act[na - 1]
                    na -= 1
                    continue
                if not last:
                    leg[n] += 1
                    if pausing[n, leg[n]] > 0:
                        pause[n] = now + pausing[n, leg[n]]
                    g = plan[n, leg[n]]
            if use_map:
                a, b = way(pos[n, 0], pos[n, 1], g, routes)
            else:
                tx, ty = routes.target[g, 0] - pos[n, 0], routes.target[g, 1] - pos[n, 1]
                l = math.hypot(tx, ty) + 1e-9
                a, b = tx / l, ty / l
            th = ou[n, 0] * wsd
            c, s = math.cos(th), math.sin(th)
            e[n, 0], e[n, 1] = c * a - s * b, s * a + c * b
            f = 0.05 / wtau
            ou[n, 0] += -f * ou[n, 0] + math.sqrt(2 * f) * np.random.randn()
            f = 0.05 / 3.0
            ou[n, 1] += -f * ou[n, 1] + math.sqrt(2 * f) * np.random.randn()
            if pp[n, 4] > 0 and pause[n] <= now and np.random.random() < pp[n, 4] * 0.05:
                pause[n] = now - pp[n, 5] * math.log(np.random.random() + 1e-9)
            k += 1
        for z in range(na):
            n = act[z]
            x, y = pos[n, 0], pos[n, 1]
            want = pp[n, 0] * max(0.3, 1 + ssd * ou[n, 1])
            if pause[n] > now:
                want = 0.0
            ex, ey = e[n, 0], e[n, 1]
            fx, fy = 0.0, 0.0
            sx, sy = 0.0, 0.0
            room = 1e9
            gx, gy, gn = 0.0, 0.0, 0
            for zz in range(na):
                m = act[zz]
                if m == n:
                    continue
                dx, dy = x - pos[m, 0], y - pos[m, 1]
                d2 = dx * dx + dy * dy
                if group[n] >= 0 and group[m] == group[n] and d2 < 64.0:
                    gx += pos[m, 0]
                    gy += pos[m, 1]
                    gn += 1
                    if d2 > 0.36:
                        continue
                if d2 > 9.0:
                    continue
                d = math.sqrt(d2) + 1e-6
                if pp[n, 6] > 0.5:
                    w = A * math.exp((pp[n, 2] + pp[m, 2] - d) / D)
                    front = -(dx * ex + dy * ey) / d
                    w *= 1.0 if front > -0.2 else unseen
                    sx += w * dx / d
                    sy += w * dy / d
                elif Vs > 0:
                    l = math.hypot(vel[m, 0], vel[m, 1]) * antic
                    yx, yy = l * e[m, 0], l * e[m, 1]
                    ax, ay = dx - yx, dy - yy
                    th_ = math.sqrt(ax * ax + ay * ay)
                    sq = (d + th_) ** 2 - (yx * yx + yy * yy)
                    b = 0.5 * math.sqrt(max(sq, 4e-6))
                    p = Vs / sig * math.exp(-b / sig) * (d + th_) / (4 * b)
                    th_ = max(th_, 1e-3)
                    px, py = p * (dx / d + ax / th_), p * (dy / d + ay / th_)
                    if -(ex * px + ey * py) < math.hypot(px, py) * cosphi:
                        px *= unseen
                        py *= unseen
                    fx += px
                    fy += py
                    if d < pp[n, 2] + pp[m, 2]:  # bodies
                        fx += 20.0 * (pp[n, 2] + pp[m, 2] - d) * dx / d
                        fy += 20.0 * (pp[n, 2] + pp[m, 2] - d) * dy / d
            if use_map:
                dist, awx, awy = border(x, y, ground)
                if pp[n, 6] > 0.5:
                    w = Aw * math.exp((pp[n, 2] - dist) / Dw)
                    sx += w * awx
                    sy += w * awy
                else:
                    w = U0 / R * math.exp(-max(dist, 0.0) / R)
                    fx += w * awx
                    fy += w * awy
            if pp[n, 6] > 0.5:
                ux, uy = ex + sx, ey + sy
                l = math.hypot(ux, uy) + 1e-9
                ux, uy = ux / l, uy / l
                f = 0.05 / 0.3
                ed[n, 0] += f * (ux - ed[n, 0])
                ed[n, 1] += f * (uy - ed[n, 1])
                l = math.hypot(ed[n, 0], ed[n, 1]) + 1e-9
                dxn, dyn = ed[n, 0] / l, ed[n, 1] / l
            else:
                dxn, dyn = ex, ey
            if pp[n, 3] > 0:  # headway
                for zz in range(na):
                    m = act[zz]
                    if m == n:
                        continue
                    dx, dy = pos[m, 0] - x, pos[m, 1] - y
                    al = dx * dxn + dy * dyn
                    if al <= 0 or al > 4.0:
                        continue
                    la = abs(-dx * dyn + dy * dxn)
                    l = pp[n, 2] + pp[m, 2]
                    if la < l * 0.95:
                        room = min(room, math.sqrt(dx * dx + dy * dy) - l)
                want = min(want, max(0.0, room / pp[n, 3]))
            if gn > 0:
                gx, gy = gx / gn - x, gy / gn - y
                d = math.hypot(gx, gy)
                al = gx * ex + gy * ey
                la = -gx * ey + gy * ex
                want *= min(1.25, max(0.4, 1 + 0.25 * al))
                pull = pp[n, 7]
                if abs(la) > 0.9:
                    fx += pull * (-ey) * np.sign(la) * min(abs(la) - 0.9, 1.0)
                    fy += pull * ex * np.sign(la) * min(abs(la) - 0.9, 1.0)
                elif abs(la) < 0.5:
                    fx -= 0.5 * pull * (-ey) * np.sign(la) * (0.5 - abs(la))
                    fy -= 0.5 * pull * ex * np.sign(la) * (0.5 - abs(la))
            if step % 2 == 0:
                nz[n, 0], nz[n, 1] = nzs * np.random.randn(), nzs * np.random.randn()
            sc = 0.2 if pause[n] > now else 1.0
            acc[n, 0] = (want * dxn - vel[n, 0]) / pp[n, 1] + fx + nz[n, 0] * sc
            acc[n, 1] = (want * dyn - vel[n, 1]) / pp[n, 1] + fy + nz[n, 1] * sc
        for z in range(na):
            n = act[z]
            vx, vy = vel[n, 0] + acc[n, 0] * 0.05, vel[n, 1] + acc[n, 1] * 0.05
            s, most = math.hypot(vx, vy), 1.3 * pp[n, 0]
            if s > most:
                vx, vy = vx * most / s, vy * most / s
            nx, ny = pos[n, 0] + vx * 0.05, pos[n, 1] + vy * 0.05
            if use_map:
                d, ax, ay = border(nx, ny, ground)
                if d < 0.08 and d < border(pos[n, 0], pos[n, 1], ground)[0]:
                    al = math.hypot(ax, ay) + 1e-9
                    ax, ay = ax / al, ay / al
                    dot = vx * ax + vy * ay
                    if dot < 0:
                        vx -= dot * ax
                        vy -= dot * ay
                    nx, ny = pos[n, 0] + vx * 0.05, pos[n, 1] + vy * 0.05
                    if border(nx, ny, ground)[0] < 0.0:
                        nx, ny = pos[n, 0], pos[n, 1]
                        vx = 0.0
                        vy = 0.0
            vel[n, 0], vel[n, 1] = vx, vy
            pos[n, 0], pos[n, 1] = nx, ny
        if step % 2 == 1 and step >= skip:
            for z in range(na):
                if cnt < cap:
                    n = act[z]
                    rec_k[cnt] = (step - skip) // 2
                    rec_n[cnt] = n
                    rec[cnt, 0], rec[cnt, 1], rec[cnt, 2], rec[cnt, 3] = (
                        pos[n, 0],
                        pos[n, 1],
                        vel[n, 0],
                        vel[n, 1],
                    )
                    cnt += 1
    return rec_k[:cnt], rec_n[:cnt], rec[:cnt]


@dataclass
class World:
    kind: str
    map: Map
    k: np.ndarray
    n: np.ndarray
    pos: np.ndarray
    vel: np.ndarray  # sorted by (n, k), 0.1 s
    view: tuple  # lo, hi of what sensors see


def U(rng, a, b):
    return rng.uniform(a, b)


def LU(rng, a, b):
    return math.exp(rng.uniform(math.log(a), math.log(b)))


def mover(rng, dense=False):
    """World-wide model constants."""
    csm = rng.random() < (0.6 if dense else 0.35)
    helb = rng.random() < 0.3
    if helb and not csm:
        Vs, sig, antic, U0, R = 2.1, 0.3, 0.5, 10.0, 0.2
    else:
        Vs, sig, antic, U0, R = (
            LU(rng, 0.4, 3),
            LU(rng, 0.1, 0.35),
            U(rng, 0.3, 1.0),
            LU(rng, 2, 12),
            LU(rng, 0.06, 0.35),
        )
    mp = (
        Vs,
        sig,
        antic,
        U0,
        R,
        U(rng, 0.1, 0.6),
        U(rng, 0.0, 0.5),
        U(rng, 0.02, 0.22),
        U(rng, 0.8, 4),
        U(rng, 0.02, 0.12),
        U(rng, 1.5, 6),
        U(rng, 0.1, 0.35),
        U(rng, 2, 6),
        U(rng, 0.05, 0.2),
        U(rng, 0.45, 0.7),
    )
    return csm, mp


def people(rng, N, csm, dense=False, mean=None, stop=None):
    pp = np.zeros((N, 8))
    if mean is None:
        mean = rng.choice([U(rng, 1.15, 1.5), U(rng, 0.5, 1.1), U(rng, 1.5, 2.0)], p=[0.7, 0.18, 0.12])
    pp[:, V0] = np.clip(rng.normal(mean, U(rng, 0.12, 0.32) * mean / 1.3, N), 0.3, 2.5)
    pp[:, TAU] = np.clip(
        (LU(rng, 0.25, 0.9) if csm else LU(rng, 0.35, 1.3)) * np.exp(rng.normal(0, 0.2, N)), 0.2, 2
    )
    pp[:, RAD] = U(rng, 0.12, 0.2) + rng.uniform(-0.02, 0.02, N)
    gap = LU(rng, 0.5, 1.4) if (csm or dense or rng.random() < 0.5) else 0
    pp[:, TGAP] = gap * np.exp(rng.normal(0, 0.2, N))
    if stop is None:
        stop = rng.choice([0.0, LU(rng, 0.002, 0.04)], p=[0.6, 0.4])
    pp[:, STOPRATE] = stop * (rng.random(N) < 0.6)
    pp[:, STOPMEAN] = LU(rng, 1.5, 15)
    pp[:, CSM] = csm
    pp[:, PGROUP] = U(rng, 0.3, 2)
    return pp


def routing(rng):
    return RoutingSettings(0.2, U(rng, 0.2, 0.5), U(rng, 0.55, 1.3), U(rng, 0.3, 0.9))


def paint(size):
    return np.zeros(np.ceil(np.asarray(size) / RES).astype(int), bool)


def rect(a, lo, hi, v=True):
    l = np.round(np.asarray(lo) / RES).astype(int)
    h = np.round(np.asarray(hi) / RES).astype(int)
    l = np.clip(l, 0, a.shape)
    h = np.clip(h, 0, a.shape)
    a[l[0] : h[0], l[1] : h[1]] = v


def disc(a, c, r, v=True):
    i = np.moveaxis(np.indices(a.shape), 0, -1) * RES + RES / 2
    a[((i - c) ** 2).sum(-1) < r * r] = v


def shell(free, rng):
    """Occupied cells round a free shape: everything else, or walls of some thickness."""
    occ = ~free
    if rng.random() < 0.5:
        return occ
    return occ & ndimage.binary_dilation(free, iterations=int(rng.integers(2, 6)))


def corridors(rng):
    """Arms of 1.8-5 m meeting at a node, perhaps with another bend: straight, corner, T, crossing."""
    n = rng.choice(["L", "T", "X", "Z", "I"], p=[0.34, 0.28, 0.16, 0.14, 0.08])
    w = lambda: U(rng, 1.8, 5.0) if rng.random() < 0.8 else U(rng, 1.4, 8.0)
    L = U(rng, 6, 14)
    S = 2 * L + 8
    c = np.array([S / 2, S / 2])
    free = paint((S, S))
    wh, wv = w(), w()
    if rng.random() < 0.4:
        wv = wh
    arms = dict(L=["E", "N"], T=["E", "W", "N"], X=["E", "W", "N", "S"], I=["E", "W"], Z=["E", "N"])[n]
    rect(free, c - [wv / 2, wh / 2], c + [wv / 2, wh / 2])
    end = {}
    for a in arms:
        if a == "E":
            rect(free, c - [0, wh / 2], (S, c[1] + wh / 2))
            end[a] = ((S - 3.5, c[1] - wh / 2), (S, c[1] + wh / 2))
        if a == "W":
            rect(free, (0, c[1] - wh / 2), c + [0, wh / 2])
            end[a] = ((0, c[1] - wh / 2), (3.5, c[1] + wh / 2))
        if a == "N":
            rect(free, c - [wv / 2, 0], (c[0] + wv / 2, S))
            end[a] = ((c[0] - wv / 2, S - 3.5), (c[0] + wv / 2, S))
        if a == "S":
            rect(free, (c[0] - wv / 2, 0), c + [wv / 2, 0])
            end[a] = ((c[0] - wv / 2, 0), (c[0] + wv / 2, 3.5))
    if n == "Z":  # north arm bends east or west after a while
        h = U(rng, 3, L - 2)
        w2 = w()
        free[:, int((c[1] + h + w2) / RES) :] = False
        if rng.random() < 0.5:
            rect(free, (c[0] - wv / 2, c[1] + h), (S, c[1] + h + w2))
            end["N"] = ((S - 3.5, c[1] + h), (S, c[1] + h + w2))
        else:
            rect(free, (0, c[1] + h), (c[0] + wv / 2, c[1] + h + w2))
            end["N"] = ((0, c[1] + h), (3.5, c[1] + h + w2))
    if n in "XT" and rng.random() < 0.35:
        r = U(rng, 0.2, 0.5)
        if min(wh, wv) > 2 * r + 1.6:
            disc(free, c + rng.uniform(-0.5, 0.5, 2), r, False)
    elif rng.random() < 0.15:  # small obstacles in the arms
        for _ in range(rng.integers(1, 4)):
            p = (
                c
                + rng.uniform(-L, L, 2) * np.array([1, 0] if rng.random() < 0.5 else [0, 1])
                + rng.uniform(-1, 1, 2)
            )
            t = free.copy()
            disc(t, p, U(rng, 0.1, 0.35), False)
            if ndimage.label(ndimage.distance_transform_edt(t) > 5)[1] == 1:
                free = t
    return free, list(end.values()), (wh + wv) / 2, n


def bottlenecks(rng):
    W, L = U(rng, 3, 12), U(rng, 16, 30)
    free = paint((L, W + 2))
    rect(free, (0, 1), (L, 1 + W))
    at = U(rng, L * 0.4, L * 0.6)
    th = U(rng, 0.2, 2.5)
    rect(free, (at, 0), (at + th, W + 2), False)
    narrow = 0
    for _ in range(rng.integers(1, 3) if W > 7 else 1):
        o = U(rng, 0.9, min(4.0, W * 0.8))
        y = U(rng, 1, 1 + W - o) if rng.random() < 0.5 else 1 + (W - o) / 2
        rect(free, (at, y), (at + th, y + o))
        narrow += o
    return free, [((0, 1), (6, 1 + W)), ((L - 6, 1), (L, 1 + W))], W, narrow


def points(rng, free, lo, hi, n, clear):
    d = ndimage.distance_transform_edt(free) * RES
    l = np.floor(np.asarray(lo) / RES).astype(int).clip(0)
    h = np.ceil(np.asarray(hi) / RES).astype(int)
    sub = np.argwhere(d[l[0] : h[0], l[1] : h[1]] > clear)
    if len(sub) == 0:
        sub = np.argwhere(d[l[0] : h[0], l[1] : h[1]] > 0.15)
    return (sub[rng.integers(len(sub), size=n)] + l + 0.5) * RES


def flows(rng, free, ends, width, dense_p, seconds, kind, narrow=None):
    """People who come in at some ends and leave at others."""
    dense = rng.random() < dense_p
    csm, mp = mover(rng, dense)
    E = len(ends)
    pattern = rng.choice(["one", "merge", "two", "all"], p=[0.35, 0.25, 0.2, 0.2])
    out = rng.integers(E)
    if pattern == "one":
        a, b = rng.choice(E, 2, replace=False)
        od = [(a, b)]
    elif pattern == "merge":
        od = [(a, out) for a in range(E) if a != out]
    elif pattern == "two":
        a, b = rng.choice(E, 2, replace=False)
        od = [(a, b), (b, a)]
    else:
        od = [(a, b) for a in range(E) for b in range(E) if a != b]
    if kind == "X" and rng.random() < 0.6:
        od = [(0, 1), (2, 3)] if rng.random() < 0.7 else [(1, 0), (2, 3)]
    nt = 4
    targets = np.concatenate([points(rng, free, *e, nt, 0.35) for e in ends])
    rate = (LU(rng, 0.4, 1.3) * (narrow or width) if dense else LU(rng, 0.04, 0.6) * (narrow or width)) / len(
        od
    )
    T = seconds + 25
    st, en, pl = [], [], []
    for a, b in od:
        r = rate * LU(rng, 0.5, 1.5)
        n = min(int(r * T) + 1, 250)
        st.append(np.sort(rng.uniform(0, T, n)))
        en.append(points(rng, free, *ends[a], n, 0.3))
        pl.append(b * nt + rng.integers(nt, size=n))
    if kind == "B" and dense:  # a crowd waits already
        n = int(np.clip(U(rng, 0.3, 2.2) * width * 6, 5, 90))
        a, b = od[0]
        lo, hi = ends[a]
        lo2, hi2 = np.array(lo, float), np.array(hi, float)
        st.append(np.zeros(n))
        en.append(points(rng, free, lo2, hi2, n, 0.2))
        pl.append(b * nt + rng.integers(nt, size=n))
        mp = (*mp[:-1], 0.35)
    st, en, pl = np.concatenate(st), np.concatenate(en), np.concatenate(pl)
    o = np.argsort(st, kind="stable")
    st, en, pl = st[o], en[o], pl[o]
    N = len(st)
    pp = people(rng, N, csm, dense, stop=None if rng.random() < 0.4 else 0.0)
    plan = np.full((N, 2), -1)
    plan[:, 0] = pl
    pau = np.zeros((N, 2))
    grp = np.full(N, -1)
    if rng.random() < 0.25 and not dense:
        for i in range(0, N - 1, 2):
            if rng.random() < 0.5:
                grp[i : i + 2] = i
                plan[i + 1] = plan[i]
                st[i + 1] = st[i]
                pp[i + 1, V0] = pp[i, V0]
                en[i + 1] = en[i] + rng.uniform(-0.5, 0.5, 2)
    return st, en, plan, pau, pp, grp, mp, targets


def world(kind, seed, seconds=50.0):
    rng = np.random.default_rng([77, hash_of(kind), seed])
    skip = int(20 / STEP)
    if kind == "bottleneck":
        seconds = 35.0
    loop = False
    reach = 0.6
    use_map = True
    if kind in ("corridor", "bottleneck"):
        if kind == "corridor":
            free, ends, width, n = corridors(rng)
            dp = 0.45
            narrow = None
        else:
            free, ends, width, narrow = bottlenecks(rng)
            n = "B"
            dp = 0.7
        st, en, plan, pau, pp, grp, mp, targets = flows(rng, free, ends, width, dp, seconds, n, narrow)
        reach = 1.0
        occ = shell(free, rng)
        walk_occ = ~free
        S = np.array(free.shape) * RES
        m = U(rng, 0, 4.5)
        view = (np.full(2, m), S - m)
        if kind == "bottleneck":
            view = (np.array([m, 0]), np.array([S[0] - m, S[1]]))
    elif kind == "room":  # closed rooms full of obstacles, people between random targets
        from pedpred.simulation.clutter import ClutterSettings, cluttered_room

        a = U(rng, 8, 30)
        cl = ClutterSettings(
            (a, a + 8),
            (0, 3),
            4.0,
            (1.3, 3.2),
            0.6,
            (0.2, 0.4),
            0.35,
            (0.2, 0.5),
            (2.5, 5.5),
            (0.0, 0.14),
            (0.0, 0.6),
            (0.6, 1.6),
            0.6,
            150,
        )
        lay = cluttered_room(cl, rng)
        o = lay.occupancy()
        walk_occ = occ = o.occupied
        free = ~occ
        S = np.array(free.shape) * RES
        area = free.sum() * RES * RES
        dense = rng.random() < 0.2
        csm, mp = mover(rng, dense)
        N = int(np.clip(area * (LU(rng, 0.15, 0.6) if dense else LU(rng, 0.01, 0.12)), 2, 90))
        ntg = 24
        targets = points(rng, free, (0, 0), S, ntg, 0.55)
        T = seconds + 25
        L = 16
        far = np.linalg.norm(targets[:, None] - targets[None], axis=-1)
        plan = np.zeros((N, L), int)
        plan[:, 0] = rng.integers(ntg, size=N)
        for l in range(1, L):
            for i in range(N):
                c = np.flatnonzero(far[plan[i, l - 1]] > min(8.0, far[plan[i, l - 1]].max() * 0.7))
                plan[i, l] = rng.choice(c)
        pshare = rng.choice([0.0, U(rng, 0.1, 0.9)])
        pau = np.where(rng.random((N, L)) < pshare, rng.exponential(LU(rng, 1, 20), (N, L)), 0.0)
        st = np.zeros(N)
        en = points(rng, free, (0, 0), S, N, 0.4)
        pp = people(rng, N, csm, dense)
        if rng.random() < 0.3:  # some stand all the time
            stand = rng.random(N) < U(rng, 0.1, 0.5)
            pau[stand, 0] = -1000.0
        grp = np.full(N, -1)
        loop = True
        mp = (*mp[:-1], 0.3)
        view = (np.zeros(2) - 1, S + 1)
        if rng.random() < 0.3:
            c = rng.uniform(S * 0.3, S * 0.7)
            h = U(rng, 5, 12)
            view = (c - h, c + h)
    elif kind == "open":  # squares with few or no obstacles; streams, groups, standing people
        S = rng.uniform(12, 55, 2)
        free = np.ones(np.ceil(S / RES).astype(int), bool)
        deco = rng.choice(["none", "posts", "walls", "mixed"], p=[0.4, 0.2, 0.2, 0.2])
        if deco in ("posts", "mixed"):
            for _ in range(rng.integers(1, 8)):
                p = rng.uniform(S * 0.1, S * 0.9)
                if rng.random() < 0.5:
                    disc(free, p, U(rng, 0.1, 0.5), False)
                else:
                    h = rng.uniform(0.2, 1.5, 2)
                    rect(free, p - h, p + h, False)
        if deco in ("walls", "mixed"):
            m = U(rng, 1, S[1] * 0.3)
            g0 = U(rng, 0, S[0] * 0.7)
            rect(free, (0, 0), (S[0], m), False)
            if rng.random() < 0.5:
                rect(free, (g0, 0), (g0 + U(rng, 1.5, 5), m))
            if rng.random() < 0.3:
                rect(free, (0, S[1] - U(rng, 0.5, 2)), S, False)
        use_map = not free.all()
        dense = rng.random() < 0.15
        csm, mp = mover(rng, dense)
        rate = LU(rng, 0.05, 1.2) * (3 if dense else 1)
        T = seconds + 25
        N = min(int(rate * T) + 2, 250)
        ne = rng.integers(2, 7)
        ep = []
        for _ in range(ne):
            s = rng.integers(4)
            f = rng.uniform(0.1, 0.9)
            ep.append(
                [f * S[0], S[1] * 0.03]
                if s == 0
                else [f * S[0], S[1] * 0.97]
                if s == 1
                else [S[0] * 0.03, f * S[1]]
                if s == 2
                else [S[0] * 0.97, f * S[1]]
            )
        ep = np.array(ep)
        if rng.random() < 0.4:  # two ends, as in a street
            ax = rng.integers(2)
            ep = S * np.where(np.arange(2) == ax, [[0.03], [0.97]], 0.5)
        spread = U(rng, 0.5, 6)
        nt = 5
        targets = []
        for p in ep:
            targets.append(np.clip(p + rng.uniform(-spread, spread, (nt, 2)), 0.3, S - 0.3))
        targets = np.concatenate(targets)
        if use_map:
            d = ndimage.distance_transform_edt(free) * RES
            fc = np.argwhere(d > 0.4)
            fx = lambda q: np.array(
                [
                    ((fc[np.argmin(((fc * RES - p) ** 2).sum(1))] + 0.5) * RES)
                    if d[tuple(np.minimum((p / RES).astype(int), np.array(d.shape) - 1))] <= 0.4
                    else p
                    for p in q
                ]
            )
            targets = fx(targets)
        a = rng.integers(len(ep), size=N)
        b = (a + rng.integers(1, max(len(ep), 2), size=N)) % len(ep)
        plan = np.full((N, 2), -1)
        plan[:, 0] = b * nt + rng.integers(nt, size=N)
        if rng.random() < 0.3:
            mid = rng.random(N) < 0.4
            plan[mid, 1] = plan[mid, 0]
            plan[mid, 0] = rng.integers(len(targets), size=mid.sum())
        en = targets[a * nt + rng.integers(nt, size=N)] + rng.uniform(-0.5, 0.5, (N, 2))
        st = np.sort(rng.uniform(0, T, N))
        pp = people(rng, N, csm, dense)
        pau = np.where(rng.random((N, 2)) < U(rng, 0, 0.4), rng.exponential(5, (N, 2)), 0.0)
        grp = np.full(N, -1)
        if rng.random() < 0.6:
            share = U(rng, 0.1, 0.6)
            i = 0
            while i < N - 3:
                if rng.random() < share:
                    z = rng.integers(2, 4)
                    grp[i : i + z] = i
                    for j in range(1, z):
                        plan[i + j] = plan[i]
                        st[i + j] = st[i]
                        pp[i + j] = pp[i]
                        en[i + j] = en[i] + rng.uniform(-1.0, 1.0, 2)
                    i += z
                else:
                    i += 1
        ns = rng.choice([0, int(rng.integers(1, 25))])
        if ns:  # standing people in clusters
            c = rng.uniform(S * 0.2, S * 0.8, (max(ns // 3, 1), 2))
            q = c[rng.integers(len(c), size=ns)] + rng.normal(0, 0.8, (ns, 2))
            q = np.clip(q, 0.5, S - 0.5)
            if use_map:
                q = fx(q)
            p2 = np.full((ns, 2), -1)
            p2[:, 0] = rng.integers(len(targets), size=ns)
            u2 = np.zeros((ns, 2))
            u2[:, 0] = -rng.exponential(60, ns) - 5
            st = np.concatenate([np.zeros(ns), st])
            en = np.concatenate([q, en])
            plan = np.concatenate([p2, plan])
            pau = np.concatenate([u2, pau])
            pp = np.concatenate([people(rng, ns, csm, dense), pp])
            grp = np.concatenate([np.full(ns, -1), grp])
        mp = (*mp[:-1], 0.3)
        reach = 1.0
        occ = ~free
        walk_occ = occ
        m = U(rng, 0, 2)
        view = (np.full(2, m), S - m)
    om = OccupancyMap(walk_occ, np.zeros(2), RES)
    if use_map:
        ground = ground_of(om)
        routes = routes_to(targets, ground, routing(rng))
    else:
        ground = ground_of(OccupancyMap(np.zeros((3, 3), bool), np.zeros(2), RES))
        from pedpred.simulation.routing import Routes

        routes = Routes(targets.copy(), np.zeros(2), 0.2, np.zeros((len(targets), 2, 2, 2), np.float32))
    steps = skip + int(seconds / STEP)
    k, n, r = walk(
        steps,
        skip,
        st.astype(float),
        en.astype(float),
        plan.astype(np.int64),
        pau.astype(float),
        pp,
        grp.astype(np.int64),
        ground,
        routes,
        use_map,
        mp,
        int(rng.integers(2**31)),
        reach,
        loop,
    )
    o = np.lexsort((k, n))
    k, n, r = k[o], n[o], r[o].astype(float)
    return World(kind, Map.of(occ, np.zeros(2), RES), k, n, r[:, :2], r[:, 2:], view)


def lone(seed):
    """People far from each other on free ground: straight at any constant speed, or standing."""
    rng = np.random.default_rng([78, seed])
    N, T = 24, 400
    v = np.where(rng.random(N) < 0.3, 0.0, rng.uniform(0.2, 2.6, N))
    a = rng.uniform(0, 2 * math.pi, N)
    d = np.stack([np.cos(a), np.sin(a)], 1) * v[:, None]
    k = np.tile(np.arange(T), N)
    n = np.repeat(np.arange(N), T)
    pos = np.stack([np.arange(N) * 500.0, np.zeros(N)], 1)[n] + d[n] * (k * 0.1)[:, None]
    return World(
        "lone",
        Map(np.full((2, 2), 9.0, np.float32), np.zeros(2), 0.1),
        k,
        n,
        pos,
        d[n],
        (np.full(2, -1e9), np.full(2, 1e9)),
    )


def hash_of(kind):
    return sum(ord(c) * 31**i for i, c in enumerate(kind)) % 100003


def truth_of(w):
    _, first, who = np.unique(w.n, return_index=True, return_inverse=True)
    count = np.diff(np.append(first, len(w.n)))
    return GridTruth(first, count, w.k[first] * 0.1, 0.1, w.pos), who


def perfect(w, every=3):
    """True states each 0.3 s."""
    truth, who = truth_of(w)
    phase = 0
    inside = ((w.pos >= w.view[0]) & (w.pos <= w.view[1])).all(1)
    m = np.flatnonzero((w.k % every == 0) & inside)
    return Rec(w.kind, w.k[m] * 0.1, who[m], w.pos[m], who[m], w.map, 0.1 * every, truth, w.vel[m])


def sensed(w, rng):
    """Detections through a sensor; person keeps the truth."""
    truth, who = truth_of(w)
    rate = rng.choice([2.0, 2.5, 2.5, 2.67, 2.67, 3.33, 4.0, 5.0, 8.0, 10.0, 15.0])
    noise = LU(rng, 0.005, 0.1) if rng.random() < 0.8 else 0.005
    sway = U(rng, 0.0, 0.07) if rng.random() < 0.7 else 0.0
    swf = U(rng, 0.7, 1.1)
    drop = rng.choice([0.0, U(rng, 0, 0.12)], p=[0.5, 0.5])
    quant = rng.choice([0.0, U(rng, 0.02, 0.08)], p=[0.7, 0.3])
    jit = rng.choice([0.0, U(rng, 0, 0.03)])
    late = rng.choice([0.0, U(rng, 0, 3.0)], p=[0.5, 0.5])
    switch = rng.choice([0.0, LU(rng, 0.0005, 0.01)], p=[0.6, 0.4])
    slow = rng.choice(
        [0.0, U(rng, 0.005, 0.03)], p=[0.5, 0.5]
    )  # slowly wandering error (clicking, wrong foot point)
    T = w.k.max() * 0.1 if len(w.k) else 0
    N = len(truth.a)
    # heads sway as people step, more and slower where they are slow; the head is what sensors see and what is forecast
    head = w.pos.copy()
    for p in range(N):
        a, n = truth.a[p], truth.n[p]
        sl = slice(a, a + n)
        v = w.vel[sl]
        s = np.linalg.norm(v, axis=1)
        if sway and n > 1:
            sm = np.convolve(np.pad(s, 5, mode="edge"), np.ones(11) / 11, "valid")
            dm = np.stack(
                [np.convolve(np.pad(v[:, c], 7, mode="edge"), np.ones(15) / 15, "valid") for c in (0, 1)], 1
            )
            dm /= np.linalg.norm(dm, axis=1, keepdims=True) + 0.05
            amp = (
                sway
                * np.exp(rng.normal(0, 0.3))
                * (1.6 - 0.8 * np.minimum(sm, 1.5))
                * np.minimum(1, 0.3 + sm / 0.15)
            )
            ph = rng.uniform(0, 6.28) + np.cumsum(2 * np.pi * (0.35 + 0.42 * np.minimum(sm, 1.6) * swf) * 0.1)
            side = np.stack([-dm[:, 1], dm[:, 0]], 1)
            head[sl] += side * (amp * np.sin(ph))[:, None] + dm * (0.4 * amp * np.sin(2 * ph + 1))[:, None]
        if slow:
            c = rng.normal(0, 1, (n, 2))
            al = math.exp(-0.1 / 1.5)
            g = math.sqrt(1 - al * al)
            from scipy.signal import lfilter

            z = lfilter([g], [1, -al], c, axis=0, zi=(al * rng.normal(0, 1, (1, 2))))[0]
            head[sl] += slow * z
    truth.pos = head
    ts, pid, ps = [], [], []
    base = np.arange(rng.uniform(0, 1 / rate), T, 1 / rate)
    if jit:
        base = base + rng.uniform(-jit, jit, len(base))
    base = np.clip(base, 0, T)
    for p in range(N):
        a, n, t0 = truth.a[p], truth.n[p], truth.t0[p]
        b = t0 + (rng.uniform(0, late) if late else 0)
        t = base[(base >= b) & (base <= t0 + (n - 1) * 0.1)]
        if len(t) < 2:
            continue
        u = (t - t0) / 0.1
        i = np.minimum(u.astype(int), n - 2) if n > 1 else np.zeros(len(u), int)
        f = (u - i)[:, None]
        q = head[a + i] * (1 - f) + head[np.minimum(a + i + 1, len(head) - 1)] * f
        q = q + rng.normal(0, noise, q.shape)
        if quant:
            q = np.round(q / quant) * quant
        ok = ((q >= w.view[0]) & (q <= w.view[1])).all(1)
        if drop:
            ok &= rng.random(len(t)) >= drop
        ts.append(t[ok])
        pid.append(np.full(ok.sum(), p))
        ps.append(q[ok])
    if not ts:
        return None
    t, person, pos = np.concatenate(ts), np.concatenate(pid), np.concatenate(ps)
    tid = person.copy()
    if switch and len(t):
        o = np.argsort(t, kind="stable")
        called = np.arange(N)
        ti = t[o]
        b = np.flatnonzero(np.diff(ti, prepend=-1) > 1e-9)
        for x, y in zip(b, np.append(b[1:], len(o))):
            r = o[x:y]
            if len(r) > 1:
                d = np.linalg.norm(pos[r][:, None] - pos[r][None], axis=-1)
                np.fill_diagonal(d, 9)
                i, j = np.nonzero(np.triu(d < 0.8))
                for c, e in zip(i, j):
                    if rng.random() < switch:
                        g, h = person[r[c]], person[r[e]]
                        called[g], called[h] = called[h], called[g]
            tid[r] = called[person[r]]
    o = np.lexsort((t, tid))
    t, tid, pos, person = t[o], tid[o], pos[o], person[o]
    keep = np.ones(len(t), bool)
    keep[1:] = (np.diff(t) > 1e-4) | (np.diff(tid) != 0)
    q = LU(rng, 0.012, 0.4)
    r = LU(rng, 0.02, 0.15)
    if rng.random() < 0.4:
        q, r = [(0.0278, 0.0548), (0.0152, 0.0335)][rng.integers(2)]
    return Rec(w.kind, t[keep], tid[keep], pos[keep], person[keep], w.map, 1 / rate, truth), (
        q,
        r,
        U(rng, 0.9, 1.1),
    )
