# ruff: noqa
"""The six real places as Rec."""

import sys, numpy as np, xml.etree.ElementTree as ET, functools
from pathlib import Path
from matplotlib.path import Path as MPath
from rows import Rec, Map, SplineTruth

JU = Path("../data/raw/juelich")
OPEN = dict(
    corner=[((-3, 5), (0, 5)), ((5, 0), (5, -3))],
    t_junction=[((-5, -2.4), (-5, 0)), ((-2.4, 4.5), (0, 4.5)), ((4, 0), (4, -2.4))],
    bottleneck=[((-2.25, -8), (4, -8)), ((-2.25, 6.25), (4, 6.25))],
    crossing=[((0, -1), (4, -1)), ((6.5, 0), (6.5, 4)), ((0, 5), (4, 5)), ((-4, 0), (-4, 4))],
)
STRIDE = dict(corner=6, t_junction=6, bottleneck=6, crossing=10)
RATE = dict(corner=16.0, t_junction=16.0, bottleneck=16.0, crossing=25.0)
TUNED = dict(eth=(0.0278, 0.0548, 1.052), hotel=(0.0152, 0.0335, 0.9324))


def tracker_of(place):
    return TUNED["hotel"] if place == "eth" else TUNED["eth"]


NAMES = ["eth", "hotel", "corner", "t_junction", "bottleneck", "crossing"]


def lab_map(name, ext=6.0, res=0.1):
    root = ET.parse(JU / f"{name}.xml").getroot()
    sub = root.find(".//subroom")
    poly = lambda e: np.array([[float(v.get("px")), float(v.get("py"))] for v in e.findall("vertex")])
    wall = poly(sub.find("polygon"))
    obst = [poly(p) for p in sub.findall(".//obstacle/polygon")]
    quads = []
    W = MPath(wall)
    for a, b in OPEN[name]:
        a, b = np.array(a, float), np.array(b, float)
        d = (b - a) / np.linalg.norm(b - a)
        n = np.array([d[1], -d[0]])
        if W.contains_point((a + b) / 2 + 0.05 * n):
            n = -n
        quads.append(np.array([a - 0.01 * n, b - 0.01 * n, b + ext * n, a + ext * n, a - 0.01 * n]))
    al = np.concatenate([wall] + quads)
    lo, hi = al.min(0) - 0.5, al.max(0) + 0.5
    shape = np.ceil((hi - lo) / res).astype(int)
    c = lo + (np.moveaxis(np.indices(shape), 0, -1) + 0.5) * res
    f = c.reshape(-1, 2)
    free = W.contains_points(f)
    for q in quads:
        free |= MPath(q).contains_points(f)
    for o in obst:
        free &= ~MPath(o).contains_points(f)
    occ = ~free.reshape(shape)
    # beyond the ends of the extensions the ground is free: clear the margin there
    for a, b in OPEN[name]:
        a, b = np.array(a, float), np.array(b, float)
        d = (b - a) / np.linalg.norm(b - a)
        n = np.array([d[1], -d[0]])
        if W.contains_point((a + b) / 2 + 0.05 * n):
            n = -n
        q = np.array(
            [
                a + (ext - 0.2) * n,
                b + (ext - 0.2) * n,
                b + (ext + 2) * n,
                a + (ext + 2) * n,
                a + (ext - 0.2) * n,
            ]
        )
        occ &= ~MPath(q).contains_points(f).reshape(shape)
    return Map.of(occ, lo, res)


@functools.lru_cache(None)
def place(name):
    if name in ("eth", "hotel"):
        from pedpred.sources.ewap import read_sequence

        s = dict(
            frame_rate_hz=15.0 if name == "eth" else 25.0,
            annotation_frames=6 if name == "eth" else 10,
            resolution_m=0.1,
            margin_m=1.0,
        )
        sc = read_sequence(Path(f"../data/raw/ewap/seq_{name}"), name, s)
        tr = sc.trajectories
        t, tid, pos = tr.time_s, tr.track_id, tr.position
        mp = Map.of(sc.occupancy.occupied, sc.occupancy.origin, sc.occupancy.resolution_m)
        interval = 0.4
    else:
        a = np.loadtxt(JU / f"{name}.txt", comments="#", usecols=(0, 1, 2, 3))
        keep = a[:, 1].astype(int) % STRIDE[name] == 0
        full = a
        a = a[keep]
        t, tid, pos = a[:, 1] / RATE[name], a[:, 0].astype(int), a[:, 2:4]
        mp = lab_map(name)
        interval = STRIDE[name] / RATE[name]
    o = np.lexsort((t, tid))
    t, tid, pos = t[o], tid[o], pos[o]
    return Rec(name, t, tid, pos, tid, mp, interval, SplineTruth(t, tid, pos))
