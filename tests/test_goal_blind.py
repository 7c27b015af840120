"""The goal-blind bound: a Bayesian filter over goals that looks at nothing but the past."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from pedpred.baselines.beliefs import Belief, arrival, gone_on, walking, weighed
from pedpred.baselines.goal_blind import drawn_plans, geometric_median, goal_blind_paths
from pedpred.baselines.influences import Influences, Observations, between, others_push
from pedpred.errors import ValueRuleError
from pedpred.evaluation.metrics import displacement
from pedpred.evaluation.scores import true_paths
from pedpred.features import FeatureSettings, extract
from pedpred.simulation import forces, kernel
from pedpred.simulation.ground import ground_of
from pedpred.simulation.routing import directions_at, routes_to
from pedpred.tracking import follow
from tests.simulated import SETTINGS, SOCIAL_FORCE, drawn, scene_of, short

PEOPLE = 8
MOVING = walking(0.3, SETTINGS, ~np.eye(3, dtype=bool))


@pytest.fixture(scope="module")
def walked():
    """A simulated scene and its feature table, noise-free states."""
    scene = scene_of(short(30.0, pedestrians=PEOPLE)[0])
    return scene, extract(scene, follow(scene.recording, "truth", None, 0.2), FeatureSettings())


def forecast(scene, table, rows):
    rng = np.random.default_rng(3)
    return goal_blind_paths(scene, table, rows, SOCIAL_FORCE, 10, 0.3, rng, draws=4)


def at_step(table, *steps):
    return np.flatnonzero(np.isin(table.step, steps))


def test_whose_goal_is_which_is_never_read(walked):
    scene, table = walked
    shuffled = np.random.default_rng(0).permutation(scene.recording.goal)
    speeds = scene.recording.desired_speed_mps[::-1] + 1.0
    other = dataclasses.replace(scene.recording, goal=shuffled, desired_speed_mps=speeds)
    rows = at_step(table, 40)
    strange = forecast(dataclasses.replace(scene, recording=other), table, rows)
    np.testing.assert_array_equal(strange, forecast(scene, table, rows))


def test_the_future_is_never_read(walked):
    scene, table = walked
    rows, past = at_step(table, 40), np.flatnonzero(table.step <= 40)
    cut = table.select(past)
    np.testing.assert_array_equal(
        forecast(scene, cut, np.searchsorted(past, rows)), forecast(scene, table, rows)
    )


def test_the_past_tells_where_people_go(walked):
    scene, table = walked
    rows = at_step(table, *range(50, 90, 4))
    asked = table.select(rows)
    truth, ahead = true_paths(asked, 0.3), 0.3 * np.arange(1, 11)[:, None]
    straight = asked.position[:, None] + asked.last_velocity[:, None] * ahead
    error = displacement(forecast(scene, table, rows), truth).mean()
    assert error < 0.5 * displacement(straight, truth).mean()


def test_a_scene_without_goals_is_refused(walked):
    scene, table = walked
    aimless = dataclasses.replace(scene, recording=dataclasses.replace(scene.recording, goal=None))
    with pytest.raises(ValueRuleError, match=r"recording\.goal"):
        forecast(aimless, table, at_step(table, 40))


def test_weighing_is_bayes_rule_for_a_linear_gaussian_model():
    rng = np.random.default_rng(1)
    prior = Belief(
        np.array([[0.2, 0.5, 0.3]]), rng.uniform(1.15, 1.25, (1, 3)), rng.uniform(0.01, 0.1, (1, 3))
    )
    direction = np.stack([np.cos([0.0, 0.06, -0.04]), np.sin([0.0, 0.06, -0.04])], axis=-1)[None]
    acting = Influences(direction, rng.normal(0, 0.02, (1, 3, 2)))
    start = Observations(np.zeros((1, 2)), np.array([[1.2, 0.0]]))
    end = Observations(np.zeros((1, 2)), np.array([[1.22, 0.05]]))
    found = weighed(prior, start, end, acting, np.zeros((1, 3)), MOVING)
    likelihood = []
    for goal in range(3):
        gain = (1 - MOVING.keep) * direction[0, goal]
        mean = MOVING.keep * start.velocity[0] + gain * prior.speed_mps[0, goal]
        mean = mean + (1 - MOVING.keep) * MOVING.forces.relaxation_time_s * acting.push[0, goal]
        spread = prior.variance[0, goal] * np.outer(gain, gain) + MOVING.noise_mps**2 * np.eye(2)
        likelihood.append(stats.multivariate_normal(mean, spread).pdf(end.velocity[0]))
        information = 1 / prior.variance[0, goal] + gain @ gain / MOVING.noise_mps**2
        assert found.variance[0, goal] == pytest.approx(1 / information, rel=0.05)
    expected = prior.probability[0] * likelihood
    np.testing.assert_allclose(found.probability[0], expected / expected.sum(), rtol=0.05)


@given(st.integers(0, 2**32 - 1))
def test_going_on_keeps_probability_and_the_moments_of_the_speed(seed):
    rng = np.random.default_rng(seed)
    belief = Belief(
        rng.dirichlet(np.ones(3), 5), rng.uniform(0.8, 2.0, (5, 3)), rng.uniform(0.01, 0.1, (5, 3))
    )
    after = gone_on(belief, rng.random((5, 3)), MOVING.following)
    for power in (0, 1, 2):
        before_and_after = [
            (b.probability * (b.variance * (power == 2) + b.speed_mps**power)).sum(axis=1)
            for b in (belief, after)
        ]
        np.testing.assert_allclose(*before_and_after, rtol=1e-9)


def test_a_goal_that_is_reached_is_left_for_one_that_may_follow():
    belief = Belief(np.array([[1.0, 0.0, 0.0]]), np.full((1, 3), 1.3), np.full((1, 3), 0.01))
    goals = np.array([[1.0, 0.4], [5.0, 0.0], [9.0, 0.0]])
    passed = arrival(np.zeros((1, 2)), np.array([[2.0, 0.0]]), goals, 0.5)
    np.testing.assert_allclose(gone_on(belief, passed, MOVING.following).probability, [[0.0, 0.5, 0.5]])


@given(st.integers(0, 2**32 - 1))
def test_draws_follow_the_belief(seed):
    rng = np.random.default_rng(seed)
    probability, draws = rng.dirichlet(np.ones(3), 4), 20
    plans = np.stack(list(drawn_plans(probability, MOVING.following, draws, rng)))
    counts = (plans[..., :1] == np.arange(3)).sum(axis=0)
    assert np.abs(counts - draws * probability).max() <= 1.0
    assert (plans[..., 0] != plans[..., 1]).all()


@given(st.integers(0, 2**32 - 1))
def test_no_point_is_nearer_on_average_than_the_geometric_median(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(0, 1, (7, 1, 2)) ** 3
    found = geometric_median(points, rounds=100)
    others = found + rng.normal(0, 0.2, (50, 2))
    assert (
        np.linalg.norm(points - found, axis=-1).mean()
        <= np.linalg.norm(points - others, axis=-1).mean(0).min() + 1e-3
    )


def test_pushes_are_those_of_the_model_when_all_goals_are_known():
    rng = np.random.default_rng(4)
    angle = rng.uniform(-np.pi, np.pi, (6, 3))
    ways = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    here = Observations(rng.uniform(-2, 2, (6, 2)), rng.normal(0, 1, (6, 2)))
    goal, everyone = rng.integers(0, 3, 6), np.arange(6)
    found = others_push(here, ways, np.eye(3)[goal], SETTINGS.forces)[everyone, goal]
    direction, speed, far = ways[everyone, goal], np.ones(6), np.full(6, 1e3)
    pull = forces.driving_acceleration(here.velocity, direction, speed, SETTINGS.forces.relaxation_time_s)
    total = forces.social_acceleration(*here, direction, speed, far, 0 * direction, SETTINGS.forces)
    np.testing.assert_allclose(found, total - pull, atol=1e-12)


def test_the_way_between_two_observations_meets_both():
    rng = np.random.default_rng(5)
    start, end = (Observations(*rng.normal(0, 1, (2, 4, 2))) for _ in range(2))
    np.testing.assert_allclose(between(start, end, 0.3, 0.0).position, start.position)
    np.testing.assert_allclose(between(start, end, 0.3, 1.0).position, end.position)
    later = between(start, end, 0.3, 1e-6).position
    np.testing.assert_allclose((later - start.position) / 0.3e-6, start.velocity, atol=1e-3)


def test_directions_are_those_of_the_kernel():
    rng = np.random.default_rng(6)
    ground = ground_of(drawn("columns").occupancy())
    routes = routes_to(rng.uniform(2, 10, (3, 2)), ground, SETTINGS.routing)
    points = rng.uniform(-1, 21, (30, 2))
    expected = [[kernel.way(*point, goal, routes) for goal in range(3)] for point in points]
    np.testing.assert_allclose(directions_at(points, routes), expected, atol=1e-5)
