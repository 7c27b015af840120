"""Long recordings are measured block by block: the same figures, and little memory for each detection."""

import gc
import sys
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from pedpred.command.prediction import predictor_for
from pedpred.evaluation import EvaluationSettings
from pedpred.online.assessment import assess
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from tests.worlds import walled_scene

SETTINGS = EvaluationSettings(bootstrap=10)
AT_ONCE, LIFE, HALL_M = 20, 200, 30.0
"""People at a time in `hall`, detections of each, and its size."""
EXTRACT = sys.modules["pedpred.features.extract"]
"""The module; the package has a function of this name."""


def hall(rows: int, seed: int = 0) -> Scene:
    """People at 10 Hz, 20 at a time, each on an arc in a hall with a wall."""
    rng = np.random.default_rng(seed)
    row = np.arange(rows)
    instant, place = row // AT_ONCE, row % AT_ONCE
    born = (instant + place * (LIFE // AT_ONCE)) // LIFE  # one after the other at each of 20 places
    walker = born * AT_ONCE + place
    many = int(walker.max(initial=0)) + 1
    centre, radius_m = rng.uniform(-HALL_M / 3, HALL_M / 3, (many, 2)), rng.uniform(2.0, 6.0, many)
    speed_mps, phase = rng.uniform(0.0, 1.6, many), rng.uniform(0.0, 2 * np.pi, many)
    angle = phase[walker] + speed_mps[walker] / radius_m[walker] * instant * 0.1
    on_circle = radius_m[walker, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    position = centre[walker] + on_circle + rng.normal(0.0, 0.03, (rows, 2))
    ground = OccupancyMap(np.zeros((300, 300), bool), np.full(2, -HALL_M / 2), HALL_M / 300)
    walls = ground.occupied.copy()
    walls[:2] = walls[-2:] = walls[:, :2] = walls[:, -2:] = True
    people = Trajectories(instant * 0.1, walker, position)
    return Scene("hall", people, replace(ground, occupied=walls), 0.1)


@pytest.fixture(scope="module")
def crowd():
    """Several people at a time, with gaps, walls and people who stand."""
    scene = walled_scene(np.random.default_rng(5), 0.1, detections=60, tracks=6)
    seen = np.random.default_rng(6).random(len(scene.trajectories)) < 0.9
    return replace(scene, trajectories=scene.trajectories.select(seen))


@pytest.mark.parametrize("kind", ["model", "mixture"])
def test_figures_do_not_depend_on_the_size_of_the_blocks(kind, crowd, request, monkeypatch):
    folder = request.getfixturevalue(kind)[0]
    whole = assess(crowd, predictor_for(crowd, folder), SETTINGS)
    for rows in (1, 40):
        same_in_blocks(rows, whole, crowd, folder, monkeypatch)


def same_in_blocks(rows, whole, crowd, folder, monkeypatch):
    monkeypatch.setattr("pedpred.forecasting.blocks._ROWS_AT_ONCE", rows)
    monkeypatch.setattr(EXTRACT, "_ROWS_AT_ONCE", rows)
    blocks = assess(crowd, predictor_for(crowd, folder), SETTINGS)
    assert list(blocks) == list(whole)
    for name, own in whole.items():
        for field in ("track", "error_m", "inside", "nll"):
            np.testing.assert_allclose(getattr(blocks[name], field), getattr(own, field), atol=1e-4)
        for key, values in own.values.items():
            np.testing.assert_allclose(blocks[name].values[key], values, atol=1e-3, err_msg=key)
        assert blocks[name].without_truth == own.without_truth


def test_each_detection_takes_little_memory(mixture):
    """Measured with twice as many; forecasts of all windows at once would take 12 KiB for each."""
    peaks = {}
    for rows in (1_000, 4_000, 8_000):
        scene = hall(rows)
        robot = predictor_for(scene, mixture[0])
        gc.collect()
        tracemalloc.start()
        assess(scene, robot, SETTINGS, metrics={})
        peaks[rows] = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert (peaks[8_000] - peaks[4_000]) / 4_000 < 2_000
