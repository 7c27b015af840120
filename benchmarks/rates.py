"""Errors at any rate of the frames, as ratios in one run: `python -m benchmarks.rates`.

People walk straight at 1.3 m/s on free ground; detections have 3 cm of noise. A forecast should be about as
good at 1000 Hz, and when frames come in bursts, as at 10 Hz. Below 5 Hz there are few detections in the 2.4 s
that the network reads: "least squares" is the error of straight lines through all detections of the walk, the
best that is possible for people who never turn.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.timing import tell
from pedpred import OnlinePredictor

NOISE_M, SPEED_MPS, SECONDS, WARM_S = 0.03, 1.3, 8.0, 4.0
_AHEAD_S = 0.3 * np.arange(1, 11)
Instants = Callable[[], np.ndarray]


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


def main() -> None:
    """Measure and print."""
    measured = {name: errors_m(instants) for name, instants in STREAMS.items()}
    usual = measured["10 Hz"][0]
    rows = [
        {"frames": name, "ADE, m": own, "of that at 10 Hz": own / usual, "least squares, m": best}
        for name, (own, best) in measured.items()
    ]
    tell("forecasts of straight walkers, detections with 3 cm of noise", rows)


if __name__ == "__main__":
    main()
