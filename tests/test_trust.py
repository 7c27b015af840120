"""Trust in a network beside straight lines: what is learned, from what, and what stays."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pedpred.forecasting.trust import Trust
from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.online.replay import replay_scene
from pedpred.scenes import Predictions
from tests.learners import along
from tests.worlds import come_again, walled_scene

STEPS, DT_S, EVERY_S = 10, 0.3, 0.3
SEEDS = st.integers(0, 2**32 - 1)


def stream(rng, frames=80, people=8, wrong_m=0.3, noise_m=0.0, turn_radps=0.0, stay_s=8.0):
    """People who walk straight or in circles, and forecasts that are wrong by a vector per person and step.

    Everybody leaves after some time, and somebody else goes on in the same way.

    Returns:
        Person, time, detection and seen of each row, its true path, and its forecasts.
    """
    time_s, person = np.repeat(np.arange(frames) * EVERY_S, people), np.tile(np.arange(people), frames)
    heading, speed = rng.uniform(-np.pi, np.pi, people), rng.uniform(0.8, 1.6, people)
    turn = np.where(rng.random(people) < 0.5, -1.0, 1.0) * max(turn_radps, 1e-9)

    def position(at_s):
        angle = heading[person, None] + turn[person, None] * at_s
        return (speed / turn)[person, None, None] * np.stack([np.sin(angle), -np.cos(angle)], axis=-1)

    truth = position(time_s[:, None] + DT_S * np.arange(1, STEPS + 1))
    here = position(time_s[:, None])[:, 0]
    point = truth + (wrong_m * rng.normal(size=(people, STEPS, 2)))[person]
    path = np.stack([point, point + 0.5], axis=1)
    covariance = np.broadcast_to(0.1 * np.eye(2), (len(here), 2, STEPS, 2, 2)).copy()
    weight = np.tile([0.7, 0.3], (len(here), 1))
    detection = here + noise_m * rng.normal(size=here.shape)
    seen, who = np.ones(len(here), bool), person + people * np.floor(time_s / stay_s).astype(int)
    return who, time_s, detection, seen, truth, Predictions(point, path, weight, DT_S, covariance)


def learned(*rows):
    """The forecasts of all instants with trust that learns."""
    return Predictions.join([changed for _, changed in along(Trust.initial(STEPS), *rows)])


def errors_m(forecasts, truth, rows):
    return np.linalg.norm(forecasts.point - truth, axis=-1)[rows].mean()


def test_lines_that_are_always_right_are_approached():
    person, time_s, detection, seen, truth, forecasts = stream(np.random.default_rng(0), 500)
    after = learned(person, time_s, detection, seen, forecasts)
    late = (time_s > 130.0) & (time_s % 8.0 > 1.5)
    assert errors_m(after, truth, late) < 0.25 * errors_m(forecasts, truth, late)


@pytest.mark.parametrize("turn_radps", [0.3, 1.0])
def test_a_network_that_is_always_right_is_kept(turn_radps):
    rng = np.random.default_rng(3)
    person, time_s, detection, seen, truth, forecasts = stream(rng, 150, wrong_m=0.0, turn_radps=turn_radps)
    after = learned(person, time_s, detection, seen, forecasts)
    assert errors_m(after, truth, time_s > 0) < 0.002


@settings(max_examples=5, deadline=None)
@given(seed=SEEDS)
def test_a_person_changes_no_forecast_of_others_before_it_has_left(seed):
    """The first people are there for 10 s, and have left 4 s later; all others have learned from then on."""
    rng = np.random.default_rng(seed)
    person, time_s, detection, seen, _, forecasts = stream(rng, 100, noise_m=0.02, stay_s=10.0)
    other, odd = detection.copy(), person == 0
    other[odd] += rng.normal(0, 3.0, (odd.sum(), 2))
    after = learned(person, time_s, detection, seen, forecasts)
    changed = learned(person, time_s, other, seen, forecasts)
    there = (time_s < time_s[odd].max() + 4.0) & ~odd
    np.testing.assert_array_equal(changed.point[there], after.point[there])
    later = (time_s > time_s[odd].max() + 4.5) & (time_s < 20.0)
    assert (changed.point != after.point)[later].any()


@settings(max_examples=5, deadline=None)
@given(seed=SEEDS, cut=st.integers(40, 75))
def test_nothing_is_learned_from_the_future(seed, cut):
    person, time_s, detection, seen, _, forecasts = stream(np.random.default_rng(seed), noise_m=0.02)
    first = np.arange(cut * 8)
    part = learned(person[first], time_s[first], detection[first], seen[first], forecasts.select(first))
    whole = learned(person, time_s, detection, seen, forecasts)
    np.testing.assert_array_equal(part.point, whole.point[first])
    np.testing.assert_array_equal(part.path, whole.path[first])
    assert (whole.point != forecasts.point).any()


def test_what_is_kept_does_not_grow():
    sizes = []
    rows = _without_truth(stream(np.random.default_rng(8), 300, 20, stay_s=15.0))
    for place, _ in along(Trust.initial(STEPS), *rows):
        trust = place.trust
        kept = sum(len(past.person) for past in trust.past)
        sizes.append((len(trust.past), kept, len(place.detections.time_s), len(trust.person)))
        assert trust.place.compared.max() <= 10000
    assert (np.max(sizes, axis=0) == np.max(sizes[:75], axis=0)).all()
    assert trust.place.compared.max() > 1000


def _without_truth(rows):
    person, time_s, detection, seen, _, forecasts = rows
    return person, time_s, detection, seen, forecasts


def test_velocities_on_a_robot_lead_to_the_point_forecast(mixture):
    """They follow paths that were moved, of people who come after others have left."""
    scene = walled_scene(np.random.default_rng(10), 0.1, detections=120, tracks=5)
    predictor = OnlinePredictor.load(mixture[0], OnlineSettings(0.05))
    moved = False
    for forecast in replay_scene(come_again(scene, 60.0), predictor):
        steps = np.diff(forecast.position, axis=1)
        np.testing.assert_allclose(forecast.velocity[:, 1:] * forecast.dt_s, steps, atol=1e-4)
        moved = moved or bool(predictor._place.trust.weights.any())
    assert moved
