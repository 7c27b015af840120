"""What processes run after `warm_up`, and the law that nothing is compiled then; they need not load torch."""

import sys

import numpy as np

import pedpred
from pedpred.command import main
from pedpred.evaluation import EvaluationSettings
from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.online.assessment import assess
from pedpred.online.replay import replay_scene
from pedpred.ros.assignment import NearestTracks
from pedpred.scenes import OccupancyMap, Scene, Trajectories, predicted_occupancy


def specialisations():
    """Which types of arguments every loop in this process is compiled for."""
    modules = [module for name, module in sys.modules.items() if name.startswith("pedpred")]
    loops = [(v.py_func.__qualname__, v) for m in modules for v in vars(m).values() if hasattr(v, "py_func")]
    return {(m.py_func.__module__, name, str(types)) for name, m in loops for types in m.signatures}


def walkers(count, frames, seed, gap_m=1.0, speed_mps=1.2):
    """People who walk towards each other, with noise. [frames, count, 2]."""
    rng = np.random.default_rng(seed)
    side = np.where(np.arange(count) % 2, 1.0, -1.0)
    start = np.stack([4.0 * side, gap_m * np.arange(count)], axis=-1)
    velocity = np.stack([-side * speed_mps, np.zeros(count)], axis=-1)
    time_s = 0.1 * np.arange(frames)[:, None, None]
    return start + time_s * velocity + rng.normal(0.0, 0.02, (frames, count, 2))


def maps():
    cells = np.zeros((60, 80), bool)
    cells[20:30] = True
    for own in (cells, cells.T, cells[::2, ::3], cells.astype(np.uint8)):
        yield OccupancyMap(own, np.array([-3.0, -4.0]), 0.1)


def stream(model, settings=None):
    """A varied stream of updates."""
    predictor, now = OnlinePredictor.load(model, settings), 0.0

    def frames(positions, ids=None, velocity=None, dt_s=0.1):
        nonlocal now
        for there in positions:
            now += dt_s
            who = np.arange(len(there)) if ids is None else ids
            predictor.update(now, who, there, velocity)

    frames(walkers(1, 45, 0))
    frames(walkers(2, 45, 1))
    frames(walkers(0, 3, 1))
    frames(walkers(6, 20, 2, gap_m=0.3))
    frames(walkers(3, 20, 3, speed_mps=0.0))
    for own in maps():
        predictor.set_map(own)
        frames(walkers(4, 4, 4))
    predictor.reset()
    frames(walkers(3, 20, 5), velocity=np.ones((3, 2)))
    now += 10.0
    frames(walkers(2, 20, 6), ids=[2**40, -7])
    frames(walkers(1, 30, 7), ids=[-7])
    frames(walkers(20, 15, 8, gap_m=0.5), dt_s=0.33)
    frames([(5.0 * k * np.ones((2, 2))).tolist() for k in range(10)], ids=[1, 2])
    frames([np.asfortranarray(there.astype(np.float32)) for there in walkers(3, 10, 9)])


def recording():
    frames, count = 60, 4
    place = walkers(count, frames, 10)
    frame, person = np.divmod(np.arange(frames * count), count)
    trajectories = Trajectories(0.1 * frame, person, place[frame, person])
    return Scene("recording", trajectories, next(maps()), 0.1)


def law(*models):
    """Run in a process of its own: the command `pedpred warm-up`, then everything."""
    main(["warm-up"])
    known = specialisations()
    once = [(module, name) for module, name, _ in known if name != "_walk"]  # constants of its calls make two
    assert len(once) == len(set(once)) > 15
    stream(None, OnlineSettings(detection_noise_m=0.05, learn_trust=True))
    for model in (None, *models):
        stream(model)
        predictor = OnlinePredictor.load(model)
        list(replay_scene(recording(), predictor))
        assess(recording(), predictor, EvaluationSettings(bootstrap=2))
    assert specialisations() == known, specialisations() - known


def law_of_updates(model):
    """Run in a process of its own: `warm_up` with a model, then what a robot does with it."""
    pedpred.warm_up(model)
    known = specialisations()
    stream(model)
    stream(model, OnlineSettings(learn_trust=True))
    tracks = NearestTracks()
    for k in range(3):
        tracks.assign(0.1 * k, np.array([[0.1 * k, 0.0], [2.0, 1.0]])[: k + 1])
    forecast = OnlinePredictor.load(model).update(0.0, [1, 2], [[0.0, 0.0], [2.0, 1.0]])
    predicted_occupancy(forecast.predictions, OccupancyMap.free_around(np.zeros((1, 2)), cell_m=0.2))
    assert specialisations() == known, specialisations() - known
