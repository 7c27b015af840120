"""Group forces (Moussaid et al. 2010), and the fit of the forces."""

import numpy as np
import pytest

from pedpred.baselines.social_force import initial_state, intentions
from pedpred.errors import ValueRuleError
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from pedpred.simulation import kernel
from pedpred.simulation.settings import SocialForceSettings
from tests import groups
from tests.simulated import SETTINGS
from tools.fit_social_force import FITTED, fit_forces

FORCES = SETTINGS.forces
EAST = np.array([1.0, 0.0])


def pull(position, group, velocity=EAST):
    count = len(position)
    states = (np.array(position, dtype=float), np.tile(velocity, (count, 1)), np.tile(EAST, (count, 1)))
    return groups.group_acceleration(*states, np.array(group), FORCES)


def test_kernel_equals_the_pure_functions():
    rng = np.random.default_rng(0)
    angle = rng.uniform(-np.pi, np.pi, 40)
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    states = (rng.uniform(-2, 2, (40, 2)), rng.normal(0, 1, (40, 2)), direction, rng.integers(-1, 12, 40))
    expected = groups.group_acceleration(*states, FORCES)
    members = np.flatnonzero(states[-1] >= 0)
    found = [kernel.accompany(n, *states, FORCES) for n in members]
    np.testing.assert_allclose(found, expected[members], atol=1e-9)
    assert np.abs(expected[members]).max() > 1.0


def test_who_is_alone_or_has_lost_its_group_feels_nothing():
    np.testing.assert_array_equal(pull([[0, 0], [0, 0.3], [9, 9]], [-1, -1, 4]), 0.0)


def test_members_far_apart_are_drawn_together_and_near_ones_pushed_apart():
    far, near, pleasant = (pull([[0, 0], [0, gap]], [1, 1]) for gap in (3.0, 0.4, 0.9))
    np.testing.assert_allclose(far, [[0, FORCES.group_attraction], [0, -FORCES.group_attraction]], atol=1e-9)
    np.testing.assert_allclose(near, [[0, -FORCES.group_repulsion], [0, FORCES.group_repulsion]], atol=1e-9)
    np.testing.assert_allclose(pleasant, 0.0, atol=1e-9)


def test_who_walks_ahead_slows_down_for_those_behind():
    ahead, behind = pull([[0.9, 0], [0, 0]], [1, 1], 1.2 * EAST)
    np.testing.assert_allclose(ahead, -FORCES.group_gaze * (np.pi / 2) * 1.2 * EAST)
    np.testing.assert_allclose(behind, 0.0, atol=1e-9)


def crowded_pavement(group):
    """Two pairs meet; everybody's track ends 12 m ahead."""
    time_s = np.repeat(0.3 * np.arange(31), 4)
    start = np.array([[2.0, 4.0], [2.0, 5.2], [14.0, 4.3], [14.0, 5.5]])
    velocity = np.array([[1.3, 0], [1.3, 0], [-1.3, 0], [-1.3, 0]])
    position = np.tile(start, (31, 1)) + np.tile(velocity, (31, 1)) * time_s[:, None]
    place = OccupancyMap(np.zeros((160, 100), dtype=bool), np.zeros(2), 0.1)
    trajectories = Trajectories(time_s, np.tile(np.arange(4), 31), position, group_id=np.tile(group, 31))
    first = np.arange(4)
    return Scene("pavement", trajectories, place, 0.3), (first, np.zeros(4), start, velocity)


def start_of(group):
    scene, now = crowded_pavement(group)
    return initial_state(scene, *now, SETTINGS.routing)


def test_annotated_groups_reach_the_rollout():
    scene, (track, time_s, _, velocity) = crowded_pavement([7, 7, 2, -1])
    assert intentions(scene.trajectories, track, time_s, velocity).group.tolist() == [7, 7, 2, -1]
    together, alone = (start_of(group).paths(SETTINGS, 10, 0.3) for group in ([7, 7, 2, -1], [-1] * 4))
    gaps = [np.linalg.norm(paths[0] - paths[1], axis=-1).max() for paths in (together, alone)]
    assert gaps[0] < gaps[1]
    np.testing.assert_allclose(together[2:], alone[2:], atol=0.1)


def changed(**values) -> SocialForceSettings:
    return SocialForceSettings(FORCES._replace(**values), SETTINGS.routing, SETTINGS.crowd, SETTINGS.clock)


def test_a_fit_comes_closer_to_what_people_did_and_leaves_the_rest_alone():
    start = start_of([7, 7, 2, 2])
    truth = start.paths(changed(pedestrian_strength=6.0, relaxation_time_s=0.9), 10, 0.3)
    fit = fit_forces(start, np.arange(4), truth, SETTINGS, 0.3, most_trials=60)
    assert fit.reached_m < 0.5 * fit.start_m
    assert tuple(fit.forces) == FITTED
    off = start.paths(changed(**fit.forces), 10, 0.3) - truth
    assert fit.reached_m == pytest.approx(np.linalg.norm(off, axis=-1).mean())


def test_a_fit_needs_the_truth_of_every_row_asked():
    start = start_of([-1] * 4)
    with pytest.raises(ValueRuleError, match="truth"):
        fit_forces(start, np.arange(4), np.zeros((3, 10, 2)), SETTINGS, 0.3, most_trials=5)
