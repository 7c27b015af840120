# ruff: noqa
"""gen.py <part> <kind> <first> <last>: rows of worlds into data/<part>/<kind>_<first>.npz"""

import sys, os, time, yaml, numpy as np, dataclasses
from worlds import *
from rows import *
import worlds

KEYS = ["hist", "hm", "nb", "nm", "last", "vel", "cov", "age", "y", "pos", "heading"]
EXTRA = ["cog"]


def pack(d, mapid, source):
    return dict(
        {k: d[k] for k in KEYS},
        map=np.full(len(d["y"]), mapid, np.int32),
        source=np.full(len(d["y"]), source, np.int8),
    )


_main = None


def main_world(name, index):
    """A room of the default set `main` or of sim_test, states each 0.1 s."""
    global _main
    from pedpred.simulation.arrangements import arrangements, parsed_layouts, simulated
    from pedpred.simulation.clutter import ClutterSettings
    from pedpred.simulation.fields import parsed
    from pedpred.simulation.settings import SimulationSettings, social_force_settings

    if _main is None or _main[0] != name:
        P_ = yaml.safe_load(open("../params.yaml"))
        st = P_["social_forces"]["helbing1995"]
        st["clock"]["record_s"] = 0.1
        st = social_force_settings(st)
        ds = SimulationSettings.parse(P_["simulations"][name])
        lay = parsed_layouts(P_["layouts"], ds.drawn, st)
        _main = (name, arrangements(ds, lay, parsed(ClutterSettings, P_["clutter"]), st), st)
    a = _main[1][index]
    sc = simulated(a, _main[2])
    tr = sc.trajectories
    o = np.lexsort((tr.time_s, tr.track_id))
    n, t = tr.track_id[o], tr.time_s[o]
    oc = sc.occupancy
    S = oc.extent_m
    return World(
        name,
        Map.of(oc.occupied, oc.origin, oc.resolution_m),
        np.round(t / 0.1).astype(int),
        n,
        tr.position[o],
        tr.velocity[o],
        (oc.origin - 1, oc.origin + S + 1),
    )


def save(path, parts, maps):
    out = {k: np.concatenate([p[k] for p in parts]) for k in parts[0]}
    flat = [np.clip((m.sdf + 1) * 40, 0, 240).astype(np.uint8) for m in maps]
    out["sdf"] = np.concatenate([f.ravel() for f in flat])
    out["shape"] = np.array([f.shape for f in flat])
    out["origin"] = np.array([m.origin for m in maps])
    out["res"] = np.array([m.res for m in maps])
    os.makedirs(os.path.dirname(path), exist_ok=True)
    np.savez(path, **out)


if __name__ == "__main__":
    part, kind, first, last = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
    most = int(sys.argv[5]) if len(sys.argv) > 5 else 600
    parts, maps = [], []
    t0 = time.time()
    rows = 0
    for s in range(first, last):
        rng = np.random.default_rng([5, worlds.hash_of(kind), s])
        try:
            w = (
                main_world(kind, s)
                if kind in ("main", "sim_test")
                else lone(s)
                if kind == "lone"
                else world(kind, s)
            )
        except Exception as e:
            print(kind, s, "failed", repr(e)[:100])
            continue
        if len(w.k) < 100:
            continue
        maps.append(w.map)
        mid = len(maps) - 1
        if kind == "sim_test":
            p = perfect(w)
            parts.append(pack(build(p, "truth", rng, 4000, 3), mid, 1))
            r = sensed(w, rng)
            parts.append(pack(build(*r, rng, 2000, 3), mid, 0))
        elif kind == "main":
            parts.append(pack(build(perfect(w), "truth", rng, 1100, 0), mid, 1))
            r = sensed(w, rng)
            if r is not None and len(r[0].t):
                parts.append(pack(build(*r, rng, 400, 0), mid, 0))
        else:
            r = sensed(w, rng)
            if r is not None and len(r[0].t) > 20:
                parts.append(pack(build(*r, rng, most, 0), mid, 0))
            if rng.random() < 0.2:
                p = perfect(w)
                if len(p.t) > 20:
                    parts.append(pack(build(p, "truth", rng, most // 2, 0), mid, 1))
        if (s - first) % 25 == 24:
            print(kind, s, "%.0fs" % (time.time() - t0), sum(len(p["y"]) for p in parts), flush=True)
    save(f"data/{part}/{kind}_{first}.npz", parts, maps)
    print(kind, "done %.0fs" % (time.time() - t0), sum(len(p["y"]) for p in parts))
