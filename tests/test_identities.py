"""Identify people in a stream of messages: by ids where these stay with people, else by position."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from pedpred.ros import assignment
from pedpred.ros.assignment import NearestTracks
from pedpred.ros.identities import Identities, TrackNumbers, are_identities
from tests.refused import refused


def numbers_of(identities, messages):
    """Numbers of the people in messages of (ids, positions), 0.1 s apart."""
    return [
        identities.number(100.0 + 0.1 * k, ids, np.reshape(places, (-1, 2)).astype(float)).tolist()
        for k, (ids, places) in enumerate(messages)
    ]


def crossing(count=40, name=lambda k, person: f"{person + 3}"):
    """Messages with two people whose ways cross, in either order, and these orders."""
    orders = [[0, 1] if k % 2 else [1, 0] for k in range(count)]
    messages = []
    for k, order in enumerate(orders):
        places = [(0.13 * k - 2.0, 0.0), (0.0, 0.11 * k - 3.0)]
        messages.append(([name(k, person) for person in order], [places[person] for person in order]))
    return messages, orders


def recorded(messages, **more):
    """The numbers in a recording."""
    return numbers_of(Identities(recording=[ids for ids, _ in messages], **more), messages)


@given(st.lists(st.text(max_size=3) | st.integers(-(2**70), 2**70).map(str) | st.just("007"), unique=True))
def test_different_names_have_different_numbers(names):
    tracks = TrackNumbers()
    once, again = (tracks.numbers(0.0, names).tolist() for _ in "ab")
    assert once == again
    assert len(set(once)) == len(names)


def test_whole_numbers_stay_and_other_names_get_some():
    names = ["7", "anna", "12", "007", "anna"]
    assert TrackNumbers().numbers(0.0, names).tolist() == [7, -1, 12, -2, -1]


def test_names_that_are_not_used_any_more_are_forgotten():
    """A stream that goes on for ever names ever more people."""
    identities = Identities(kept_s=2.0)
    numbers = numbers_of(identities, [([f"anna{k // 30}"], [(0.0, 0.0)]) for k in range(90)])
    assert numbers[-1] == [-3]
    assert identities.names == {-3: "anna2"}


@pytest.mark.parametrize("mode", ["auto", "given"])
def test_ids_that_stay_are_the_numbers(mode):
    messages, orders = crossing()
    expected = [[person + 3 for person in order] for order in orders]
    assert numbers_of(Identities(mode), messages) == recorded(messages, mode=mode) == expected


NO_IDENTITIES = {
    "none": lambda k, person: "NaN" if person else "-1",
    "shared": lambda k, person: "7",
    "new": lambda k, person: f"{2 * k + person}",
}


@pytest.mark.parametrize("kind", NO_IDENTITIES)
def test_people_without_identities_are_assigned(kind):
    """Live from the tenth message on: before, ids that are new could be those of new people."""
    messages, orders = crossing(name=NO_IDENTITIES[kind])
    expected = [[{0: 2, 1: 1}[person] for person in order] for order in orders]
    assert recorded(messages) == numbers_of(Identities("assigned"), messages) == expected
    assert numbers_of(Identities(has_ids=False), messages) == expected
    live = numbers_of(Identities(), messages)[9:]
    for person in (0, 1):
        assert len({row[order.index(person)] for row, order in zip(live, orders[9:], strict=True)}) == 1


def test_given_ids_must_be_there_and_differ():
    for ids in (["1", ""], ["1", "1"]):
        with refused("id"):
            Identities("given").number(0.0, ids, np.zeros((2, 2)))
    with refused("identities"):
        Identities("sometimes")


@pytest.mark.parametrize("is_live", [True, False])
def test_people_without_an_id_among_others_are_assigned(is_live):
    messages = [(["5", "", ""], [(0.1 * k, 0.0), (8.0, 0.1 * k), (-8.0, 0.1 * k)]) for k in range(20)]
    identities = Identities(recording=None if is_live else [ids for ids, _ in messages])
    assert numbers_of(identities, messages) == [[5, -1, -2]] * 20
    assert identities.names == {-1: "#1", -2: "#2"}
    assert (identities.name(5), identities.unnamed) == ("5", 40)


def test_ids_that_come_and_go_name_nobody_else():
    """Numbers of people who are identified by position are not those of ids, which count again later."""
    messages, orders = crossing(80, lambda k, person: "" if k // 20 % 2 else f"{2 - person}")
    numbers = numbers_of(Identities(), messages)
    persons = [set(), set()]
    for row, order in zip(numbers, orders, strict=True):
        for number, person in zip(row, order, strict=True):
            persons[person].add(number)
    assert not persons[0] & persons[1]
    assert {*numbers[59]} == {1, 2}


def test_a_crowd_that_is_named_anew_keeps_its_new_ids():
    """In one message all ids are new, not in one after the other."""
    messages = [
        ([str(n + 1000 * (k >= 15)) for n in range(50)], [(n % 10 + 0.1 * k, n // 10) for n in range(50)])
        for k in range(30)
    ]
    assert numbers_of(Identities(), messages)[-1] == [n + 1000 for n in range(50)]


def test_few_messages_do_not_show_that_ids_change():
    assert are_identities([["1"], ["2"]])
    assert are_identities([["1", "2"]] * 9 + [[""]])
    assert not are_identities([[""], [], []])


# By position


@given(st.integers(0, 2**32 - 1), st.integers(1, 40), st.floats(2.0, 30.0))
@settings(max_examples=30)
def test_the_nearest_are_those_of_the_whole_assignment(seed, count, side_m):
    """Leaving out people without a near detection changes no pair."""
    rng = np.random.default_rng(seed)
    before, after = rng.uniform(0, side_m, (count, 2)), rng.uniform(0, side_m, (count, 2))
    tracks = NearestTracks()
    tracks.assign(0.0, before)
    found = tracks.assign(0.1, after)
    apart, gate = cdist(before, after), assignment._GATE_M + 0.1 * assignment._GATE_MPS
    far = 2 * assignment._LARGEST_GATE_M
    costs = np.where(apart <= gate, apart, far)
    kept = found <= count
    total = costs[found[kept] - 1, np.flatnonzero(kept)].sum() + (~kept).sum() * far
    assert total == pytest.approx(costs[linear_sum_assignment(costs)].sum())


def test_detections_that_are_noise_do_not_fill_the_memory():
    rng, tracks = np.random.default_rng(0), NearestTracks()
    for k in range(15):
        tracks.assign(k / 1000, rng.uniform(-1e4, 1e4, (300, 2)))
        assert len(tracks._tracks) <= assignment._MOST_TRACKS + 300
