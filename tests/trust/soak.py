"""`make trust`: a robot that runs for days among people, furniture and faults of its sensors and clock.

A hall with walkers who come and go and things that are detected as people. At random: the clock is set,
nobody is there for hours, ids are used again, ids jump, frames arrive in bursts, the map is exchanged. Every
forecast must be one that a planner can use; memory and the time of an update must not grow; and the regions
of the walkers must hold as many people as they say. Prints a row for each tenth of the frames and fails where
a promise is broken.
"""

import argparse
import logging
import resource
import sys
import time
from collections import deque

import numpy as np
from tqdm import tqdm

from pedpred.metrics.calibration import REGIONS, share_inside
from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.scenes import Forecast, OccupancyMap

DT_S, NOISE_M = 0.1, 0.03
WALKERS, THINGS, HALL_M = 5, 5, 15.0
_SPEED_MPS, _TURN_RADPS, _CORRELATED_S = 1.2, 0.15, 1.5
_AHEAD = 30  # frames up to the last step of a forecast
_GROWTH_MIB, _SLOWER, _POINTS = 32, 1.5, 0.05  # what may be added from the second tenth to the last
EVENTS = {
    "clock": 2e-4,
    "hours": 1e-4,
    "jump": 2e-3,
    "placeholder": 1e-3,
    "reuse": 2e-3,
    "burst": 5e-3,
    "map": 1e-3,
}
"""Probability of each fault at a frame."""


class Hall:
    """People who walk and turn slowly, and things that stand; who leaves is replaced by somebody new."""

    def __init__(self, rng: np.random.Generator):
        self.rng, self.made = rng, WALKERS
        self.track_id = np.arange(WALKERS)
        self.position, self.heading = rng.uniform(-9, 9, (WALKERS, 2)), rng.uniform(-np.pi, np.pi, WALKERS)
        self.turning = np.zeros(WALKERS)
        self.things = rng.uniform(30, 50, (THINGS, 2))

    def step(self) -> None:
        """Let a tenth of a second pass."""
        fading = np.exp(-DT_S / _CORRELATED_S)
        drawn = self.rng.normal(0, _TURN_RADPS, WALKERS)
        self.turning = fading * self.turning + np.sqrt(1 - fading**2) * drawn
        self.heading += DT_S * self.turning
        way = np.stack([np.cos(self.heading), np.sin(self.heading)], axis=-1)
        self.position = self.position + DT_S * _SPEED_MPS * way
        for gone in np.flatnonzero(np.abs(self.position).max(axis=1) > HALL_M):
            self.enter(gone, self.made)

    def enter(self, row: int, track_id: int) -> None:
        """Replace a walker by somebody else."""
        self.made = max(self.made, track_id + 1)
        self.track_id[row] = track_id
        self.position[row], self.heading[row] = self.rng.uniform(-9, 9, 2), self.rng.uniform(-np.pi, np.pi)

    def detections(self) -> tuple[np.ndarray, np.ndarray]:
        """Ids and noisy positions of everybody and everything."""
        walkers = self.position + self.rng.normal(0, NOISE_M, self.position.shape)
        names = np.concatenate([self.track_id, -1 - np.arange(THINGS)])
        return names, np.concatenate([walkers, self.things])


class Coverage:
    """Shares of the regions that hold where the walkers are later; `past` may be cleared after a fault."""

    def __init__(self) -> None:
        self.past: deque[tuple[np.ndarray, np.ndarray, Forecast]] = deque(maxlen=_AHEAD + 1)
        self.held, self.count = np.zeros(len(REGIONS)), 0

    def see(self, hall: Hall, forecast: Forecast) -> None:
        """Take a frame: the forecasts of 3 s ago are compared with it and those in between."""
        self.past.append((hall.track_id.copy(), hall.position.copy(), forecast))
        if len(self.past) <= _AHEAD:
            return
        names, _, before = self.past[0]
        everywhere = np.array([own for own, _, _ in self.past])
        stays = np.flatnonzero((everywhere == names).all(axis=0) & np.isin(names, before.track_id))
        if len(stays):
            truth = np.stack([position[stays] for _, position, _ in list(self.past)[3::3]], axis=1)
            rows = np.searchsorted(before.track_id, names[stays])
            inside = share_inside(before.predictions.select(rows), truth)
            self.held += [(inside <= share).sum() for share in REGIONS]
            self.count += inside.size

    def shares(self) -> np.ndarray:
        """Shares so far; the sums start again."""
        found = self.held / max(self.count, 1)
        self.held, self.count = np.zeros(len(REGIONS)), 0
        return found


def check(forecast: Forecast) -> None:
    """Raise AssertionError unless a planner can use a forecast."""
    predictions = forecast.predictions
    assert np.isfinite(predictions.path).all()
    np.testing.assert_allclose(predictions.weight.sum(axis=1), 1.0, atol=1e-9)
    (xx, xy), (_, yy) = np.moveaxis(predictions.covariance, (-2, -1), (0, 1))
    assert ((xx > 0) & (xx * yy > xy * xy)).all()


def memory_mib() -> float:
    """Memory of this process that is in use."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize() / 2**20


def columns(rng: np.random.Generator) -> OccupancyMap:
    """Some columns in an else free hall, away from its middle."""
    cells = np.zeros((400, 400), bool)
    for i, j in rng.integers(0, 396, (6, 2)):
        cells[i : i + 4, j : j + 4] = True
    return OccupancyMap(cells, np.full(2, -60.0), 0.1)


def soak(frames: int, seed: int) -> list[tuple[float, float, float, np.ndarray]]:
    """Run the stream: median and 99th percentile of an update, ms, memory, MiB, and shares of each tenth."""
    rng = np.random.default_rng(seed)
    hall, coverage = Hall(rng), Coverage()
    robot = OnlinePredictor.load(settings=OnlineSettings(detection_noise_m=NOISE_M))
    now, rows, took, calm = 0.0, [], [], 0
    for k in tqdm(range(frames), desc="soak", unit="frame", miniters=1000, mininterval=5.0):
        hall.step()
        now += DT_S
        calm += 1
        fault = next((name for name, chance in EVENTS.items() if rng.random() < chance), None)
        if fault == "reuse":
            row = int(rng.integers(WALKERS))
            hall.enter(row, int(hall.track_id[row]))
        names, position = hall.detections()
        if fault == "clock":
            now = float(rng.choice([0.0, now - 5.0, now + 5.0, 1.7e9 * rng.random(), -1e6]))
        elif fault == "hours":
            for _ in range(20):
                now += 180.0
                check(robot.update(now, [], []))
        elif fault == "jump":  # from now on somebody else has this id, far away, once
            position[rng.integers(WALKERS)] += 10.0 ** rng.uniform(0.5, 7)
        elif fault == "placeholder":
            position[rng.integers(WALKERS)] = 4e5
        elif fault == "map":
            robot.set_map(columns(rng))
        if fault in ("clock", "hours", "jump", "placeholder", "reuse"):
            coverage.past.clear()
            calm = 0
        instants = now - (1e-4 * np.arange(10)[::-1] if fault == "burst" else np.zeros(1))
        for instant in instants:
            since = time.process_time()
            forecast = robot.update(float(instant), names, position)
            took.append(1e3 * (time.process_time() - since))
        check(forecast)
        if calm > 10:  # who has just jumped is forecast to stand at first
            coverage.see(hall, forecast)
        if (k + 1) % max(frames // 10, 1) == 0:
            rows.append((np.median(took), np.quantile(took, 0.99), memory_mib(), coverage.shares()))
            took.clear()
    return rows


def main() -> int:
    """Run it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    logging.disable(logging.WARNING)
    rows = soak(options.frames, options.seed)
    print("update ms, 99 %    memory MiB   50/90/95 % regions hold")
    for median, late, mib, shares in rows:
        held = " / ".join(f"{100 * share:.1f}" for share in shares)
        print(f"{median:8.2f} {late:7.2f} {mib:12.0f}   {held} %")
    (first, _, small, _), (last, _, large, _) = rows[1], rows[-1]
    held = np.mean([row[-1] for row in rows[1:]], axis=0)
    broken = large - small > _GROWTH_MIB or last > _SLOWER * first or (np.abs(held - REGIONS) > _POINTS).any()
    print("broken: memory, time or regions" if broken else "kept")
    return int(broken)


if __name__ == "__main__":
    sys.exit(main())
