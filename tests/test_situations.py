"""Training rows: what a network would see of tracked people, and where they truly went."""

from dataclasses import replace

import numpy as np
import pytest

from pedpred.geometry import rotate
from pedpred.rows.recorded import ViewingSettings, rows_of_viewing
from pedpred.rows.sampling import RowSampling, RowSettings, sample_rows
from pedpred.rows.simulated import (
    SimulatedSet,
    rows_of_scene,
    rows_of_world,
    select_true_states,
)
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from pedpred.settings import load
from pedpred.simulation.worlds import simulate_world
from pedpred.simulation.worlds.views import Area
from pedpred.tracking import KalmanSettings
from tests.exported import MIXTURE_ROWS, widths_of
from tests.simulated import SENSING, read, short_worlds
from tests.worlds import walled_scene

CONF = read("situations/varied")
ROWS = load(RowSettings, CONF["rows"])
WORLDS = short_worlds(12.0, warm_up_s=5.0)
PROTOCOL = MIXTURE_ROWS.protocol
SAMPLING = RowSampling(ROWS, MIXTURE_ROWS, 0.2)
UNMOVED = replace(SAMPLING, rows=replace(ROWS, shifted_share=0.0))
CORRIDOR = SimulatedSet("corridor", "", 2, 60, 30, 1.0)
VIEWINGS = ViewingSettings(3, 50, 0.5, (1.0, 0.5), (0.0, 0.02), (0.0,))
KALMAN = KalmanSettings(0.1, 0.05)


def straight(speed_mps=1.3, angle=0.4, people=3, seconds=9.0, dt_s=0.1):
    """People side by side, 2 m apart, at constant velocity."""
    ticks = round(seconds / dt_s)
    time_s = np.repeat(np.round(np.arange(ticks) * dt_s, 9), people)
    person = np.tile(np.arange(people), ticks)
    way = np.array([np.cos(angle), np.sin(angle)])
    start = 2.0 * person[:, None] * np.array([-way[1], way[0]])
    position = start + speed_mps * time_s[:, None] * way
    walls = np.zeros((200, 200), bool)
    walls[:, 150:] = True
    ground = OccupancyMap(walls, np.array([-10.0, -10.0]), 0.1)
    velocity = np.tile(speed_mps * way, (len(person), 1))
    return Scene("straight", Trajectories(time_s, person, position, velocity), ground, dt_s)


def assert_equal(rows, others):
    assert list(rows) == list(others)
    for name, values in rows.items():
        np.testing.assert_array_equal(values, others[name])


@pytest.mark.parametrize("kalman", [None, KALMAN])
def test_straight_walkers_have_straight_targets(kalman):
    scene = straight()
    rows = sample_rows(scene, scene.trajectories, kalman, 1000, UNMOVED, np.random.default_rng(0))
    ahead = np.cumsum(rows["future"], axis=1) * PROTOCOL.dt_s
    settled = rows["track"][:, 5] == 1.0
    assert settled.sum() > 100
    want = 1.3 * PROTOCOL.dt_s * (np.arange(PROTOCOL.horizon_steps) + 1)
    np.testing.assert_allclose(ahead[settled, :, 0], np.tile(want, (settled.sum(), 1)), atol=0.02)
    np.testing.assert_allclose(ahead[settled, :, 1], 0.0, atol=0.02)
    np.testing.assert_allclose(rows["state"][settled], [[1.3, 0.0]] * settled.sum(), atol=0.02)


def test_the_future_is_known_outside_of_the_view():
    scene = straight()
    seen = select_true_states(scene, Area(np.full(2, -1.0), np.full(2, 5.0)), 0.1)
    rows = sample_rows(seen, scene.trajectories, None, 1000, SAMPLING, np.random.default_rng(0))
    assert len(rows["future"]) == len(seen.trajectories) > 20


def test_targets_belong_to_the_person_and_not_to_the_id():
    scene = straight(people=2)
    states = scene.trajectories
    swapped = replace(states, track_id=1 - states.track_id, person_id=states.track_id)
    results = [
        sample_rows(replace(scene, trajectories=t), states, None, 1000, UNMOVED, np.random.default_rng(0))
        for t in (states, swapped)
    ]
    for rows in results:
        np.testing.assert_allclose(rows["future"][..., 0], 1.3, atol=1e-5)


def test_rows_do_not_depend_on_how_the_world_is_turned():
    scene = straight(people=2)  # three would have neighbours at equal distances
    turn = np.pi / 2
    states = scene.trajectories
    turned = replace(states, position=rotate(states.position, np.full(len(states), turn)))
    walls = np.flip(scene.occupancy.occupied.T, axis=0)  # (x, y) -> (-y, x)
    ground = replace(scene.occupancy, occupied=walls)
    here, there = (
        sample_rows(s, s.trajectories, KALMAN, 50, UNMOVED, np.random.default_rng(1))
        for s in (scene, replace(scene, trajectories=turned, occupancy=ground))
    )
    for name, values in here.items():
        newborn = here["track"][:, 5] == 0  # its heading is not known
        np.testing.assert_allclose(values[~newborn], there[name][~newborn], atol=0.02)


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
