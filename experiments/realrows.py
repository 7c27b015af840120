# ruff: noqa
"""Rows of the six places for fine-tuning: several thinnings, phases and trackers of each. data/real/<place>_0.npz"""

import numpy as np
from places import *
from rows import *
from gen import pack, save

for name in NAMES:
    rng = np.random.default_rng([9, NAMES.index(name)])
    base = place(name)
    parts = []
    if name in STRIDE:
        a = np.loadtxt(JU / f"{name}.txt", comments="#", usecols=(0, 1, 2, 3))
        o = np.lexsort((a[:, 1], a[:, 0]))
        a = a[o]
        tid, fr, pos = a[:, 0].astype(int), a[:, 1].astype(int), a[:, 2:4]
        rate = RATE[name]
    for v in range(10):
        q, r = [
            TUNED["eth"][:2],
            TUNED["hotel"][:2],
            (
                np.exp(rng.uniform(np.log(0.012), np.log(0.4))),
                np.exp(rng.uniform(np.log(0.02), np.log(0.15))),
            ),
        ][v % 3]
        if name in STRIDE:
            st = int(
                rng.choice([STRIDE[name], STRIDE[name], max(2, STRIDE[name] // 2), int(STRIDE[name] * 1.3)])
            )
            ph = rng.integers(st)
            m = fr % st == ph
            t, k, p = fr[m] / rate, tid[m], pos[m]
            noise = rng.choice([0, 0.02, 0.05])
            iv = st / rate
            truth = SplineTruth(t, k, p)
            p = p + rng.normal(0, noise, p.shape)
            rec = Rec(name, t, k, p, k, base.map, iv, truth)
        else:
            t, k, p = base.t, base.tid, base.pos
            noise = 0 if v < 3 else rng.choice([0, 0.02])
            truth = base.truth
            p = p + rng.normal(0, noise, p.shape)
            rec = Rec(name, t, k, p, k, base.map, 0.4, truth)
        parts.append(pack(build(rec, (q, r, 1.0), rng, 4000, 1 if v % 2 else 3), 0, 0))
    save(f"data/real/r{name}_0.npz", parts, [base.map])
    print(name, sum(len(q["y"]) for q in parts), flush=True)
