"""Training rows: what a network would see of tracked people, and where they truly went."""

from dataclasses import replace

import numpy as np
import pytest

from pedpred.errors import ValueRuleError
from pedpred.geometry import rotate
from pedpred.rows.recorded import ViewingSettings, rows_of_viewing
from pedpred.rows.sampling import RowSampling, RowSettings, draw_tracker, sample_rows
from pedpred.rows.simulated import (
    SimulatedSet,
    resample_hermite,
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


def test_only_detections_whose_whole_future_is_known_are_taken_also_newborn_ones():
    scene = straight(seconds=5.0)
    rows = sample_rows(scene, scene.trajectories, KALMAN, 1000, SAMPLING, np.random.default_rng(0))
    assert len(rows["future"]) == 3 * 20  # at 0, 0.1, ..., 1.9 s; the last detection is at 4.9 s
    assert (rows["track"][:, 5] == 0).sum() == 3


def test_newborn_tracks_have_their_share_of_the_rows():
    scene = straight(people=60, seconds=12.0)
    usual = replace(SAMPLING, rows=replace(ROWS, newborn_share=0.0))
    shares = []
    for sampling in (usual, SAMPLING):
        rows = sample_rows(scene, scene.trajectories, KALMAN, 1000, sampling, np.random.default_rng(0))
        assert len(rows["future"]) == 1000
        shares.append(np.mean(rows["track"][:, 5] < 0.25))  # age / 10
    assert shares[0] < 0.05
    assert shares[1] == pytest.approx(0.09, abs=0.02)


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


def test_a_shifted_map_moves_the_beams_alone():
    scene = straight()
    here, shifted = (
        sample_rows(scene, scene.trajectories, KALMAN, 200, sampling, np.random.default_rng(1))
        for sampling in (UNMOVED, replace(SAMPLING, rows=replace(ROWS, shifted_share=0.5, shift_m=0.06)))
    )
    for name in set(here) - {"beams"}:
        np.testing.assert_array_equal(here[name], shifted[name])
    moved = (here["beams"] != shifted["beams"]).any(axis=1)
    near = (here["beams"] < 10).any(axis=1)
    assert 0.3 < moved[near].mean() < 0.6
    apart = np.abs(here["beams"] - shifted["beams"])[moved][here["beams"][moved] < 3]
    assert 0.01 < np.median(apart) < 0.15


@pytest.mark.parametrize("kind", ["corridor", "bottleneck", "room", "square", "lone"])
def test_a_world_gives_the_rows_that_are_asked_for_and_the_same_ones_again(kind):
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


def test_refining_keeps_the_recorded_states_and_walks_between_them():
    fine = simulate_world("room", 0, WORLDS)
    coarse = select_true_states(fine, Area(np.full(2, -1e6), np.full(2, 1e6)), 0.3)
    again = resample_hermite(coarse, 0.1)
    assert again.detection_dt_s == 0.1
    people = {
        int(p): fine.trajectories.select(fine.trajectories.track_id == p)
        for p in np.unique(fine.trajectories.track_id)
    }
    for person, true in people.items():
        mine = again.trajectories.select(again.trajectories.track_id == person)
        _, a, b = np.intersect1d(np.round(mine.time_s, 3), np.round(true.time_s, 3), return_indices=True)
        assert len(a) == len(mine)
        apart = np.linalg.norm(mine.position[a] - true.position[b], axis=1)
        assert apart[::3].max() < 1e-9
        assert apart.max() < 0.05
    assert resample_hermite(fine, 0.1) is fine


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


def test_trackers_are_drawn_from_what_is_set():
    rng, settings = np.random.default_rng(0), ROWS
    drawn = [draw_tracker(settings, rng).filters for _ in range(500)]
    assert np.mean([own[0] in settings.trackers for own in drawn]) == pytest.approx(0.4, abs=0.07)
    assert all(0.012 <= own[0].acceleration_noise <= 0.4 for own in drawn)
    assert np.mean([len(own) > 1 for own in drawn]) == pytest.approx(settings.learning_share, abs=0.07)
    assert draw_tracker(replace(ROWS, trackers=()), rng).filters[0] not in settings.trackers


def test_errors_name_the_field():
    with pytest.raises(ValueRuleError, match="kind"):
        replace(CORRIDOR, kind="tunnel")
    with pytest.raises(ValueRuleError, match="thinnings"):
        replace(VIEWINGS, thinnings=())
    wrong = {"trackers": [{"acceleration_noise": 0.0, "position_noise_m": 0.1}]}
    with pytest.raises(ValueRuleError, match=r"rows\.trackers\[0\]"):
        load(RowSettings, CONF["rows"] | wrong, "rows")
