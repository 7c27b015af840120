"""Rows of recorded people: each recording is seen several times, through different sensors and trackers."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from pedpred.rows.sampling import Rows, RowSampling, draw_tracker, sample_rows
from pedpred.scenes import Scene
from pedpred.settings import In, Settings
from pedpred.simulation.sensor import SensorSettings, apply_sensor, frames_between


@dataclass(frozen=True)
class ViewingSettings(Settings):
    """How a recording is seen several times.

    Attributes:
        viewings: number of them.
        rows: largest number of rows of each.
        used_share: as in `RowSettings`.
        thinnings: where a sensor detects people in every n-th frame: factors on n, one of which is drawn.
        thinned_noise_m: standard deviations of a coordinate, one of which is drawn, in thinned recordings.
        noise_m: the same in annotated ones, whose positions are less precise.
    """

    viewings: Annotated[int, In("[1, 1000000]")]
    rows: Annotated[int, In("[1, 1000000]")]
    used_share: Annotated[float, In("[0, 1]")]
    thinnings: Annotated[tuple[float, ...], In("[0.1, 1000]")]
    thinned_noise_m: Annotated[tuple[float, ...], In("[0, 100]")]
    noise_m: Annotated[tuple[float, ...], In("[0, 100]")]


def rows_of_viewing(
    number: int, scene: Scene, rate_hz: float, settings: ViewingSettings, sampling: RowSampling
) -> Rows:
    """Sample the rows of one viewing of a recording; the same arguments give the same rows.

    Args:
        number: of the viewing.
        scene: all recorded detections, which are the truth.
        rate_hz: of the place's sensor; 0: it detects people in all frames.
        settings: how viewings vary.
        sampling: protocol, inputs and variation of the rows.
    """
    rng = np.random.default_rng([sampling.rows.seed, zlib.crc32(scene.name.encode()), number])
    frame_s = scene.detection_dt_s
    every = frames_between(rate_hz, frame_s)
    if every > 1:
        every = max(2, int(every * rng.choice(settings.thinnings)))
        noise_m = float(rng.choice(settings.thinned_noise_m))
    else:
        noise_m = float(rng.choice(settings.noise_m))
    truth = scene.trajectories
    _, instant = np.unique(truth.time_s, return_inverse=True)
    later = replace(scene, trajectories=truth.select(instant >= rng.integers(every)))
    sensor = SensorSettings(rate_hz=1.0 / (every * frame_s), position_noise_m=noise_m)
    seen = apply_sensor(later, sensor, rng)
    kalman = draw_tracker(replace(sampling.rows, used_share=settings.used_share), rng)
    return sample_rows(seen, truth, kalman, settings.rows, sampling, rng)
