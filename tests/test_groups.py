"""Groups in a rollout, and the fit of the forces."""

import numpy as np
import pytest

from pedpred.baselines.social_force import initial_state, intentions
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from pedpred.simulation.settings import SocialForceSettings
from tests.simulated import SETTINGS
from tools.fit_social_force import FITTED, fit_forces

FORCES = SETTINGS.forces


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


def test_a_fit_comes_closer_to_what_people_did():
    start = start_of([7, 7, 2, 2])
    truth = start.paths(changed(pedestrian_strength=6.0, relaxation_time_s=0.9), 10, 0.3)
    fit = fit_forces(start, np.arange(4), truth, SETTINGS, 0.3, most_trials=60)
    assert fit.reached_m < 0.5 * fit.start_m
    assert tuple(fit.forces) == FITTED
    off = start.paths(changed(**fit.forces), 10, 0.3) - truth
    assert fit.reached_m == pytest.approx(np.linalg.norm(off, axis=-1).mean())
