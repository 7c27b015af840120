"""People of a bag: names, places, frames and maps that are odd are told apart, counted or refused."""

import logging
from dataclasses import replace
from types import SimpleNamespace as Message

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags import rosbag2
from scipy.spatial.distance import cdist

from pedpred.command import main
from pedpred.errors import InputError, ShapeError, ValueRuleError
from pedpred.geometry import rotate
from pedpred.ros import (
    TrackNumbers,
    Transform,
    find_usable,
    map_of_grid,
    read_bag,
    read_recording,
    write_recording,
)
from pedpred.scenes import Trajectories, checked_placement
from pedpred.storage.scenes import read_scene, write_scene
from pedpred.storage.tracks import tracks_table
from tests.bags import PEOPLE, Filled, bag
from tests.worlds import walled_scene


@given(st.lists(st.text(max_size=3) | st.integers(-(2**70), 2**70).map(str) | st.just("007"), unique=True))
def test_different_names_are_different_tracks(names):
    numbers = TrackNumbers()
    once, again = ([numbers.number(name) for name in names] for _ in "ab")
    assert once == again
    assert len(set(once)) == len(names)
    assert all(-(2**63) <= number < 2**63 for number in once)


def test_names_that_look_alike_stay_apart_in_a_bag(ros2, tmp_path):
    names = ["7", "007", str(2**53), str(2**53 + 1), str(2**64 - 1)]
    here = {name: (float(k), 0.0) for k, name in enumerate(names)}
    people = read_bag(bag(ros2, tmp_path / "bag", (0.0, here), (0.5, here))).trajectories
    of = {track: people.position[people.track_id == track, 0].tolist() for track in set(people.track_id)}
    assert of == {7: [0, 0], -1: [1, 1], 2**53: [2, 2], 2**53 + 1: [3, 3], -2: [4, 4]}


def test_odd_detections_are_left_out_with_their_time(ros2, tmp_path, caplog):
    twice = [("3", (1.0, 1.0)), ("3", (9.0, 9.0)), ("5", (2.0, 0.0))]
    instants = [(0.0, twice), (0.5, {"3": (np.nan, 0.0), "5": (2.5, 0.0)}), (1.0, {"5": (1e300, 0.0)})]
    with caplog.at_level(logging.WARNING):
        people = read_bag(bag(ros2, tmp_path / "bag", *instants, (0.5, {"5": (7.0, 7.0)}))).trajectories
    assert people.time_s.tolist() == [0, 0, 0.5]
    assert people.position.tolist() == [[1, 1], [2, 0], [2.5, 0]]
    assert "of 7 detections" in caplog.text
    assert "2 without a place, the first at 0.5 s (track 3)" in caplog.text
    assert "2 of a track that was there already, the first at 0.0 s (track 3)" in caplog.text


def test_who_is_left_out_of_a_bag_is_called_by_name(ros2, tmp_path, caplog):
    places = {"anna": (0.0, 0.0), "bob": (np.nan, 0.0)}
    read_bag(bag(ros2, tmp_path / "bag", (0.0, places), (0.5, {"anna": (1.0, 0.0), "bob": (0.0, 0.0)})))
    assert "1 without a place, the first at 0.0 s (track 'bob')" in caplog.text


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 2), st.sampled_from([0.0, 1.0, np.nan]))))
def test_what_is_usable_makes_trajectories_and_nothing_else_is_lost(rows):
    time_s, track_id, x = (
        (np.array(column, float) for column in zip(*rows, strict=True)) if rows else [np.zeros(0)] * 3
    )
    position = np.stack([x, np.zeros_like(x)], axis=-1)
    kept, left_out = find_usable(time_s, track_id.astype(np.int64), position)
    Trajectories(time_s[kept], track_id[kept], position[kept])
    pairs = {(t, track) for t, track, at in rows if np.isfinite(at)}
    assert kept.sum() == len(pairs)
    assert bool(left_out) == (len(pairs) < len(rows))


def test_people_in_another_frame_need_its_pose(ros2, tmp_path):
    steps = [(0.0, {"3": (1.0, 0.0)}), (0.5, {"3": (2.0, 0.0)})]
    path = bag(ros2, tmp_path / "bag", *steps, frame="odom")
    with pytest.raises(InputError, match=r"people in 'odom', map in 'map'.*x, y and yaw"):
        read_bag(path)
    people = read_bag(path, transform=Transform(10.0, 20.0, np.pi / 2)).trajectories
    np.testing.assert_allclose(people.position, [[10, 21], [10, 22]])
    assert len(read_bag(bag(ros2, tmp_path / "bare", *steps, frame="odom", grid=False)).trajectories) == 2


@pytest.mark.parametrize("frame", ["", "base_link"])
def test_the_frame_of_a_message_of_nobody_does_not_matter(tmp_path, frame):
    """Many trackers fill in nothing when they see nobody."""
    store = Filled(0)
    nobody = "/people", PEOPLE, store.make(PEOPLE, header=store.header(0.7, frame), people=[])
    seen = [("/people", PEOPLE, store.people(PEOPLE, time_s)) for time_s in (0.0, 0.5, 1.0)]
    for name, ground in (("free", []), ("walled", [("/map", "nav_msgs/msg/OccupancyGrid", store.grid())])):
        plain, mixed = tmp_path / f"{name}_plain", tmp_path / name
        store.write(plain, [*ground, *seen], rosbag2.StoragePlugin.MCAP)
        store.write(mixed, [*ground, nobody, *seen[:2], nobody, seen[2]], rosbag2.StoragePlugin.MCAP)
        expected = read_bag(plain).trajectories
        np.testing.assert_array_equal(read_bag(mixed).trajectories.position, expected.position)
    numbered = [replace(one, people=[replace(p, name="7") for p in one.people[:1]]) for *_, one in seen]
    seen = [("/people", PEOPLE, one) for one in numbered]
    store.write(tmp_path / "named", [*ground, nobody, *seen], rosbag2.StoragePlugin.MCAP)
    (recording,) = (tmp_path / "named").glob("*.mcap")
    assert len(read_recording(recording).trajectories) == 3


def test_a_transform_moves_all_vectors(tmp_path):
    scene = walled_scene(np.random.default_rng(0), truth=True)
    scene = replace(scene, trajectories=replace(scene.trajectories, goal=scene.trajectories.position))
    write_recording(scene, tmp_path / "x.mcap")
    turned = read_recording(tmp_path / "x.mcap", Transform(1.0, 2.0, np.pi / 2)).trajectories
    was, quarter = scene.trajectories, np.array([[0, 1], [-1, 0]])
    np.testing.assert_allclose(turned.velocity, was.velocity @ quarter, atol=1e-9)
    for name in ("position", "goal"):
        np.testing.assert_allclose(getattr(turned, name), getattr(was, name) @ quarter + [1, 2], atol=1e-9)
    with pytest.raises(ValueRuleError, match="yaw_rad = nan"):
        Transform(0.0, 0.0, np.nan)
    with pytest.raises(ValueRuleError, match=r"yaw_rad = 90\.0, .*in degrees"):
        Transform(0.0, 0.0, 90.0)


@pytest.mark.parametrize("kind", ["csv", "mcap", "folder", "bag"])
def test_the_command_takes_people_of_another_frame(kind, ros2, tmp_path):
    scene = walled_scene(np.random.default_rng(0), detections=12)
    given, out = tmp_path / {"bag": "given"}.get(kind, f"given.{kind}"), tmp_path / "moved"
    if kind == "bag":
        bag(ros2, given, (0.0, {"1": (1.0, 0.0)}), (0.5, {"1": (2.0, 0.0)}), frame="odom")
        scene = replace(scene, trajectories=Trajectories([0.0, 0.5], [1, 1], [[1.0, 0.0], [2.0, 0.0]]))
    elif kind == "mcap":
        write_recording(scene, given)
    else:
        write_scene(scene, given if kind == "folder" else tmp_path)
        tracks_table(scene.trajectories).to_csv(tmp_path / "given.csv", index=False)
    main(["convert", str(given), "-o", str(out), "--transform", "10", "20", "0"])
    moved = read_scene(out)
    np.testing.assert_allclose(moved.trajectories.position, np.add(scene.trajectories.position, [10, 20]))
    assert kind != "csv" or checked_placement(moved).outside == 0


def sized(width, height):
    turn, corner = Message(x=0.0, y=0.0, z=0.0, w=1.0), Message(x=0.0, y=0.0)
    origin = Message(position=corner, orientation=turn)
    return Message(width=width, height=height, resolution=0.1, origin=origin)


def test_unknown_cells_are_free_and_other_values_are_percentages():
    read = map_of_grid(Message(info=sized(5, 1), data=np.array([-1, 0, 50, 51, 100], np.int8)))
    assert read.occupied[:, 0].tolist() == [False, False, False, True, True]
    for odd in (-2, 127):
        with pytest.raises(ValueRuleError, match=f"data = {odd}, but cells are -1"):
            map_of_grid(Message(info=sized(2, 1), data=np.array([0, odd], np.int8)))


def turned(cells, yaw_rad, **orientation):
    info = sized(*cells.shape)
    info.origin.position.x, info.origin.position.y = 3.0, -2.0
    given = {"z": np.sin(yaw_rad / 2), "w": np.cos(yaw_rad / 2)} | orientation
    vars(info.origin.orientation).update(given)
    return Message(info=info, data=np.where(cells.T, 100, 0).astype(np.int8).ravel())


@given(st.floats(-3.2, 3.2), st.integers(0, 2**32))
@settings(max_examples=30)
def test_walls_of_a_turned_map_are_where_they_are(yaw_rad, seed):
    """Every blocked cell is found at its centre, and nothing is blocked a cell away from all of them."""
    cells = np.random.default_rng(seed).random((12, 7)) < 0.2
    read = map_of_grid(turned(cells, yaw_rad))
    centres = np.argwhere(cells) * 0.1 + 0.05
    there = np.array([3.0, -2.0]) + rotate(centres, np.full(len(centres), yaw_rad))
    assert read.occupied[tuple(read.cell_of(there).T)].all()
    found = read.origin + (np.argwhere(read.occupied) + 0.5) * read.resolution_m
    if len(found):
        assert cdist(found, there).min(axis=1).max() < 0.15


def test_a_map_that_is_turned_by_a_right_angle_keeps_its_cells_and_a_tilted_one_is_refused():
    cells = np.random.default_rng(0).random((5, 3)) < 0.5
    np.testing.assert_array_equal(map_of_grid(turned(cells, np.pi / 2)).occupied, cells.T[::-1])
    with pytest.raises(ValueRuleError, match="a map must be level"):
        map_of_grid(turned(cells, 0.0, x=0.1))


def test_a_map_is_refused_before_its_cells_are_decoded():
    """The same bound as that of every map, so that what can be written can be read."""
    info = sized(9000, 9000)
    with pytest.raises(ShapeError, match="at most 67108864 cells"):
        map_of_grid(Message(info=info))  # it has no data


# Classes


def boxes(path, *labels, **classes):
    """Somebody of each class in a bag, who could also be a person."""
    store, kind = Filled(0), "vision_msgs/msg/Detection3DArray"

    def hypothesis(label, score):
        inner = store.make("vision_msgs/msg/ObjectHypothesis", class_id=label, score=score)
        return store.make("vision_msgs/msg/ObjectHypothesisWithPose", hypothesis=inner)

    messages = []
    for k in range(10):
        header, several = store.header(k / 10, "map"), []
        for number, label in enumerate(labels):
            centre = store.make("vision_msgs/msg/BoundingBox3D", center=store.pose(k / 10, 3.0 * number))
            results = [hypothesis("person", 0.3), hypothesis(label, 0.6)] if label else []
            given = {"header": header, "bbox": centre, "id": str(number + 7), "results": results}
            several.append(store.make("vision_msgs/msg/Detection3D", **given))
        messages.append(("/boxes", kind, store.make(kind, header=header, detections=several)))
    store.write(path, messages)
    return np.unique(read_bag(path, **classes).trajectories.track_id).tolist()


@pytest.mark.parametrize(
    ("labels", "classes", "tracks"),
    [
        (("person", "chair"), {}, [7]),
        (("PEDESTRIAN", "CAR", ""), {}, [7, 9]),
        (("human.pedestrian.adult", "Person_sitting", "manhole"), {}, [7, 8]),
        (("0", "56", "0"), {"classes": ["0"]}, [7, 9]),
        (("chair", "person"), {"classes": ["Chair", "person"]}, [7, 8]),
        (("chair", "person"), {"classes": [""]}, [7, 8]),
    ],
)
def test_only_people_are_taken_among_classes(labels, classes, tracks, tmp_path, caplog):
    assert boxes(tmp_path / "hall", *labels, **classes) == tracks
    assert ("left out: detections that are not people" in caplog.text) == (len(tracks) < len(labels))


def test_classes_without_people_are_asked_about(tmp_path, capsys):
    with pytest.raises(InputError, match=r"class_id = \{'0': 10, '56': 10\}, but none is.*--class"):
        boxes(tmp_path / "hall", "0", "56")
    main(["info", str(tmp_path / "hall"), "--class", "0"])
    assert "10 of 1 tracks" in capsys.readouterr().out


def test_impossible_speeds_and_times_are_doubted(ros2, tmp_path, caplog):
    far = [(k / 10, {"3": (100.0 * k, 0.0)}) for k in range(20)]
    assert len(read_bag(bag(ros2, tmp_path / "mm", *far)).trajectories) == 20
    assert "faster than people walk" in caplog.text
    slow = [(100.0 * k, {"3": (0.1 * k, 0.0)}) for k in range(20)]
    with pytest.raises(InputError, match=r"usually 100 s between two detections.*seconds and nanoseconds"):
        read_bag(bag(ros2, tmp_path / "ms", *slow))


# Places that are not in the box


def likely_at(path, *results, centre=(0.0, 0.0, 0.0)):
    """A bag of two detections whose boxes are left empty; a result is (class, score, x of the first one)."""
    store, kind = Filled(0), "vision_msgs/msg/Detection3DArray"
    messages = []
    for k in range(10):
        several = []
        for number in (7, 8):
            made = []
            for label, score, x in results:
                inner = store.make("vision_msgs/msg/ObjectHypothesis", class_id=label, score=score)
                pose = store.pose(x + k / 10, float(number) if x else 0.0)
                sure = store.make("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=np.zeros(36))
                one = "vision_msgs/msg/ObjectHypothesisWithPose"
                made.append(store.make(one, hypothesis=inner, pose=sure))
            box = store.make("vision_msgs/msg/BoundingBox3D", center=store.pose(*centre[:2]))
            box.center.position.z = centre[2]
            fields = {"header": store.header(k / 10, "map"), "bbox": box, "id": str(number), "results": made}
            several.append(store.make("vision_msgs/msg/Detection3D", **fields))
        messages.append(
            ("/boxes", kind, store.make(kind, header=store.header(k / 10, "map"), detections=several))
        )
    store.write(path, messages)
    return path


def test_people_without_a_box_are_at_their_likeliest_pose(tmp_path):
    path = likely_at(tmp_path / "hall", ("person", 0.3, 40.0), ("person", 0.6, 2.0), ("person", 0.1, 60.0))
    people = read_bag(path).trajectories
    np.testing.assert_allclose(people.position[people.track_id == 8, 0], 2.0 + np.arange(10) / 10)
    np.testing.assert_allclose(people.position[people.track_id == 8, 1], 8.0)


@pytest.mark.parametrize("results", [(), [("person", 0.5, 5.0)]])
def test_everybody_at_one_place_is_refused_with_the_topic(results, tmp_path):
    """A box that is there counts, whatever the results say."""
    path = likely_at(tmp_path / "hall", *results, centre=(3.0, 0.0, 0.5))
    with pytest.raises(InputError, match=r"hall: /boxes: position = \[3\.0, 0\.0\], .*always there"):
        read_bag(path)


# Ids that mean nobody


@pytest.mark.parametrize("nobody", ["", "nan", "NaN", "Nan", "-nan", "-1"])
@pytest.mark.parametrize("several", [1, 2])
def test_detections_of_nobody_are_left_out_and_counted(nobody, several, ros2, tmp_path, caplog):
    """As of trackers that write -1 for what they do not follow, here and there."""
    far = [(nobody, (20.0 - 9.0 * n, 3.0)) for n in range(several)]
    steps = [(k / 10, [("3", (k / 10, 0.0)), *(far if k % 3 else ())]) for k in range(30)]
    people = read_bag(bag(ros2, tmp_path / "hall", *steps)).trajectories
    assert people.track_id.tolist() == [3] * 30
    count = 20 * several
    assert (
        f"/people: left out: {count} of {count + 30} detections, which have no id: [{nobody!r}]"
        in caplog.text
    )


@pytest.mark.parametrize("names", [["-1", "-2", "-3"], ["-1"], ["Nana", "nan1"]])
def test_negative_ids_and_names_are_people(names, ros2, tmp_path, caplog):
    steps = [(k / 10, {name: (k / 10, 2.0 * n) for n, name in enumerate(names)}) for k in range(10)]
    called = {}
    people = read_bag(bag(ros2, tmp_path / "hall", *steps), names=called).trajectories
    assert len(people) == 10 * len(names)
    assert sorted(called.values()) == sorted(names)
    assert "no id" not in caplog.text


def test_who_has_several_names_of_nobody_is_left_out_and_counted(ros2, tmp_path, caplog):
    """Trackers call -1 or NaN whom they do not follow."""
    frames = [(k / 10, [("7", (k / 10, 0.0)), ("-1", (5.0, k / 10)), ("nan", (9.0, 1.0))]) for k in range(20)]
    scene = read_bag(bag(ros2, tmp_path / "hall", *frames))
    assert np.unique(scene.trajectories.track_id).tolist() == [7]
    assert "left out: 40 of 60 detections, which have no id" in caplog.text


def test_somebody_is_called_minus_one_where_others_have_negative_ids(ros2, tmp_path):
    """Also in a message in which nobody else is, as in tables."""
    frames = [(k / 10, {name: (k / 10, 3.0 * int(name)) for name in ("-1", "-2")}) for k in range(10)]
    frames += [(k / 10, {"-1": (k / 10, -3.0)}) for k in range(10, 20)]
    people = read_bag(bag(ros2, tmp_path / "hall", *frames)).trajectories
    assert sorted(np.unique(people.track_id, return_counts=True)[1]) == [10, 20]


@pytest.mark.parametrize("several", [1, 2])
def test_a_bag_of_nobody_is_refused(several, ros2, tmp_path):
    """NaN is never somebody; -1 may be, where it is the only id."""
    steps = [(k / 10, [("nan", (k / 10, 2.0 * n)) for n in range(several)]) for k in range(10)]
    with pytest.raises(InputError, match=r"hall: /people: id = '', .*say who is who"):
        read_bag(bag(ros2, tmp_path / "hall", *steps))


# Units


@pytest.mark.parametrize(("per_m", "unit"), [(100.0, "cm"), (1000.0, "mm"), (1e6, "another unit")])
def test_lengths_in_another_unit_are_refused(per_m, unit, ros2, tmp_path):
    steps = [(k / 10, {"3": (per_m * k / 10, 0.0), "4": (0.0, per_m * k / 8)}) for k in range(20)]
    told = rf"hall: /people: position = .* half of the time.*: are lengths {unit} in place of metres.*--unit"
    with pytest.raises(InputError, match=told):
        read_bag(bag(ros2, tmp_path / "hall", *steps))


def test_degrees_are_refused(ros2, tmp_path):
    steps = [(k / 10, {"3": (8.5 + 1e-6 * k, 47.3), "4": (8.5, 47.3 - 1e-6 * k)}) for k in range(20)]
    with pytest.raises(InputError, match=r"hall: /people: position = \[8.5, 47.3\], .*degrees.*metres"):
        read_bag(bag(ros2, tmp_path / "hall", *steps))


@pytest.mark.parametrize("rate_hz", [2, 10, 100])
def test_one_of_three_who_is_too_fast_is_warned_about(rate_hz, ros2, tmp_path, caplog):
    rng = np.random.default_rng(0)
    steps = []
    for k in range(40):
        noise = rng.normal(0, 0.03, (3, 2))
        way = np.array([[k, 0.0], [0.5 * k, 3.0], [40.0 * k, 9.0]]) / rate_hz + noise
        steps.append((k / rate_hz, {str(n): tuple(at) for n, at in enumerate(way.tolist())}))
    assert len(read_bag(bag(ros2, tmp_path / "hall", *steps)).trajectories) == 120
    assert "faster than people walk" in caplog.text
