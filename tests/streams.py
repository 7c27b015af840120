"""Streams of frames at fixed rates and in bursts, and the errors of forecasts of people who walk straight."""

from collections.abc import Callable

import numpy as np

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


def mean_error_m(instants: Instants, people: int = 30) -> float:
    """Mean error of the forecasts after `WARM_S`, m."""
    rng, robot, errors = np.random.default_rng(0), OnlinePredictor.load(), []
    start = np.stack([np.zeros(people), 60.0 * np.arange(people)], axis=1)
    velocity = np.array([SPEED_MPS, 0.0])
    for now in np.sort(instants()):
        seen = start + now * velocity + rng.normal(0, NOISE_M, (people, 2))
        forecast = robot.update(float(now), np.arange(people), seen)
        if now > WARM_S:
            truth = start[:, None] + velocity * (now + _AHEAD_S)[:, None]
            errors.append(np.linalg.norm(forecast.position - truth, axis=-1).mean())
    return float(np.mean(errors))
