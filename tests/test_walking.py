"""Validation counts of simulated walking, on cases small enough to count by hand."""

from dataclasses import replace

import numpy as np
import pytest

from pedpred.report.canvas import png_bytes
from pedpred.report.simulation_page import crowd_section, walking_findings
from pedpred.scenes import Scene, Trajectories
from pedpred.simulation.validation import (
    FlowSettings,
    WalkingCounts,
    corridor_flow,
    count_walking,
    lane_order,
)
from tests.simulated import EMPTY_ROOM, SETTINGS, read

FLOW = FlowSettings(**{k: v for k, v in read("validation/corridor_flow").items() if k != "social_force"})


def walked(paths, goals, dt_s=0.3):
    """A scene in which all people are present at all instants; velocities are backward differences."""
    position, goal = (np.swapaxes(np.array(a, dtype=float), 0, 1) for a in (paths, goals))
    velocity = np.diff(position, axis=0, prepend=2 * position[:1] - position[1:2]) / dt_s
    instants, people, _ = position.shape
    time_s, track = np.repeat(np.arange(instants) * dt_s, people), np.tile(np.arange(people), instants)
    states = (part.reshape(-1, 2) for part in (position, velocity, goal))
    trajectories = Trajectories(time_s, track, *states, desired_speed_mps=np.ones(instants * people))
    return Scene("walked", trajectories, EMPTY_ROOM.occupancy(), dt_s)


def line(start, step, count):
    return np.array(start) + np.arange(count)[:, None] * np.array(step)


def test_a_steady_walker_reaches_targets_in_time():
    there = [[3.5, 4.0]] * 5 + [[9.5, 4.0]] * 20 + [[2.0, 4.0]] * 5
    found = count_walking([walked([line((2.0, 4.0), (0.3, 0.0), 30)], [there])], SETTINGS)
    assert (found.states, found.in_obstacle, found.above_cap, found.slow, found.close) == (30, 0, 0, 0, 0)
    assert (found.targets, found.reached) == (1, 1)  # the first began before, the last is not over yet
    assert found.speed_sum == pytest.approx(30.0)


def test_a_target_reached_too_late_counts():
    goals = [[3.0, 4.0]] + [[4.0, 4.0]] * 40 + [[3.0, 4.0]]
    found = count_walking([walked([line((3.0, 4.0), (0.02, 0.0), 42)], [goals])], SETTINGS)  # 1 m in 12 s
    assert (found.targets, found.reached) == (1, 0)


def test_standing_behind_somebody_is_a_queue():
    goals = [[[11.0, 4.0]] * 8] * 2
    front, behind = line((5.0, 4.0), (0.0, 0.0), 8), line((4.4, 4.0), (0.0, 0.0), 8)
    found = count_walking([walked([front, behind], goals)], SETTINGS)
    assert (found.slow, found.slow_outside_queues, found.close) == (16, 8, 0)


def test_walls_caps_and_closeness_are_counted():
    runner, walker = line((2.0, 0.1), (0.9, 0.0), 5), line((2.0, -0.1), (0.9, 0.0), 5)
    found = count_walking([walked([runner, walker], [[[11.0, 4.0]] * 5] * 2)], SETTINGS)
    assert (found.in_obstacle, found.above_cap, found.close) == (5, 10, 10)


def test_separate_lanes_are_perfect_order():
    forward = np.array([True, True, False, False])
    assert lane_order(np.array([1.0, 1.1, 3.0, 3.1]), forward, 0.4) == 1.0
    assert lane_order(np.array([1.0, 1.1, 1.0, 1.1]), forward, 0.4) == pytest.approx(1 / 9)
    assert np.isnan(lane_order(np.array([0.0, 2.0, 4.0, 6.0]), forward, 0.4))


def test_a_small_experiment_becomes_a_page():
    small = replace(FLOW, people=(6, 50), settle_s=6.0, seconds=3.0)
    rows, clearest = corridor_flow(small, SETTINGS)
    assert [row["people"] for row in rows] == [6, 50]
    assert 0.2 < rows[1]["density_per_m2"] < 0.8
    assert rows[1]["speed_mps"] < 1.8
    assert len(np.unique(clearest.trajectories.track_id)) == 50
    assert corridor_flow(small, SETTINGS)[0] == rows or np.isnan(rows[0]["lane_order"])
    counts = WalkingCounts(10, slow=1, targets=4, reached=4)
    section = crowd_section({"main": counts.shares()}, rows, clearest)
    assert [picture.name for picture in section.pictures] == ["flow", "lanes"]
    assert all(png_bytes(picture.figure).startswith(b"\x89PNG") for picture in section.pictures)
    page = section.markdown("simulation")
    assert "| main | no state in an obstacle | 0.00% | met |" in page


def test_a_set_that_breaks_a_rule_says_so():
    found = WalkingCounts(1000, in_obstacle=1, slow_outside_queues=10, targets=1000, reached=994)
    verdicts = [finding.verdict for finding in walking_findings(found.shares())]
    assert verdicts == ["missed", "met", "missed", "missed"]
