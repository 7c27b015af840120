"""Forecasts without training beside numbers by hand."""

from dataclasses import replace

import numpy as np
import pytest

from pedpred.baselines import present_motion
from pedpred.baselines.present_motion import PRESENT_MOTION, kalman_covariance, kalman_velocity
from pedpred.baselines.registry import BASELINES, baseline
from pedpred.baselines.social_force import (
    InitialState,
    initial_state,
    intentions,
    people_present,
    rows_of_instants,
    social_force,
)
from pedpred.errors import ValueRuleError
from pedpred.features import ForecastProtocol, extract_at_detections
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from pedpred.simulation.crowd import crowd_of
from pedpred.tracking import KalmanSettings, follow
from tests.by_hand.grounds import FORCES, OPEN, routes_along
from tests.by_hand.lives import PACE, SEEN, TRACKED, scene_of, tracks_of
from tests.by_hand.walks import settled
from tests.forecasts import request_about
from tests.simulated import SETTINGS
from tests.worlds import empty_map

ROWS = np.array([3, 7, 2, 5])
"""The last detections of both tracks, and others."""


def request_of(dt_s, rows=ROWS, **given):
    sizes = ForecastProtocol(dt_s, 3)
    table = extract_at_detections(scene_of(), tracks_of(), sizes)
    return request_about(scene_of(), table, rows, **{"sizes": sizes} | given)


@pytest.mark.parametrize("dt_s", [0.3, 0.4])
def test_present_motion_goes_on_by_hand(dt_s):
    """p + v t and p + v t + a t^2 / 2 of the last detections, x + u t of the tracked state."""
    t = dt_s * np.array([[1.0], [2.0], [3.0]])
    v = np.array([[0.3 / 0.5, 0.8 / 0.5], [0.5, -2.5], [1.5, -0.25], [1.0, -1.0]])
    a = np.array([(v[0] - v[2]) / 0.5, [0, 0], (v[2] - [1.0, 0.5]) / 0.4, [0, 0]])
    straight = SEEN[ROWS][:, None] + v[:, None] * t
    paths = {"cv": straight, "ca": straight + a[:, None] * t**2 / 2}
    paths["kalman_cv"] = TRACKED[ROWS][:, None] + PACE[ROWS][:, None] * t
    for name, expected in paths.items():
        found = PRESENT_MOTION[name]()(request_of(dt_s))
        np.testing.assert_allclose(found.point, expected, atol=1e-6)
        np.testing.assert_array_equal(found.path[:, 0], found.point)
        assert (found.dt_s, found.frame, found.covariance) == (dt_s, "world", None)
    assert (list(PRESENT_MOTION), present_motion.STRONGEST) == (list(paths), "kalman_cv")


@pytest.mark.parametrize("dt_s", [0.3, 0.4])
def test_covariance_of_the_kalman_baseline_by_hand(dt_s):
    """P_pp + 2 t P_pv + t^2 P_vv + q t^3 / 3 + r^2 on each axis; P solves the Riccati equation at 0.25 s."""
    q, r, t = 0.3, 0.2, dt_s * np.array([1.0, 2.0, 3.0])
    p = settled(0.25, q, r)
    variance = p[0, 0] + 2 * t * p[0, 1] + t**2 * p[1, 1] + q * t**3 / 3 + r**2
    expected = variance[:, None, None] * np.array([[1.0, 0.0], [0.0, 1.0]])
    np.testing.assert_allclose(kalman_covariance(KalmanSettings(q, r, 1.3), 0.25, t), expected)
    request = request_of(dt_s, tracker=KalmanSettings(q, r, 1.3), detection_interval_s=0.25)
    found = kalman_velocity()(request)
    np.testing.assert_allclose(found.covariance, np.broadcast_to(expected, (4, 1, 3, 2, 2)))


def test_a_row_names_its_baseline_by_key_or_setting():
    assert list(BASELINES) == ["cv", "ca", "kalman_cv", "social_force"]
    request = request_of(0.3)
    for made in (baseline("ca", {}), baseline("bent", {"baseline": "ca"})):
        np.testing.assert_array_equal(made(request).point, BASELINES["ca"]()(request).point)
    for key, settings in (("bent", {}), ("bent", {"baseline": "other"}), ("cv", {"speed": 1.0})):
        with pytest.raises(ValueRuleError):
            baseline(key, settings)


# People who are rolled out together


def test_everybody_present_is_rolled_out_at_each_instant():
    """At 1.02, 1.4 and 1.8 s, up to 0.5 s old: track 4 at 1.0 + 0.02, 1.4 and 1.8 s, 7 at 1.02 (+ 0.38) s."""
    request = request_of(0.4, np.array([1, 7, 2]))
    people, answers = people_present(request)
    assert people.track_id.tolist() == [4, 4, 4, 7, 7]
    assert people.time_s.tolist() == [1.02, 1.4, 1.8, 1.02, 1.4]
    late, rows = np.array([0.02, 0, 0, 0, 0.38])[:, None], [0, 1, 2, 7, 7]
    np.testing.assert_allclose(people.velocity, PACE[rows], atol=1e-6)
    np.testing.assert_allclose(people.position, TRACKED[rows] + late * PACE[rows], atol=1e-6)
    assert answers.tolist() == [1, 3, 2]
    np.testing.assert_allclose(people.position[answers], TRACKED[[1, 7, 2]], atol=1e-6)
    sooner = replace(request, sizes=ForecastProtocol(0.4, 3, max_age_intervals=0.9))
    assert people_present(sooner)[0].track_id.tolist() == [4, 4, 4, 7]


def test_rows_are_grouped_by_instant():
    found = rows_of_instants(np.array([2.0, 0.5, 2.0, 1.0, 0.5]))
    assert [rows.tolist() for rows in found] == [[1, 4], [3], [0, 2]]
    assert rows_of_instants(np.zeros(0)) == []


@pytest.mark.parametrize("dt_s", [0.3, 0.4])
def test_people_of_other_instants_walk_alone_by_hand(dt_s):
    """v(k) = v0 e + (v(0) - v0 e) (1 - h / tau)^k with h = 0.05 s and x(k) = x(0) + h sum v(1..k).

    The two stand in each other's way, but at different instants.
    """
    place, v = np.array([[0.4, -0.7], [0.5, -0.6]]), np.array([[0.2, 0.1], [-0.3, 0.8]])
    crowd = crowd_of(place, v, [1.1, 0.7], [[0], [1]])
    routes = routes_along([0.6, -0.8], [0.0, 1.0])
    start = InitialState(crowd, np.array([3.0, 2.0]), OPEN, routes)
    paths = start.paths(replace(SETTINGS, forces=FORCES), 3, dt_s)
    desired, k = np.array([[0.66, -0.88], [0.0, 0.7]])[:, None], np.arange(1, 25)[:, None]
    velocity = desired + (v[:, None] - desired) * (1 - 0.05 / 0.6) ** k
    every = round(dt_s / 0.05)
    expected = place[:, None] + 0.05 * np.cumsum(velocity, axis=1)
    np.testing.assert_allclose(paths, expected[:, every - 1 : 3 * every : every], atol=1e-6)
    both = start._replace(time_s=np.array([2.0, 2.0])).paths(replace(SETTINGS, forces=FORCES), 3, dt_s)
    assert np.abs(both - paths).max() > 0.1


# Social forces


def recorded(**known):
    """Track 3 at 0, 0.4, 0.9, 1.3 and 1.6 s, and track 8 at 0.4, 0.9 and 1.6 s."""
    time_s = [0.0, 0.4, 0.4, 0.9, 0.9, 1.3, 1.6, 1.6]
    track = [3, 3, 8, 3, 8, 3, 3, 8]
    place = [[1, 1], [2, 1], [9, 3], [3, 2], [9, 4], [4, 2], [5, 3], [9, 6]]
    return Trajectories(time_s, track, place, **known)


ASKED, ASKED_S = np.array([8, 3, 3, 8]), np.array([0.9, 1.0, 0.3999995, 0.1])
ASKED_PACE = np.array([[0.3, -0.4], [0.0, 1.5], [1.2, 0.5], [0.0, 0.0]])


def test_without_goals_the_end_of_each_track_is_the_goal():
    """At the tracked speeds, alone."""
    wanted = intentions(recorded(), ASKED, ASKED_S, ASKED_PACE)
    assert wanted.plan.shape == (4, 1)
    assert wanted.goals[wanted.plan[:, 0]].tolist() == [[9, 6], [5, 3], [5, 3], [9, 6]]
    assert wanted.goals.shape == (2, 2)
    np.testing.assert_allclose(wanted.desired_speed, [0.5, 1.5, 1.3, 0.0])
    assert wanted.group.tolist() == [-1] * 4


def test_known_goals_speeds_and_groups_are_those_of_the_instant():
    """Row by row: the goals from the last detection on, four at most, and its speed and group.

    0.3999995 s is the detection at 0.4 s; track 8 is asked for before its first one at 0.4 s.
    """
    a, b, c, d, e = [0, 1], [5, 1], [5, 2], [7, 7], [8, 2]
    goal = np.array([a, b, d, c, a, e, d, a], float)
    known = {"goal": goal, "desired_speed_mps": np.arange(1.0, 9.0), "group_id": [4, 5, 6, 7, -1, 9, 10, 11]}
    wanted = intentions(recorded(**known), ASKED, ASKED_S, ASKED_PACE)
    plans = [[wanted.goals[one].tolist() for one in plan if one >= 0] for plan in wanted.plan]
    assert plans == [[a], [c, e, d], [b, c, e, d], [d, a]]
    assert (wanted.plan == -1).sum(axis=1).tolist() == [3, 1, 0, 2]
    assert wanted.desired_speed.tolist() == [5.0, 4.0, 2.0, 3.0]
    assert wanted.group.tolist() == [-1, 7, 5, 6]
    first = intentions(recorded(**known), np.array([3]), np.array([0.0]), np.zeros((1, 2)))
    assert first.goals[first.plan[0]].tolist() == [a, b, c, e]
    with pytest.raises(ValueRuleError):
        intentions(recorded(), np.array([5]), np.array([0.0]), np.zeros((1, 2)))


@pytest.mark.parametrize(
    ("cell_m", "routing_m", "place", "margin"),
    [
        (0.1, 0.2, (3.0, 1.0), 30),  # 3 m around a map that holds everything
        (0.1, 0.2, (4.61, 1.0), 40),  # 0.96 m beyond x = 3.65 m: 3.96 m are 20 routing cells
        (0.1, 0.2, (2.0, -1.37), 44),  # 1.37 m beyond y = 0
        (0.1, 0.3, (1.2, 1.0), 33),  # 0.15 m before x = 1.35 m: 11 routing cells of three
        (0.5, 0.2, (4.05, 1.0), 7),  # 3.2 m: at least one cell
    ],
)
def test_ground_around_the_map_holds_everybody_and_3_metres(cell_m, routing_m, place, margin):
    """A map of 2.3 x 1.9 m (2.5 x 2 m) from (1.35, 0) on; the goal (2, 1) is in it."""
    shape = np.ceil(np.array([2.3, 1.9]) / cell_m - 1e-9).astype(int)
    walk = Trajectories([0.0, 0.4], [1, 1], [[2.0, 1.1], [2.0, 1.0]])
    scene = Scene("map", walk, OccupancyMap(np.ones(shape, bool), np.array([1.35, 0.0]), cell_m), 0.4)
    routing = replace(SETTINGS.routing, resolution_m=routing_m)
    start = initial_state(scene, [1], [0.0], place, [0.6, -0.8], routing)
    np.testing.assert_allclose(start.ground.origin, np.array([1.35, 0.0]) - margin * cell_m)
    assert start.ground.occupied.shape == tuple(shape + 2 * margin)
    assert start.ground.occupied.sum() == shape.prod()
    np.testing.assert_array_equal(start.crowd.position, [place])
    np.testing.assert_array_equal(start.crowd.velocity, [[0.6, -0.8]])
    assert (start.crowd.desired_speed.tolist(), start.crowd.group.tolist()) == ([1.0], [-1])
    assert (start.time_s.tolist(), start.time_s.dtype) == ([0.0], np.float64)


@pytest.mark.parametrize("dt_s", [0.3, 0.4])
def test_a_lone_walker_with_a_goal_ahead_goes_straight_on(dt_s):
    """Nothing accelerates who walks at the desired speed towards the end of the track."""
    time_s = 0.4 * np.arange(8)
    place = np.array([-4.0, 1.5]) + np.outer(time_s, [1.2, 0.0])
    scene = Scene(
        "straight", Trajectories(time_s, [5] * 8, place, np.tile([1.2, 0.0], (8, 1))), empty_map(), 0.4
    )
    sizes = ForecastProtocol(dt_s, 3)
    table = extract_at_detections(scene, follow(scene.trajectories, "truth", None, 0.2), sizes)
    rows = np.array([3, 0])
    request = request_about(scene, table, rows, sizes=sizes, social_force=SETTINGS)
    found = social_force()(request)
    expected = place[rows][:, None] + dt_s * np.arange(1, 4)[:, None] * [1.2, 0.0]
    np.testing.assert_allclose(found.point, expected, atol=2e-3)
    assert found.dt_s == dt_s
