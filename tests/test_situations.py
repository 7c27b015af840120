"""Training rows: what a network would see of tracked people, and where they truly went."""

from dataclasses import replace

import numpy as np
import pytest

from pedpred.rows.recorded import ViewingSettings, rows_of_viewing
from pedpred.rows.sampling import RowSampling, RowSettings
from pedpred.rows.simulated import (
    SimulatedSet,
    rows_of_scene,
    rows_of_world,
    select_true_states,
    steps_of_world,
)
from pedpred.settings import load
from pedpred.simulation.worlds import simulate_world
from pedpred.simulation.worlds.views import Area
from tests.exported import LSTM_ROWS, MIXTURE_ROWS, widths_of
from tests.simulated import SENSING, read, short_worlds
from tests.worlds import walled_scene

CONF = read("situations/varied")
ROWS = load(RowSettings, CONF["rows"])
WORLDS = short_worlds(12.0, warm_up_s=5.0)
PROTOCOL = MIXTURE_ROWS.protocol
SAMPLING = RowSampling(ROWS, MIXTURE_ROWS, 0.2)
CORRIDOR = SimulatedSet("corridor", "", 2, 60, 30, 1.0)
VIEWINGS = ViewingSettings(3, 50, 0.5, (1.0, 0.5), (0.0, 0.02), (0.0,))


def assert_equal(rows, others):
    assert list(rows) == list(others)
    for name, values in rows.items():
        np.testing.assert_array_equal(values, others[name])


@pytest.mark.parametrize("kind", ["corridor", "bottleneck", "room", "square", "lone"])
def test_a_world_gives_the_rows_that_are_asked_for(kind):
    chosen = replace(CORRIDOR, kind=kind)
    rows = rows_of_world(1, chosen, WORLDS, SENSING, SAMPLING)
    widths = {name: values.shape[1] for name, values in rows.items() if name != "future"}
    assert widths == widths_of(MIXTURE_ROWS.features)
    assert rows["future"].shape[1:] == (PROTOCOL.horizon_steps, 2)
    assert 30 < len(rows["future"]) <= 90
    assert len({len(values) for values in rows.values()}) == 1
    assert all(np.isfinite(values).all() for values in rows.values())
    assert_equal(rows, rows_of_world(1, chosen, WORLDS, SENSING, SAMPLING))


def test_a_set_may_have_true_states_only():
    rows = rows_of_world(0, replace(CORRIDOR, rows=0), WORLDS, SENSING, SAMPLING)
    assert 0 < len(rows["future"]) <= 30
    np.testing.assert_array_equal(rows["track"][:, 2:5], 0.0)  # no covariance
    neither = rows_of_world(0, replace(CORRIDOR, rows=0, true_share=0.0), WORLDS, SENSING, SAMPLING)
    assert neither["future"].shape == (0, PROTOCOL.horizon_steps, 2)


def test_scenes_on_disk_give_rows_as_worlds_do():
    coarse = select_true_states(
        simulate_world("room", 1, WORLDS), Area(np.full(2, -1e6), np.full(2, 1e6)), 0.3
    )
    rows = rows_of_scene(coarse, replace(CORRIDOR, kind="arrangement"), SENSING, SAMPLING)
    assert len(rows["future"]) == 90


@pytest.mark.parametrize("rate_hz", [0.0, 2.5])
def test_viewings_differ_and_repeat(rate_hz):
    scene = walled_scene(np.random.default_rng(0), dt_s=0.1, detections=120)
    views = [rows_of_viewing(n, scene, rate_hz, VIEWINGS, SAMPLING) for n in range(3)]
    assert all(0 < len(rows["future"]) <= 50 for rows in views)
    assert not np.array_equal(views[0]["history"], views[1]["history"])
    assert_equal(views[2], rows_of_viewing(2, scene, rate_hz, VIEWINGS, SAMPLING))


# Step sequences of recurrent networks


@pytest.mark.parametrize("kind", ["corridor", "lone"])
def test_the_same_world_gives_the_same_steps_on_the_clock(kind):
    sampling = RowSampling(ROWS, LSTM_ROWS, 0.2)
    first, second = (list(steps_of_world(kind, 0, WORLDS, SENSING, sampling)) for _ in range(2))
    found = {}
    for name in ("track_id", "time_s", "position", "velocity", "future"):
        found[name], again = (np.concatenate([getattr(b, name) for b in own]) for own in (first, second))
        assert found[name].tobytes() == again.tobytes()
    passed = np.diff(found["time_s"])[np.diff(found["track_id"]) == 0] / LSTM_ROWS.protocol.dt_s
    assert len(passed) > 30
    np.testing.assert_allclose(passed, np.round(passed), atol=1e-5)
