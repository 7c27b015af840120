"""Laws of forecasts: of any network without memory, and of the one that this repository ships."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pedpred.online import OnlinePredictor, OnlineSettings
from tests.conftest import ROOT
from tools import law_worlds, laws
from tools.law_worlds import RATES_HZ

SHIPPED = ROOT / "models/online/default"
SEEDS = st.integers(0, 2**32 - 1)


@pytest.mark.parametrize("gap", laws.GAPS.values(), ids=laws.GAPS)
@pytest.mark.parametrize("network", ["untrained", "shipped"])
@settings(max_examples=5, deadline=None)
@given(seed=SEEDS)
def test_forecasts_obey_the_laws_whatever_was_learned(mixture, network, gap, seed):
    law, most = gap
    assert law(mixture[0] if network == "untrained" else SHIPPED, np.random.default_rng(seed)) <= most


@settings(max_examples=10, deadline=None, derandomize=True)
@given(seed=SEEDS, rate_hz=st.sampled_from(RATES_HZ))
def test_straight_walkers_go_on(seed, rate_hz):
    """Alone on free ground, from one second after birth on; slow ones exactly so once 2.5 s are known."""
    walked = laws.straight_shares(SHIPPED, np.random.default_rng(seed), rate_hz, seconds=15.0, people=8)
    low, high = laws.STRAIGHT
    known = (walked["age_s"] >= 2.5) | (walked["speed_mps"] >= 0.6)
    assert low <= walked["share"][known].min()
    assert walked["share"].min() >= 0.85
    assert walked["share"].max() <= high


def test_straight_walkers_go_on_for_minutes():
    walked = laws.straight_shares(SHIPPED, np.random.default_rng(0), 2.0, seconds=120.0, people=4)
    shares = walked["share"][walked["age_s"] >= 2.5]
    assert laws.STRAIGHT[0] <= shares.min() <= shares.max() <= laws.STRAIGHT[1]


def test_runners_go_on_as_walkers_do(monkeypatch):
    monkeypatch.setattr(law_worlds, "SPEEDS_MPS", (2.5, 5.0))
    walked = laws.straight_shares(SHIPPED, np.random.default_rng(0), 2.5, seconds=15.0, people=8)
    assert laws.STRAIGHT[0] <= walked["share"].min() <= walked["share"].max() <= laws.STRAIGHT[1]


@settings(max_examples=10, deadline=None, derandomize=True)
@given(seed=SEEDS, rate_hz=st.sampled_from(RATES_HZ), noise_m=st.sampled_from([0.0, 0.005, 0.02]))
def test_people_stand_also_when_they_have_just_appeared(seed, rate_hz, noise_m):
    newborn, later = laws.standing_errors_m(SHIPPED, np.random.default_rng(seed), rate_hz, noise_m)
    assert max(newborn.max(), later.max()) <= laws.STANDING_M


def test_a_gap_is_found(model):
    """A recurrent network with large weights: its crops turn by half cells, and its map is a grid."""
    gaps = [laws.turned_gap_m(model[0], np.random.default_rng(k)) for k in range(3)]
    assert max(gaps) > 0.0
    shares = laws.straight_shares(model[0], np.random.default_rng(0), 2.0, people=2)["share"]
    assert not (laws.STRAIGHT[0] < shares.min() and shares.max() < laws.STRAIGHT[1])
    newborn, later = laws.standing_errors_m(model[0], np.random.default_rng(0), 2.0, 0.02)
    assert max(newborn.max(), later.max()) > laws.STANDING_M


def test_somebody_who_never_moved_is_forecast_to_stand(mixture):
    robot = OnlinePredictor.load(mixture[0])
    for k in range(9):
        forecast = robot.update(0.2 * k, [3, 5], [[1.0, 2.0], [1.5 + 0.1 * k, 2.0]])
        np.testing.assert_allclose(forecast.predictions.path[0], np.full((4, 10, 2), [1.0, 2.0]), atol=1e-6)


@pytest.mark.parametrize("age", [4, 100])
def test_an_old_track_is_forecast_as_a_young_one(mixture, age):
    """Somebody who walks straight, first seen some time ago; or better, after what it has shown meanwhile."""
    alone = OnlineSettings(learn_trust=False, learn_local_errors=False)
    truth = np.stack([0.375 * np.arange(1, 11), np.zeros(10)], axis=1)
    for learns, how in ((False, alone), (True, OnlineSettings())):
        robot = OnlinePredictor.load(mixture[0], how)
        for k in range(age + 20):
            forecast = robot.update(0.4 * k, np.array([7]), np.array([[0.5 * k, 0.0]]))
            if k == 23:
                young = forecast.position[0] - [0.5 * k, 0.0]
        old = forecast.position[0] - [0.5 * k, 0.0]
        if not learns:
            np.testing.assert_allclose(old, young, atol=5e-3)
        assert (np.linalg.norm(old - truth, axis=1) <= np.linalg.norm(young - truth, axis=1) + 5e-3).all()
