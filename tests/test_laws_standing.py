"""People who never moved have no heading: forecasts of them do not depend on the world's axes."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from pedpred.geometry import rotate
from pedpred.online import OnlinePredictor
from pedpred.scenes import OccupancyMap

FRAMES, STANDING, WALKING = 6, 3, 2


def people(rng):
    """Some stand exactly still, others walk. [FRAMES, STANDING + WALKING, 2]."""
    velocity = np.concatenate([np.zeros((STANDING, 2)), rng.normal(0, 0.4, (WALKING, 2))])
    return rng.normal(0, 2, (STANDING + WALKING, 2)) + np.arange(FRAMES)[:, None, None] * velocity


def last_forecast(folder, paths, occupancy):
    """After frames 0.4 s apart."""
    robot = OnlinePredictor.load(folder)
    robot.set_map(occupancy)
    for k, positions in enumerate(paths):
        forecast = robot.update(0.4 * k, np.arange(len(positions)), positions)
    return forecast


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000), quarters=st.integers(1, 3), frames=st.integers(1, FRAMES))
def test_forecasts_of_standing_people_turn_with_the_world(mixture, seed, quarters, frames):
    """With neighbours and walls, from the first detection on, at coordinates far from the origin."""
    rng = np.random.default_rng(seed)
    paths, blocks = people(rng)[:frames], rng.random((80, 80)) < 0.03
    one = last_forecast(mixture[0], paths, occupancy=OccupancyMap(blocks, np.full(2, -4.0), 0.1))
    turn, shift = quarters * np.pi / 2, np.array([4e5, 5e6])
    turned = rotate(paths, np.full(paths.shape[:2], turn)) + shift
    occupancy = OccupancyMap(np.rot90(blocks, quarters), np.full(2, -4.0) + shift, 0.1)
    other = last_forecast(mixture[0], turned, occupancy=occupancy)
    angle = np.full(one.predictions.path.shape[:-1], turn)
    np.testing.assert_allclose(other.predictions.path - shift, rotate(one.predictions.path, angle), atol=1e-3)
    spread = (f.predictions.covariance[:STANDING] for f in (one, other))
    before, after = spread
    np.testing.assert_allclose(after, before, atol=1e-4)  # the same in every direction


def test_somebody_who_never_moved_is_forecast_to_stand(mixture):
    robot = OnlinePredictor.load(mixture[0])
    for k in range(9):
        forecast = robot.update(0.2 * k, [3, 5], [[1.0, 2.0], [1.5 + 0.1 * k, 2.0]])
        np.testing.assert_allclose(forecast.predictions.path[0], np.full((4, 10, 2), [1.0, 2.0]), atol=1e-6)
