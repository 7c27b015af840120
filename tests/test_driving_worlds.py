"""Laws of simulated worlds to drive in: whom the robot changes, who sees it, and when nothing differs."""

from dataclasses import replace

import numpy as np
import pytest

from pedpred.driving.episodes import DriveSettings
from pedpred.driving.forecasters import NAMES, forecaster_of
from pedpred.driving.loop import ROBOT, drive
from pedpred.driving.places import KINDS, Worlds, draw_world
from pedpred.online import OnlinePredictor
from tests.conftest import ROOT

FAR = (-500.0, -500.0, 0.0, 0.0, 0.0)
FIRST_S = 20.1  # of the recording, from the beginning of the warm-up
KEY = [0, 1, 0, 0]


@pytest.fixture(scope="module")
def predictor():
    return OnlinePredictor.load()


@pytest.fixture(scope="module")
def corridor():
    return Worlds("corridor", react=True).draw(0, DriveSettings())


@pytest.mark.parametrize("kind", KINDS)
def test_people_far_from_the_robot_walk_as_if_it_were_not_there(kind):
    scene, walkers = draw_world(kind, KEY, 0.3, 0.1)
    walkers.advance(round(FIRST_S / 0.1))
    walkers.meet(FAR, np.zeros(2))
    people = scene.trajectories
    for tick in range(100):
        rows = np.isclose(people.time_s, 0.1 * tick)
        there = walkers.position[people.track_id[rows]]
        np.testing.assert_array_equal(there, people.position[rows])
        assert np.isfinite(walkers.position[:, 0]).sum() == rows.sum()
        walkers.advance()


def test_people_go_around_a_robot_that_stands_in_their_way():
    """Nobody whom it could hit walks through it, while people who ignore it do."""
    nearest = {True: np.inf, False: np.inf}
    for number in range(4):
        for react in (True, False):
            _, episode = Worlds("corridor", react).draw(number, DriveSettings())
            crowd = episode.crowd()
            first = crowd.position[np.isfinite(crowd.position[:, 0])]
            where = first[0] + 2.5 * np.array([1.0, 0.0])
            for _ in range(100):
                crowd.meet((*where, 0.0, 0.0, 0.0), np.zeros(2))
                crowd.advance()
                gap = np.hypot(*(crowd.position - where).T)
                nearest[react] = min(nearest[react], np.nanmin(gap, initial=np.inf))
    assert nearest[True] > nearest[False]


def test_the_future_is_what_happens_if_the_robot_goes_on(corridor):
    _, episode = corridor
    crowd = episode.crowd()
    state, velocity = (*episode.start, 0.0, 0.0, 0.0), np.array([0.3, 0.1])
    crowd.meet(state, velocity)
    ahead = crowd.ahead(10)
    for tick in range(11):
        np.testing.assert_array_equal(crowd.position, ahead[tick])
        crowd.advance()


def test_the_same_seed_gives_the_same_drive_in_any_order(predictor, corridor):
    _, episode = corridor
    again = Worlds("corridor", react=True).draw(0, DriveSettings())
    states = []
    for where, what in (corridor, again, corridor):
        crowd = what.crowd()
        forecaster = forecaster_of("kalman", predictor, where.occupancy, crowd)
        states.append(drive(what, crowd, forecaster, where.occupancy, DriveSettings()).state)
    assert np.array_equal(states[0], states[1])
    assert np.array_equal(states[0], states[2])
    other = Worlds("corridor", react=False).draw(0, DriveSettings())[1]
    assert np.array_equal(other.start, episode.start)


@pytest.mark.parametrize("method", NAMES)
def test_a_robot_that_is_shown_is_none_of_the_forecast_people(predictor, corridor, method):
    place, episode = corridor
    short = replace(episode, ticks=episode.watching + 2)
    crowd = short.crowd()
    forecaster = forecaster_of(method, predictor, place.occupancy, crowd)
    done = drive(short, crowd, forecaster, place.occupancy, DriveSettings(shown=True), keep=True)
    assert all(ROBOT not in one.track_id for one in done.forecasts)
    assert max(len(one) for one in done.forecasts) > 0


def test_people_who_react_walk_to_goals_of_their_world(corridor):
    """Each goal ends a leg of the journey: nobody turns to the next one or leaves before it is reached."""
    _, episode = corridor
    crowd = episode.crowd()
    away_m: dict[tuple[int, int], float] = {}
    ended: dict[tuple[int, int], float] = {}
    for _ in range(300):
        there = np.flatnonzero(np.isfinite(crowd.position[:, 0]))
        now = {
            (person, goal): float(np.hypot(*(crowd.position[person] - crowd.goals[goal])))
            for person, goal in zip(there.tolist(), crowd.goal[there].tolist(), strict=True)
        }
        ended |= {leg: away_m[leg] for leg in away_m.keys() - now.keys()}
        away_m = now
        crowd.advance()
    assert len(ended) >= 5
    assert max(ended.values()) <= 1.5


def test_the_planning_example_of_the_page_brakes_for_who_crosses():
    pieces = (ROOT / "docs/robot.md").read_text().split("```python\n")[1:]
    (code,) = (piece.partition("```")[0] for piece in pieces if "def risk" in piece)
    names = {}
    exec(code, names)
    risks = {speed: names["risk"](way) for speed, way in names["ways"].items()}
    assert all(0.0 <= found <= 1.0 for found in risks.values())
    assert risks[1.2] > 0.1
    assert names["speed"] < 1.2
