"""Errors at any rate of the frames, in one run: `python -m benchmarks.rates [--recording FILE] [--write]`.

Detections have 3 cm of noise, the ground is free. The first table has rates from 0.5 to 100 Hz for people who
walk straight at 1.3 m/s, who walk on circles of 3 m, and who were recorded, in the same windows at all rates;
`--write` puts it into docs/robot.md. The second one has bursts: a forecast should be about as good then as at
10 Hz. "Least squares" is the error of straight lines through all detections of the walk, the best that is
possible for people who never turn.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.pages import check_command, fill
from benchmarks.timing import tell
from pedpred import OnlinePredictor
from pedpred.errors import user_errors
from pedpred.report.document import markdown_table
from pedpred.scenes import Trajectories
from tools.arguments import positive
from tools.places import recordings

NOISE_M, SPEED_MPS, SECONDS, WARM_S = 0.03, 1.3, 8.0, 4.0
_AHEAD_S = 0.3 * np.arange(1, 11)
Instants = Callable[[], np.ndarray]
Walk = Callable[[float], np.ndarray]
"""Where all people are at a time (s), m, NaN for those who are not there. [N, 2]."""

RATES_HZ = (0.5, 1.0, 2.5, 5.0, 10.0, 25.0, 50.0, 100.0)
_PAGE, _PEOPLE, _RADIUS_M = Path("docs/robot.md"), 30, 3.0
_LENGTH_S, _SEEN_S, _EVERY_S = 20.0, 4.0, 2.0
"""Of a walk; how long people were seen before the windows; and between windows, which all rates have."""


def regular(rate_hz: float) -> Instants:
    """Frames at a fixed rate."""
    return lambda: np.arange(0.0, SECONDS, 1.0 / rate_hz)


def bursts(rate_hz: float, gap_s: float, frames: int) -> Instants:
    """Some frames `gap_s` apart at a fixed rate: several detectors, one after the other."""
    return lambda: np.add.outer(regular(rate_hz)(), gap_s * np.arange(frames)).ravel()


def queue() -> np.ndarray:
    """The frames of each second come at its end, 1 ms apart: a queue that catches up."""
    return bursts(1.0, 1e-3, 10)() + 0.9


STREAMS: dict[str, Instants] = {f"{rate:g} Hz": regular(rate) for rate in (10, 1, 2.5, 5, 30, 100, 1000)} | {
    "10 Hz, two frames 10 ms apart": bursts(10, 1e-2, 2),
    "10 Hz, two frames 1 ms apart": bursts(10, 1e-3, 2),
    "10 Hz, three frames 2 us apart": bursts(10, 2e-6, 3),
    "ten frames 1 ms apart, every second": queue,
}


def errors_m(instants: Instants, people: int = 30) -> tuple[float, float]:
    """Mean error of the forecasts after `WARM_S`, and that of straight lines through all detections, m."""
    rng, robot, found, best = np.random.default_rng(0), OnlinePredictor.load(), [], []
    start = np.stack([np.zeros(people), 60.0 * np.arange(people)], axis=1)
    velocity, sums = np.array([SPEED_MPS, 0.0]), [np.float64(0)] * 5
    for now in np.sort(instants()):
        seen = start + now * velocity + rng.normal(0, NOISE_M, (people, 2))
        sums = [total + part for total, part in zip(sums, (1, now, now * now, seen, now * seen), strict=True)]
        forecast = robot.update(float(now), np.arange(people), seen)
        if now <= WARM_S:
            continue
        truth = start[:, None] + velocity * (now + _AHEAD_S)[:, None]
        found.append(np.linalg.norm(forecast.position - truth, axis=-1).mean())
        best.append(np.linalg.norm(_line_ahead(now, *sums) - truth, axis=-1).mean())
    return float(np.mean(found)), float(np.mean(best))


def _line_ahead(now: float, n: float, t: float, t2: float, x: np.ndarray, tx: np.ndarray) -> np.ndarray:
    """The line of least squares through n detections, `_AHEAD_S` after now, m. [people, steps, 2].

    Sums over the detections: times t, their squares t2, positions x and products tx [people, 2].
    """
    slope = (n * tx - t * x) / (n * t2 - t * t)
    return ((x - t * slope) / n)[:, None] + slope[:, None] * (now + _AHEAD_S)[:, None]


def straight(now: float) -> np.ndarray:
    """People far from each other."""
    return np.stack([np.full(_PEOPLE, SPEED_MPS * now), 60.0 * np.arange(_PEOPLE)], axis=1)


def curving(now: float) -> np.ndarray:
    """People on circles, far from each other, half of them clockwise."""
    sense = np.where(np.arange(_PEOPLE) % 2, 1.0, -1.0)
    angle = sense * SPEED_MPS / _RADIUS_M * now + np.arange(_PEOPLE)
    around = _RADIUS_M * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return around + np.array([0.0, 60.0]) * np.arange(_PEOPLE)[:, None]


def recorded(people: Trajectories) -> Walk:
    """People between their detections; the walk is the middle of the recording."""
    start_s = float(np.median(people.time_s)) - _LENGTH_S / 2
    own = [people.track_id == track for track in np.unique(people.track_id)]
    paths = [(people.time_s[rows] - start_s, people.position[rows].T) for rows in own]
    paths = [(time_s, xy) for time_s, xy in paths if time_s[-1] > 0 and time_s[0] < _LENGTH_S]

    def walk(now: float) -> np.ndarray:
        return np.array(
            [[np.interp(now, time_s, part, np.nan, np.nan) for part in xy] for time_s, xy in paths]
        )

    return walk


def rate_error_m(walk: Walk, rate_hz: float) -> tuple[float, int]:
    """Mean error of the forecasts of people seen for `_SEEN_S`, m, and the number of windows."""
    rng, robot, errors = np.random.default_rng(0), OnlinePredictor.load(), []
    for frame in range(int(_LENGTH_S * rate_hz) + 1):
        now = frame / rate_hz
        here = walk(now)
        there = np.flatnonzero(np.isfinite(here).all(axis=1))
        forecast = robot.update(now, there, here[there] + rng.normal(0, NOISE_M, (len(there), 2)))
        if now < _SEEN_S or now % _EVERY_S:
            continue
        known = np.isfinite(walk(now - _SEEN_S)[forecast.track_id]).all(axis=1)
        truth = np.stack([walk(now + ahead)[forecast.track_id] for ahead in _AHEAD_S], axis=1)
        known &= np.isfinite(truth).all(axis=(1, 2))
        errors.append(np.linalg.norm(forecast.position - truth, axis=-1).mean(axis=1)[known])
    return float(np.concatenate(errors).mean()), sum(map(len, errors))


def table_of(walks: dict[str, Walk]) -> str:
    """Errors at all rates in Markdown."""
    titles = {name: f"{name}, {rate_error_m(walk, 1.0)[1]} windows" for name, walk in walks.items()}
    rows = [
        [f"{rate:g} Hz", *(f"{rate_error_m(walk, rate)[0]:.3f}" for walk in walks.values())]
        for rate in RATES_HZ
    ]
    return markdown_table(["frames", *titles.values()], rows, texts=0)


@user_errors()
def main() -> None:
    """Measure, print, and write the first table into the page."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.rates")
    parser.add_argument("--recording", type=Path, help="of people, in any format that pedpred reads")
    parser.add_argument("--rate", type=positive, help="of its frames, Hz, where it does not say it")
    parser.add_argument("--write", action="store_true", help=f"write the table into {_PAGE}")
    given = parser.parse_args()
    if given.rate and not given.recording:
        parser.error("--rate is that of a --recording: name one")
    check_command(parser, given, "benchmarks.rates", _PAGE)
    walks: dict[str, Walk] = {"straight": straight, "curving": curving}
    if given.recording:
        (scene,) = recordings([given.recording], given.rate)
        walks[f"recorded ({given.recording.stem})"] = recorded(scene.trajectories)
    table = table_of(walks)
    print(f"\nADE over 3 s, m\n{table}")
    if given.write:
        fill(_PAGE, "rates", table)
        return
    measured = {name: errors_m(instants) for name, instants in STREAMS.items()}
    usual = measured["10 Hz"][0]
    rows = [
        {"frames": name, "ADE, m": own, "of that at 10 Hz": own / usual, "least squares, m": best}
        for name, (own, best) in measured.items()
    ]
    tell("forecasts of straight walkers, detections with 3 cm of noise", rows)


if __name__ == "__main__":
    main()
