"""The goal-blind bound: a Bayesian filter over goals that looks at nothing but the past."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from scipy.spatial.distance import pdist

from pedpred.baselines.beliefs import GoalBelief, apply_bayes, arrival, process_variance, replace_reached
from pedpred.baselines.candidates import draw_candidates, room_goals
from pedpred.baselines.goal_inference import draw_plans, geometric_median, goal_unseen, infer_paths
from pedpred.baselines.influences import Influences, Observations, between, others_push
from pedpred.baselines.together import forecast_jointly
from pedpred.baselines.walking import Walking
from pedpred.errors import ValueRuleError
from pedpred.evaluation.scores import true_paths
from pedpred.features import FeatureSettings, extract
from pedpred.metrics.paths import displacement
from pedpred.simulation import kernel
from pedpred.simulation.ground import ground_of
from pedpred.simulation.layouts import open_cells
from pedpred.simulation.routing import directions_at, routes_to
from pedpred.tracking import follow
from tests.forces import driving_acceleration, social_acceleration
from tests.forecasts import request_about
from tests.simulated import SETTINGS, drawn, scene_of, short

PEOPLE = 8
MOVING = Walking(0.3, SETTINGS, (1.0 - np.eye(3)) / 2.0, 0.0)


@pytest.fixture(scope="module")
def walked():
    """A simulated scene and its feature table, noise-free states; every detection is a step of the clock."""
    scene = scene_of(short(30.0, pedestrians=PEOPLE)[0])
    return scene, extract(scene, follow(scene.trajectories, "truth", None, 0.2), FeatureSettings())


def among(candidates, scene, table, rows):
    rng = np.random.default_rng(3)
    request = request_about(scene, table, rows, social_force=SETTINGS, clock=table)
    return forecast_jointly(request, lambda who: infer_paths(request, who, candidates, rng, draws=4)).point


def forecast(scene, table, rows):
    return among(room_goals(scene), scene, table, rows)


def unseen(scene, table, rows):
    return goal_unseen(12)(request_about(scene, table, rows, social_force=SETTINGS, clock=table)).point


def imagined(count, seed=0):
    rng = np.random.default_rng(seed)
    return draw_candidates(drawn("columns").occupancy(), SETTINGS.crowd.clearance_m, count, rng)


def at_step(table, *steps):
    return np.flatnonzero(np.isin(table.step, steps))


def test_whose_goal_is_which_is_never_read(walked):
    scene, table = walked
    shuffled = np.random.default_rng(0).permutation(scene.trajectories.goal)
    speeds = scene.trajectories.desired_speed_mps[::-1] + 1.0
    other = dataclasses.replace(scene.trajectories, goal=shuffled, desired_speed_mps=speeds)
    rows = at_step(table, 40)
    strange = forecast(dataclasses.replace(scene, trajectories=other), table, rows)
    np.testing.assert_array_equal(strange, forecast(scene, table, rows))


def test_who_sees_a_room_for_the_first_time_reads_nobodys_goal(walked):
    scene, table = walked
    aimless = dataclasses.replace(scene, trajectories=dataclasses.replace(scene.trajectories, goal=None))
    rows = at_step(table, 40)
    np.testing.assert_array_equal(unseen(aimless, table, rows), unseen(scene, table, rows))


@pytest.mark.parametrize("method", [forecast, unseen])
def test_the_future_is_never_read(walked, method):
    scene, table = walked
    rows, past = at_step(table, 40), np.flatnonzero(table.step <= 40)
    cut = table.select(past)
    np.testing.assert_array_equal(method(scene, cut, np.searchsorted(past, rows)), method(scene, table, rows))


def test_candidates_that_hardly_stand_for_more_than_themselves_forecast_as_the_pool_does(walked):
    scene, table = walked
    rows, pool = at_step(table, 40), room_goals(scene)
    nearly = dataclasses.replace(pool, spread_m=1e-6)
    np.testing.assert_allclose(among(nearly, scene, table, rows), among(pool, scene, table, rows), atol=1e-6)


@pytest.mark.parametrize("count", [1, 12, 60])
def test_drawn_candidates_lie_where_people_can_want_to_go_and_share_the_ground(count):
    found, ground = imagined(count), ground_of(drawn("columns").occupancy())
    cells = open_cells(ground, SETTINGS.crowd.clearance_m)
    assert len(found.position) == count
    assert {tuple(place) for place in found.position} <= {tuple(cell) for cell in cells}
    area_m2 = len(cells) * ground.resolution_m**2
    assert count * np.pi * found.spread_m**2 == pytest.approx(area_m2)
    assert pdist(found.position).min(initial=np.inf) >= found.spread_m


def test_candidates_are_another_draw_with_another_seed_and_the_same_with_the_same():
    np.testing.assert_array_equal(imagined(20, 5).position, imagined(20, 5).position)
    assert not np.isin(imagined(20, 5).position, imagined(20, 6).position).all()


def test_no_candidate_at_all_is_refused():
    with pytest.raises(ValueRuleError, match="at least 1"):
        imagined(0)


def test_a_goal_beside_its_candidate_surprises_less_the_farther_away_it_is():
    prior = GoalBelief(np.full((1, 3), 1 / 3), np.full((1, 3), 1.3), np.full((1, 3), 0.05))
    places = np.array([[1.0, 0.0], [4.0, 0.0], [16.0, 0.0]])
    known, vague = MOVING, dataclasses.replace(MOVING, spread_m=0.4)
    here, push = np.zeros((1, 2)), np.zeros((1, 3))
    extra = [process_variance(prior, here, places, push, model)[0] for model in (known, vague)]
    np.testing.assert_array_equal(extra[0], MOVING.noise_mps**2)
    misled = (1 - MOVING.keep) * 1.3 * 0.2 / places[:, 0]
    np.testing.assert_allclose(extra[1] - extra[0], misled**2)


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
    aimless = dataclasses.replace(scene, trajectories=dataclasses.replace(scene.trajectories, goal=None))
    with pytest.raises(ValueRuleError, match=r"trajectories\.goal"):
        forecast(aimless, table, at_step(table, 40))


def test_weighing_is_bayes_rule_for_a_linear_gaussian_model():
    rng = np.random.default_rng(1)
    speed_mps, variance = rng.uniform(1.15, 1.25, (1, 3)), rng.uniform(0.01, 0.1, (1, 3))
    prior = GoalBelief(np.array([[0.2, 0.5, 0.3]]), speed_mps, variance)
    direction = np.stack([np.cos([0.0, 0.06, -0.04]), np.sin([0.0, 0.06, -0.04])], axis=-1)[None]
    acting = Influences(direction, rng.normal(0, 0.02, (1, 3, 2)))
    start = Observations(np.zeros((1, 2)), np.array([[1.2, 0.0]]))
    end = Observations(np.zeros((1, 2)), np.array([[1.22, 0.05]]))
    found = apply_bayes(prior, start, end, acting, np.full((1, 3), MOVING.noise_mps**2), MOVING)
    likelihood = []
    for goal in range(3):
        gain = (1 - MOVING.keep) * direction[0, goal]
        mean = MOVING.keep * start.velocity[0] + gain * prior.speed_mps[0, goal]
        mean = mean + (1 - MOVING.keep) * SETTINGS.forces.relaxation_time_s * acting.push[0, goal]
        spread = prior.variance[0, goal] * np.outer(gain, gain) + MOVING.noise_mps**2 * np.eye(2)
        likelihood.append(stats.multivariate_normal(mean, spread).pdf(end.velocity[0]))
        information = 1 / prior.variance[0, goal] + gain @ gain / MOVING.noise_mps**2
        assert found.variance[0, goal] == pytest.approx(1 / information, rel=0.05)
    expected = prior.probability[0] * likelihood
    np.testing.assert_allclose(found.probability[0], expected / expected.sum(), rtol=0.05)


@given(st.integers(0, 2**32 - 1))
def test_going_on_keeps_probability_and_the_moments_of_the_speed(seed):
    rng = np.random.default_rng(seed)
    speed_mps, variance = rng.uniform(0.8, 2.0, (5, 3)), rng.uniform(0.01, 0.1, (5, 3))
    belief = GoalBelief(rng.dirichlet(np.ones(3), 5), speed_mps, variance)
    after = replace_reached(belief, rng.random((5, 3)), MOVING.following)
    for power in (0, 1, 2):
        before_and_after = [
            (b.probability * (b.variance * (power == 2) + b.speed_mps**power)).sum(axis=1)
            for b in (belief, after)
        ]
        np.testing.assert_allclose(*before_and_after, rtol=1e-9)


def test_a_goal_that_is_reached_is_left_for_one_that_may_follow():
    belief = GoalBelief(np.array([[1.0, 0.0, 0.0]]), np.full((1, 3), 1.3), np.full((1, 3), 0.01))
    goals = np.array([[1.0, 0.4], [5.0, 0.0], [9.0, 0.0]])
    passed = arrival(np.zeros((1, 2)), np.array([[2.0, 0.0]]), goals, MOVING)
    after = replace_reached(belief, passed, MOVING.following)
    np.testing.assert_allclose(after.probability, [[0.0, 0.5, 0.5]])


@given(st.integers(0, 2**32 - 1))
def test_draws_follow_the_belief(seed):
    rng = np.random.default_rng(seed)
    probability, draws = rng.dirichlet(np.ones(3), 4), 20
    plans = np.stack(list(draw_plans(probability, MOVING.following, draws, rng)))
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
    pull = driving_acceleration(here.velocity, direction, speed, SETTINGS.forces.relaxation_time_s)
    total = social_acceleration(*here, direction, speed, far, 0 * direction, SETTINGS.forces)
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
