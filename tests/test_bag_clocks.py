"""Stamps that go back or jump, and ids that do not say who is who."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pedpred.errors import InputError, ValueRuleError
from pedpred.ros import read_bag
from pedpred.ros.clocks import find_false, find_passes, in_a_row
from pedpred.ros.identity import check_identity
from tests.bags import TF, bag, moving_messages, transform, write_timed
from tests.robots import from_robot, robot

POSES = "geometry_msgs/msg/PoseArray"


def walk(start_s, count=40, first_m=0.0):
    return [(start_s + k / 10, {"3": (first_m + k / 10, 1.0), "8": (9.0, k / 10)}) for k in range(count)]


def test_a_recording_that_was_played_twice_has_twice_as_many_people(ros2, tmp_path, caplog):
    """The second time later and with other ids, in their own order, and nobody in between."""
    path = bag(ros2, tmp_path / "hall", *walk(100.0), *walk(100.0, 20, first_m=5.0))
    people = read_bag(path).trajectories
    assert "time goes back 1 times, first to 100.0 s" in caplog.text
    assert len(people) == 2 * 40 + 2 * 20
    tracks = [people.track_id == track for track in np.unique(people.track_id)]
    assert sorted(map(np.sum, tracks)) == [20, 20, 40, 40]
    for own in tracks:
        assert np.allclose(np.linalg.norm(np.diff(people.position[own], axis=0), axis=1), 0.1)
        assert np.allclose(np.diff(people.time_s[own]), 0.1, atol=1e-6)
    assert (people.track_id[people.time_s < 104] > 0).all()
    assert (people.track_id[people.time_s > 104] < 0).all()


def test_messages_that_come_late_are_sorted(ros2, tmp_path):
    steps = walk(100.0)
    steps[5], steps[6], steps[20], steps[28] = steps[6], steps[5], steps[28], steps[20]
    people = read_bag(bag(ros2, tmp_path / "hall", *steps)).trajectories
    np.testing.assert_allclose(people.position[people.track_id == 3, 0], np.arange(40) / 10)


def test_a_false_stamp_costs_its_message_alone(ros2, tmp_path, caplog):
    steps = walk(100.0)
    steps[7], steps[20] = (1.0, steps[7][1]), (900.0, steps[20][1])
    people = read_bag(bag(ros2, tmp_path / "hall", *steps)).trajectories
    assert np.unique(people.track_id).tolist() == [3, 8]
    assert len(people) == 2 * 38
    assert "2 of 40 messages, whose stamps jump away and back, the first at 1.0 s" in caplog.text


@pytest.mark.parametrize("rows", [[0, 1, 2], [5, 11, 12], range(18)])
def test_messages_without_a_stamp_are_left_out(rows, ros2, tmp_path, caplog):
    steps = walk(100.0)
    for row in rows:
        steps[row] = 0.0, steps[row][1]
    people = read_bag(bag(ros2, tmp_path / "hall", *steps)).trajectories
    assert len(people) == 2 * (40 - len(rows))
    assert people.time_s.min() >= 100
    assert f"{len(rows)} of 40 messages, which have no stamp" in caplog.text


@pytest.mark.parametrize(
    ("stamp_s", "lack"),
    [(0.0, "all stamps are zero"), (77.0, "most stamps are those of the message before")],
)
def test_where_stamps_stand_still_the_bags_own_times_count(stamp_s, lack, ros2, tmp_path, caplog):
    """A node that never sets the stamp, or that sets it once."""
    steps = [(stamp_s, people) for _, people in walk(100.0)]
    people = read_bag(bag(ros2, tmp_path / "hall", *steps)).trajectories
    np.testing.assert_allclose(np.unique(people.time_s), np.arange(1, 41) / 1e9)
    assert f"{lack}, so times are those at which the bag was written" in caplog.text


def test_two_clocks_on_one_topic_are_refused(ros2, tmp_path):
    both = [one for pair in zip(walk(100.0), walk(5000.0), strict=True) for one in pair]
    with pytest.raises(InputError, match=r"times back in 80 messages.*different clocks"):
        read_bag(bag(ros2, tmp_path / "hall", *both))


def test_transforms_of_the_first_time_do_not_move_people_of_the_second(ros2, tmp_path):
    """A simulation that was reset: the same stamps, and the robot stands still."""
    first = moving_messages(ros2, localised=False)
    again = [
        (time_s + 10, topic, kind, m) for time_s, topic, kind, m in moving_messages(ros2, tf_s=np.zeros(0))
    ]
    still = from_robot(np.zeros(3), 0.0)
    for k, (time_s, *_, message) in enumerate(again):
        for person, x in zip(message.people, (1.0, 2.0), strict=True):
            person.position.x, person.position.y = x + still[0], 0.0
        pose = transform(ros2, "odom", "base_link", robot(np.float64(0.0)), time_s - 10)
        again[k] = again[k], (time_s, "/tf", TF, pose)
    found = [*first, *(one for pair in again for one in pair)]
    people = read_bag(write_timed(ros2, tmp_path / "hall", found)).trajectories
    later = people.track_id < 0
    assert later.sum() == 100
    assert np.ptp(people.position[later & (people.track_id == -1)], axis=0).max() < 1e-9


@pytest.mark.parametrize("moved_s", [0.0, 0.03])
def test_a_loop_shorter_than_a_gap_mixes_nobody(moved_s, ros2, tmp_path, caplog):
    """Stretches of 1.5 s, whose stamps are the same or lie between those before."""
    loops = [walk(100.0 + moved_s * loop, 15, first_m=5.0 * loop) for loop in range(4)]
    people = read_bag(bag(ros2, tmp_path / "hall", *(one for loop in loops for one in loop))).trajectories
    assert "time goes back 3 times" in caplog.text
    assert len(people) == 4 * 2 * 15
    for track in np.unique(people.track_id):
        own = people.position[people.track_id == track]
        assert np.allclose(np.linalg.norm(np.diff(own, axis=0), axis=1), 0.1)


@settings(max_examples=80, deadline=None)
@given(st.integers(5, 40), st.floats(0.02, 0.5), st.integers(1, 20), st.integers(0, 2**32))
def test_short_loops_are_told_from_late_messages(count, step_s, loops, seed):
    rng = np.random.default_rng(seed)
    one = step_s * np.arange(count)
    looped = np.concatenate([one + 0.9 * step_s * rng.random() for _ in range(loops)])
    np.testing.assert_array_equal(find_passes(looped), np.repeat(np.arange(loops), count))
    late = step_s * np.arange(4 * count)
    block = rng.integers(1, min(count, int(1.9 / step_s)) + 1)
    start = rng.integers(0, len(late) - block)
    assert not find_passes(late[rolled(len(late), start, block, -1)]).any()
    assert not find_passes(late[rolled(len(late), start, block, 1)]).any()


def rolled(count, start, block, way):
    """Rows, of which the first one of a block comes last, or the last one first."""
    rows = np.arange(count)
    rows[start : start + block] = np.roll(rows[start : start + block], way)
    return rows


@settings(max_examples=50, deadline=None)
@given(
    st.lists(st.integers(20, 60), min_size=1, max_size=4),
    st.floats(0, 1e6),
    st.floats(0.01, 0.5),
)
def test_passes_follow_each_other_and_keep_their_own_times(counts, start_s, step_s):
    stamp_s = np.concatenate([start_s + step_s * np.arange(int(3 / step_s) + count) for count in counts])
    assert not find_false(stamp_s).any()
    passes = find_passes(stamp_s)
    time_s = in_a_row(stamp_s, passes)
    assert passes.max() == len(counts) - 1
    assert (np.diff(time_s) > 0).all()
    for number in range(len(counts)):
        own = passes == number
        np.testing.assert_allclose(np.diff(time_s[own]), np.diff(stamp_s[own]), atol=1e-6)
    np.testing.assert_array_equal(time_s[passes == 0], stamp_s[passes == 0])


# Who is who


def poses(store, path, *counts):
    """Some people abreast who walk along x; of fewer the first ones are gone."""
    found, kind = [], POSES
    for k, there in enumerate(counts):
        header = store.header(k / 10, "map")
        here = [store.pose(k / 10, 1.5 * who) for who in there]
        found.append(("/poses", kind, store.make(kind, header=header, poses=here)))
    store.write(path, found)
    return path


def test_places_in_a_list_are_ids_as_long_as_nobody_leaves(ros2, tmp_path):
    everybody = [range(4)] * 20
    assert len(read_bag(poses(ros2, tmp_path / "all", *everybody)).trajectories) == 80
    more = [
        *everybody,
        *[range(5)] * 5,
        *[range(3)] * 5,
    ]  # who comes is the last one, and the last ones leave
    assert len(read_bag(poses(ros2, tmp_path / "more", *more)).trajectories) == 80 + 25 + 15
    with pytest.raises(InputError, match=r"4 people, then 3 at 2 s.*places in a list.*topic of a tracker"):
        read_bag(poses(ros2, tmp_path / "gone", *everybody, *[range(1, 4)] * 5))


@pytest.mark.parametrize("first", [0, 1])
def test_names_that_count_a_list_are_no_better(first, ros2, tmp_path):
    steps = [(k / 10, {str(n + first): (k / 10, 2.0 * n) for n in range(3)}) for k in range(10)]
    steps += [(k / 10, {str(n + first): (k / 10, 2.0 * n + 2.0) for n in range(2)}) for k in range(10, 20)]
    with pytest.raises(InputError, match="places in a list"):
        read_bag(bag(ros2, tmp_path / "hall", *steps))


@pytest.mark.parametrize(
    ("ids_at", "message"),
    [
        (lambda k: ["", ""], "id = ''.*who is who"),
        (lambda k: ["0", "0"], "people must have different ones"),
        (lambda k: ["a", "a", "b"], "different"),
        (lambda k: [f"{k}-0", f"{k}-1"], "20 ids in 10 messages.*nobody is followed"),
    ],
    ids=["none", "the same", "some the same", "others in every message"],
)
def test_ids_that_say_nothing_are_refused(ids_at, message, ros2, tmp_path):
    steps = [(k / 10, [(name, (k / 10, 3.0 * n)) for n, name in enumerate(ids_at(k))]) for k in range(10)]
    with pytest.raises(InputError, match=rf"{message}.*topic of a tracker"):
        read_bag(bag(ros2, tmp_path / "hall", *steps))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32), st.integers(2, 6), st.floats(0.05, 0.4))
def test_ids_of_a_tracker_are_never_taken_for_places_in_a_list(seed, people, step_s):
    """Also if they begin at 0 or 1, people come and go, and others stand 0.6 m apart."""
    rng = np.random.default_rng(seed)
    start, velocity = (
        0.6 * rng.permutation(people)[:, None] * [[0.0, 1.0]],
        rng.uniform(-1.5, 1.5, (people, 2)),
    )
    there = np.arange(people)
    ids, time_s, places = [], step_s * np.arange(30), []
    for k, now in enumerate(time_s):
        there = np.setdiff1d(there, rng.integers(0, people, 1)) if k % 10 == 9 else there
        ids.append([str(who) for who in there])
        places.append(start[there] + now * velocity[there] + rng.normal(0, 0.02, (len(there), 2)))
    check_identity(ids, time_s, places)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_list_in_order_of_place_is_noticed_when_people_pass_each_other(axis, ros2, tmp_path):
    found = []
    for k in range(40):
        here = sorted([(k / 8, 0.0), (5 - k / 8, 1.2)], key=lambda place: place[0])
        here = [place if axis == 0 else place[::-1] for place in here]
        poses = [ros2.pose(*place) for place in here]
        found.append(("/poses", POSES, ros2.make(POSES, header=ros2.header(k / 10, "map"), poses=poses)))
    ros2.write(tmp_path / "hall", found)
    with pytest.raises(InputError, match="places in a list"):
        read_bag(tmp_path / "hall")


def test_who_has_no_id_is_left_out(ros2, tmp_path, caplog):
    steps = [(k / 10, [("3", (k / 10, 0.0)), ("" if k % 4 else "5", (0.0, k / 10))]) for k in range(20)]
    people = read_bag(bag(ros2, tmp_path / "hall", *steps)).trajectories
    assert np.unique(people.track_id, return_counts=True)[1].tolist() == [20, 5]
    assert "left out: 15 of 40 detections, which have no id" in caplog.text


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32), st.integers(3, 8), st.floats(0.05, 0.4))
def test_whoever_leaves_a_list_is_noticed(seed, people, step_s):
    """People at least 1 m apart; anybody but the last one leaves."""
    rng = np.random.default_rng(seed)
    start, leaves = rng.permutation(people)[:, None] * [[0.0, 1.2]], rng.integers(0, people - 1)
    velocity = np.array([1.2, 0.0]) + rng.uniform(-0.2, 0.2, (people, 2))
    places, stay = [], np.delete(np.arange(people), leaves)
    for k in range(20):
        there = np.arange(people) if k < 10 else stay
        places.append(start[there] + k * step_s * velocity[there])
    ids = [[str(n) for n in range(len(each))] for each in places]
    with pytest.raises(ValueRuleError, match="places in a list"):
        check_identity(ids, step_s * np.arange(20), places)


# Ids that are dealt out anew


def crowd(count, rate_hz, steps, spacing_m=1.2):
    """People who walk in all directions. [steps, count, 2]"""
    rng = np.random.default_rng(count)
    heading_rad = rng.uniform(-np.pi, np.pi, count)
    velocity = rng.uniform(0.7, 1.6, (count, 1)) * np.stack([np.cos(heading_rad), np.sin(heading_rad)], -1)
    start = rng.uniform(0, spacing_m * np.sqrt(count), (count, 2))
    noise = rng.normal(0, 0.02, (steps, count, 2))
    return start + np.arange(steps)[:, None, None] / rate_hz * velocity + noise


@pytest.mark.parametrize("name", ["person_{}", "{}"])
@pytest.mark.parametrize("count", [3, 12])
@pytest.mark.parametrize("rate_hz", [2.5, 10, 30])
def test_ids_that_are_dealt_out_anew_are_refused(name, count, rate_hz, ros2, tmp_path):
    """Whatever they are called, and where their numbers begin."""
    rng, steps, places = np.random.default_rng(0), [], crowd(count, rate_hz, 40, 2.5)
    for k, place in enumerate(places):
        dealt = rng.permutation(count)
        here = {name.format(5 + n): tuple(place[one].tolist()) for n, one in enumerate(dealt)}
        steps.append((100.0 + k / rate_hz, here))
    with pytest.raises(InputError, match=r"hall: /people: id = .* steps lead to where another one was.*list"):
        read_bag(bag(ros2, tmp_path / "hall", *steps))


@pytest.mark.parametrize("shares", [(1, 1), (1, 2)])
@pytest.mark.parametrize("rate_hz", [2.5, 10, 30])
def test_ids_of_two_trackers_that_are_the_same_are_refused(rate_hz, shares, ros2, tmp_path):
    """Each person of one is somebody of the other in its next message, and nobody is where others were."""
    places, period = crowd(8, rate_hz, 60), sum(shares)
    steps = [
        (100.0 + k / rate_hz, {f"p{n}": tuple(place[n + 4 * (k % period < shares[0])]) for n in range(4)})
        for k, place in enumerate(places.tolist())
    ]
    with pytest.raises(InputError, match=r"steps lead to where another one was.*two trackers"):
        read_bag(bag(ros2, tmp_path / "hall", *steps))


@pytest.mark.parametrize("rate_hz", [2.5, 10, 30])
@pytest.mark.parametrize("odd", ["nobody", "one jumps", "swaps"])
def test_ids_of_a_tracker_are_read(rate_hz, odd, ros2, tmp_path):
    """Also where one of eight jumps all the time, or two change their ids now and then."""
    rng, steps = np.random.default_rng(1), []
    for k, place in enumerate(crowd(8, rate_hz, 60)):
        if odd == "one jumps":
            place[0] = rng.uniform(0, 50, 2)
        if odd == "swaps" and k // 10 % 2:
            place[[0, 1]] = place[[1, 0]]
        here = {f"p{n}": tuple(at) for n, at in enumerate(place.tolist())}
        steps.append((100.0 + k / rate_hz, here))
    assert len(read_bag(bag(ros2, tmp_path / "hall", *steps)).trajectories) == 480
