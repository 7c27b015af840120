# ruff: noqa
"""train.py <name> key=value ...  Trains in `minutes` and writes nets/<name>.pt; prints figures of validation."""

import sys, time, glob, json, ast, os
import numpy as np, torch

torch.set_num_threads(1)
from net import *
from evaluate import *

cfg = dict(
    rays=96,
    crop=None,
    width=256,
    modes=6,
    lr=2e-3,
    bs=512,
    minutes=4.0,
    steps=None,
    nll=0.1,
    joint=0.1,
    best=0.0,
    bf16=True,
    map_drop=0.03,
    mix=dict(main=0.3, corridor=0.25, bottleneck=0.12, room=0.13, open=0.16, lone=0.04),
    data="train",
    seed=0,
    real=[],
    real_share=0.3,
    real_eval=["hotel", "corner", "crossing"],
    init=None,
    only=None,
    most=4000,
    sym=False,
    balance=0.3,
)
name = sys.argv[1]
for a in sys.argv[2:]:
    k, v = a.split("=", 1)
    try:
        v = ast.literal_eval(v)
    except Exception:
        pass
    cfg[k] = v
torch.manual_seed(cfg["seed"])
rng = np.random.default_rng(cfg["seed"])


def found():
    return [f for p in cfg["data"].split("+") for f in sorted(glob.glob(f"data/{p}/*.npz"))]


files = found()
files += [f"data/real/r{p}_0.npz" for p in cfg["real"]]
shares = {
    "r" + p: cfg["real_share"] / len(cfg["real"]) * sum(cfg["mix"].values()) / (1 - cfg["real_share"])
    for p in cfg["real"]
}
cfg["mix"] = cfg["mix"] | shares


def load(files):
    D = Data(files)
    pools = {k: np.flatnonzero(D.kind == k) for k in cfg["mix"]}
    pools = {k: v for k, v in pools.items() if len(v)}
    if cfg["only"] is not None:
        pools = {k: w for k, v in pools.items() if len(w := v[D.source[v] == cfg["only"]])}
    mixp = np.array([cfg["mix"][k] for k in pools])
    return D, pools, mixp / mixp.sum()


D, pools, mixp = load(files)
print(name, {k: len(v) for k, v in pools.items()}, flush=True)
net = Mixture(cfg)
if cfg["init"]:
    net.load_state_dict(torch.load(cfg["init"])["state"])
params = sum(p.numel() for p in net.parameters())
print("params", params)
opt = torch.optim.AdamW(net.parameters(), lr=cfg["lr"], weight_decay=1e-4, betas=(0.9, 0.98))
t0 = time.time()
c0 = time.process_time()
step = 0
sums = np.zeros(4)
ema = None
names = list(pools)


def progress():
    return step / cfg["steps"] if cfg["steps"] else (time.time() - t0) / 60 / cfg["minutes"]


log = []
while True:
    f = progress()
    if f >= 1:
        break
    lr = cfg["lr"] * min(1, step / 100) * (0.5 * (1 + math.cos(math.pi * min(f, 1))) * 0.98 + 0.02)
    for gq in opt.param_groups:
        gq["lr"] = lr
    if step and step % 1000 == 0 and cfg["data"] != "train" and not cfg["real"] and found() != files:
        files = found()
        D, pools, mixp = load(files)
        names = list(pools)
        print("reloaded", {k: len(v) for k, v in pools.items()}, flush=True)
    n = rng.multinomial(cfg["bs"], mixp)
    idx = np.concatenate([pools[k][rng.integers(len(pools[k]), size=c)] for k, c in zip(names, n)])
    b = batch(D, idx, cfg, rng)
    with torch.autocast("cpu", torch.bfloat16, enabled=cfg["bf16"]):
        o = forward(net, b, cfg["sym"])
    ade, joint, marg, best = losses(o, b["y"], cfg)
    k = torch.arange(1, P + 1) * DT
    scale = 1.0
    if cfg["balance"]:  # people who are hard to forecast count less, those nearly standing more
        with torch.no_grad():
            kal = (b["vel"][:, None] * k[:, None] - b["y"]).norm(dim=-1).mean(1)
            scale = 1 / (cfg["balance"] + kal)
            scale = scale / scale.mean()
    loss = (
        (ade * scale).mean()
        + cfg["nll"] * marg.clamp(max=20).mean()
        + cfg["joint"] * joint.clamp(max=20).mean()
        + cfg["best"] * (best * scale).mean()
    )
    opt.zero_grad()
    loss.backward()
    nn.utils.clip_grad_norm_(net.parameters(), 1.0)
    opt.step()
    sums += [float(q.detach().mean()) for q in (ade, joint, marg, best)]
    step += 1
    if step % 250 == 0:
        print(
            "%5d %.1f min lr %.4f ade %.4f joint %.3f marg %.3f best %.3f"
            % (step, (time.time() - t0) / 60, lr, *(sums / 250)),
            flush=True,
        )
        sums[:] = 0
    with torch.no_grad():
        if ema is None:
            ema = {q: v.clone() for q, v in net.state_dict().items()}
        elif step % 5:
            pass
        elif step > 200:
            for q, v in net.state_dict().items():
                ema[q].lerp_(v, 0.02)
        else:
            ema = {q: v.clone() for q, v in net.state_dict().items()}
net.load_state_dict(ema)
os.makedirs("nets", exist_ok=True)
torch.save(dict(state=net.state_dict(), cfg=cfg, steps=step), f"nets/{name}.pt")
print("steps", step, "bs", cfg["bs"], "cpu min %.1f" % ((time.process_time() - c0) / 60))
net.eval()
out = {}
V = Data(sorted(glob.glob("data/val/*.npz")))
for kd in np.unique(V.kind):
    out[kd] = figures(net, V, cfg, cfg["most"], sel=V.kind == kd)
    print(show(kd, out[kd]))
T = Data(sorted(glob.glob("data/test/*.npz")))
out["sim_true"] = figures(net, T, cfg, cfg["most"], sel=T.source == 1)
print(show("sim_true", out["sim_true"]))
out["sim_sens"] = figures(net, T, cfg, cfg["most"], sel=T.source == 0)
print(show("sim_sens", out["sim_sens"]))
for r in cfg["real_eval"]:
    out[r] = figures(net, real(r), cfg, cfg["most"], cover=True)
    print(show(r, out[r]), flush=True)
json.dump(dict(cfg=cfg, figures=out, steps=step), open(f"nets/{name}.json", "w"))
