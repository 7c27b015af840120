# ruff: noqa
"""Collisions and points in obstacles of whole instants in the simulated test rooms (true states). scenes_eval.py <net>"""

import sys, os, pickle, numpy as np, torch

torch.set_num_threads(1)
from net import *
from rows import *
from evaluate import predict


def instants(per=25):
    f = "data/instants.pkl"
    if os.path.exists(f):
        return pickle.load(open(f, "rb"))
    from gen import main_world
    from worlds import perfect

    out = []
    for s in range(10):
        w = main_world("sim_test", s)
        r = perfect(w)
        tt = np.unique(r.t)
        rng = np.random.default_rng(s)
        pick = rng.choice(tt[10:-11], per, replace=False)
        rows = np.flatnonzero(np.isin(r.t, pick))
        out.append((r.map, build(r, "truth", which=rows)))
    pickle.dump(out, open(f, "wb"))
    return out


def world_paths(d, p):
    c, s = np.cos(d["heading"]), np.sin(d["heading"])
    sh = (slice(None),) + (None,) * (p.ndim - 2)
    x = c[sh] * p[..., 0] - s[sh] * p[..., 1] + d["pos"][:, 0][sh]
    y = s[sh] * p[..., 0] + c[sh] * p[..., 1] + d["pos"][:, 1][sh]
    return np.stack([x, y], -1)


def collide(t, path, near=0.2):
    hit = np.zeros(len(t), bool)
    for u in np.unique(t):
        m = np.flatnonzero(t == u)
        q = path[m]
        d = np.linalg.norm(q[:, None] - q[None], axis=-1).min(-1)
        np.fill_diagonal(d, 9)
        hit[m] = (d < near).any(1)
    return hit


def chosen(t, o, path, near=0.35, weight=2.0, rounds=4):
    """One mode per person: log weight minus a penalty for coming close to the others' chosen modes."""
    lw = o["logw"].numpy()
    B, M = lw.shape
    k = lw.argmax(1)
    for u in np.unique(t):
        m = np.flatnonzero(t == u)
        q = path[m]  # n M P 2
        if len(m) < 2:
            continue
        d = np.linalg.norm(q[:, :, None, None] - q[None, None], axis=-1).min(-1)  # n M n M
        pen = weight * np.clip((near - d) / near, 0, 1) * 4
        for _ in range(rounds):
            moved = False
            for a in np.argsort(-lw[m].max(1)):
                sc = lw[m[a]] - sum(pen[a][:, b, k[m[b]]] for b in range(len(m)) if b != a)
                z = int(sc.argmax())
                if z != k[m[a]]:
                    k[m[a]] = z
                    moved = True
            if not moved:
                break
    return k


if __name__ == "__main__":
    I = instants()
    for name in sys.argv[1:]:
        z = torch.load(f"nets/{name}.pt")
        net = Mixture(z["cfg"])
        net.load_state_dict(z["state"])
        net.eval()
        tot = {}
        for mp, d in I:
            D = Data.of_place(Rec("x", d["t"], d["tid"], d["det"], d["tid"], mp, 0.3, None), d)
            o = predict(net, D, z["cfg"])
            y = D.y
            k = np.arange(1, P + 1) * DT
            W = lambda p: world_paths(d, p)
            modes = W(o["mu"].numpy())
            lw = o["logw"].numpy().argmax(1)
            ix = np.arange(len(y))
            sel = chosen(d["t"], o, modes)
            for nm, p in dict(
                truth=W(y),
                cv=W(D.vel[:, None] * k[:, None]),
                point=W(o["point"].numpy()),
                likely=modes[ix, lw],
                selected=modes[ix, sel],
            ).items():
                e = tot.setdefault(nm, [[], [], []])
                e[0].append(collide(d["t"], p))
                e[1].append((mp.dist(p) < 0).mean(1))
                e[2].append(np.linalg.norm(p - W(y), axis=-1).mean(1))
        print(
            name,
            {
                nm: "collide %.1f%% wall %.2f%% ade %.3f"
                % (
                    100 * np.concatenate(e[0]).mean(),
                    100 * np.concatenate(e[1]).mean(),
                    np.concatenate(e[2]).mean(),
                )
                for nm, e in tot.items()
            },
        )
