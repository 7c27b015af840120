"""Regions that learn from how people walk: what they learn, from what, and what stays."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pedpred.forecasting.regions import Regions
from pedpred.metrics.calibration import REGIONS, coverage, share_inside
from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.scenes import Predictions
from tests.learners import at_instant, learned, place_of

STEPS, DT_S, EVERY_S = 10, 0.3, 0.3
SEEDS = st.integers(0, 2**32 - 1)


def walks(rng, frames=400, people=20, noise_m=0.1):
    """Random walks: time of each row, who, where, and the forecasts whose deviations are right."""
    position = np.cumsum(rng.normal(0, noise_m, (frames, people, 2)), axis=0)
    time_s, track_id = np.repeat(np.arange(frames) * EVERY_S, people), np.tile(np.arange(people), frames)
    here = position.reshape(-1, 2)
    path = np.repeat(here[:, None], STEPS, axis=1)
    variance = noise_m**2 * np.arange(1, STEPS + 1)
    weight = np.tile([0.7, 0.3], (len(here), 1))
    both = np.repeat(path[:, None], 2, axis=1)
    covariance = np.broadcast_to(variance[:, None, None] * np.eye(2), (len(here), 2, STEPS, 2, 2))
    return time_s, track_id, here, Predictions(path, both, weight, DT_S, covariance.copy())


def scaled(predictions, deviation):
    return replace(predictions, covariance=predictions.covariance * deviation**2)


def shares_inside(predictions, here, people, frames):
    """Shares of the regions that hold the truth, over the second half: [region, step]."""
    rows = np.arange(len(here) // 2, len(here) - STEPS * people)
    truth = np.stack([here[rows + people * (p + 1)] for p in range(STEPS)], axis=1)
    inside = share_inside(predictions.select(rows), truth)
    return np.array([coverage(inside, share) for share in REGIONS])


@pytest.mark.parametrize("deviation", [0.4, 2.0])
def test_regions_become_right_whatever_they_were(deviation):
    time_s, track_id, here, right = walks(np.random.default_rng(0))
    given_ = scaled(right, deviation)
    after = learned(given_, track_id, time_s, here, np.ones(len(here), bool))
    found = shares_inside(after, here, 20, 400)
    np.testing.assert_allclose(found, np.array(REGIONS)[:, None] * np.ones(STEPS), atol=0.06)
    np.testing.assert_array_equal(after.path, given_.path)
    np.testing.assert_array_equal(after.weight, given_.weight)
    np.testing.assert_array_equal(after.point, given_.point)


@pytest.mark.parametrize("deviations", [(0.5, 2.0), (2.0, 0.5)])
def test_regions_follow_a_change(deviations):
    time_s, track_id, here, right = walks(np.random.default_rng(1), frames=300)
    before, after = (scaled(right, deviation) for deviation in deviations)
    rows = np.arange(len(here))
    given_ = Predictions.join([before.select(rows[:3000]), after.select(rows[3000:])])
    found = shares_inside(learned(given_, track_id, time_s, here, rows >= 0), here, 20, 300)
    np.testing.assert_allclose(found, np.array(REGIONS)[:, None] * np.ones(STEPS), atol=0.1)


@settings(max_examples=5, deadline=None)
@given(seed=SEEDS, cut=st.integers(5, 60))
def test_nothing_is_learned_from_the_future(seed, cut):
    rng = np.random.default_rng(seed)
    time_s, track_id, here, predictions = walks(rng, frames=80)
    first = slice(0, cut * 20)
    known = np.ones(len(here), bool)
    whole = learned(predictions, track_id, time_s, here, known)
    part = learned(
        predictions.select(np.arange(cut * 20)), track_id[first], time_s[first], here[first], known[first]
    )
    np.testing.assert_array_equal(part.covariance, whole.covariance[first])


def test_what_is_kept_does_not_grow():
    time_s, track_id, here, predictions = walks(np.random.default_rng(5), frames=300, people=30)
    place, sizes = place_of(Regions.initial(STEPS)), []
    for frame in range(300):
        rows = np.arange(frame * 30, (frame + 1) * 30)
        own = predictions.select(rows)
        place, _ = at_instant(place, time_s[rows[0]], track_id[rows] + frame, here[rows], rows >= 0, own)
        regions = place.regions
        sizes.append((len(regions.pending), len(regions.adjustment.step), len(place.detections.time_s)))
    assert (np.max(sizes, axis=0) == np.max(sizes[:50], axis=0)).all()
    assert np.max(sizes) < 50 * 30


def noisy(seed, every_s, noise_m, frames, people=20):
    """People who walk straight, their noisy detections, and forecasts that are as wrong as detections."""
    rng = np.random.default_rng(seed)
    time_s, track_id = np.repeat(np.arange(frames) * every_s, people), np.tile(np.arange(people), frames)
    here = np.stack([time_s, track_id.astype(float)], axis=1)
    truth = here[:, None] + np.array([DT_S, 0.0]) * np.arange(1, STEPS + 1)[:, None]
    point = truth + rng.normal(0, noise_m, truth.shape)
    covariance = np.broadcast_to(noise_m**2 * np.eye(2), (len(here), 1, STEPS, 2, 2))
    right = Predictions(point, point[:, None], np.ones((len(here), 1)), DT_S, covariance.copy())
    return time_s, track_id, here + rng.normal(0, noise_m, here.shape), truth, right


def test_regions_hold_standing_people_where_noise_is_declared():
    """The shipped network: its modes lie about as far apart as the tracker errs."""
    rng, robot = np.random.default_rng(5), OnlinePredictor.load(None, OnlineSettings(detection_noise_m=0.05))
    place = np.stack(np.meshgrid(4.0 * np.arange(4), 4.0 * np.arange(2)), axis=-1).reshape(-1, 2)
    truth, inside = np.repeat(place[:, None], STEPS, axis=1), []
    for k in range(450):
        forecast = robot.update(0.1 * k, np.arange(8), place + rng.normal(0.0, 0.05, (8, 2)))
        if k >= 300 and not k % 5:
            inside.append(share_inside(forecast.predictions, truth))
    held = (np.concatenate(inside) <= 0.9).mean(axis=0)
    assert (held > 0.8).all()
