# ruff: noqa
"""Laws of Show 3 on a network: straight walkers, standing people, rotation, mirror, far people. laws.py <net>"""

import sys, numpy as np, torch
from net import *
from rows import *
from evaluate import predict

torch.set_num_threads(1)


def person_rec(paths, interval, noise=0.0, mp=FREE, seed=0):
    """paths: list of (t, pos)"""
    rng = np.random.default_rng(seed)
    t, k, p = [], [], []
    for i, (tt, pp) in enumerate(paths):
        t.append(tt)
        k.append(np.full(len(tt), i))
        p.append(pp + rng.normal(0, noise, pp.shape) if noise else pp)
    t, k, p = np.concatenate(t), np.concatenate(k), np.concatenate(p)
    return Rec(
        "law", t, k, p, k, mp, interval, lambda person, tt: (np.zeros((*tt.shape, 2)), np.ones(len(tt), bool))
    )


def laws(net, cfg, sym=False, trackers=((0.0278, 0.0548, 1.052), (0.0152, 0.0335, 0.9324))):
    rng = np.random.default_rng(0)
    res = {}
    lo, hi, worst = [], [], []
    stand, stand_new = [], []
    for tr in trackers:
        for rate in (2.0, 2.5, 5.0, 10.0):
            for noise in (0.0, 0.02):
                paths = []
                for i in range(16):
                    v = rng.uniform(0.3, 2.5)
                    a = rng.uniform(0, 6.28)
                    tt = np.arange(0, 60 if rate < 6 else 20, 1 / rate)
                    paths.append(
                        (tt, np.array([i * 100.0, 0]) + tt[:, None] * v * np.array([np.cos(a), np.sin(a)]))
                    )
                r = person_rec(paths, 1 / rate, noise)
                d = build(r, tr, min_age=3)
                D = Data.of_place(r, d)
                o = predict(net, D, cfg, sym=sym)
                v = np.array([np.linalg.norm(q[1] - q[0]) * rate for _, q in paths])[d["tid"]]
                along = o["point"][:, -1].numpy()
                true = v * 3
                # displacement from the tracked position along the true direction, against the truth
                dirs = np.array([(q[1] - q[0]) / np.linalg.norm(q[1] - q[0]) for _, q in paths])[d["tid"]]
                c, s = np.cos(d["heading"]), np.sin(d["heading"])
                w = np.stack([c * along[:, 0] - s * along[:, 1], s * along[:, 0] + c * along[:, 1]], 1)
                share = (w * dirs).sum(1) / true
                kal = 0
                if noise == 0:
                    lo.append(np.quantile(share, [0, 0.05]))
                    hi.append(np.quantile(share, [0.95, 1]))
                else:
                    worst.append(np.quantile(share, [0.05, 0.5, 0.95]))
                paths = [
                    (np.arange(0, 20, 1 / rate), np.tile([i * 100.0, 0], (int(np.ceil(20 * rate - 1e-9)), 1)))
                    for i in range(8)
                ]
                r = person_rec(paths, 1 / rate, noise, seed=3)
                d = build(r, tr, min_age=0)
                o = predict(net, Data.of_place(r, d), cfg, sym=sym)
                e = o["point"][:, -1].norm(dim=-1).numpy()
                stand.append((noise, e[d["age"] >= 3].max()))
                stand_new.append((noise, e[d["age"] < 3].max()))
    lo, hi = np.array(lo), np.array(hi)
    res["straight min/5%/95%/max"] = [lo[:, 0].min(), lo[:, 1].min(), hi[:, 0].max(), hi[:, 1].max()]
    res["straight 2cm noise 5/50/95"] = np.array(worst).mean(0)
    res["standing no noise, noise"] = [max(e for n, e in stand if n == 0), max(e for n, e in stand if n > 0)]
    res["newborn no noise, noise"] = [
        max(e for n, e in stand_new if n == 0),
        max(e for n, e in stand_new if n > 0),
    ]
    return {k: np.round(np.asarray(v, float), 3).tolist() for k, v in res.items()}


def mirror_gap(net, D, cfg, n=2000):
    idx = np.random.default_rng(1).choice(len(D), min(n, len(D)), replace=False)
    with torch.no_grad():
        b = batch(D, idx, cfg)
        o = forward(net, b, cfg.get("sym"))
        q = forward(net, mirrored(b), cfg.get("sym"))
    e = (o["point"] - q["point"] * torch.tensor([1.0, -1.0])).norm(dim=-1).amax(1).numpy()
    return np.quantile(e, [0.5, 0.9, 0.99, 1]).round(3).tolist()


if __name__ == "__main__":
    import glob

    for name in sys.argv[1:]:
        z = torch.load(f"nets/{name}.pt")
        net = Mixture(z["cfg"])
        net.load_state_dict(z["state"])
        net.eval()
        print(name, laws(net, z["cfg"]))
        T = Data(sorted(glob.glob("data/test/*.npz")))
        print("mirror gap sim", mirror_gap(net, T, z["cfg"]))
