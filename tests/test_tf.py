"""Transforms by the rules of tf2: last parent, interpolation and no extrapolation, limits of live streams."""

from types import SimpleNamespace as Message

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from pedpred.ros import tf
from pedpred.ros.tf import Frames, interpolate, inverse, rotate_points

SEEDS = st.integers(0, 2**32)
STILL = Rotation.identity()


def transform(parent, child, time_s=0.0, turn=STILL, offset=(0.0, 0.0, 0.0)):
    """A tf2_msgs/TFMessage with one transform."""
    stamp = Message(sec=int(time_s), nanosec=round(time_s % 1 * 1e9))
    translation = Message(**dict(zip("xyz", map(float, offset), strict=True)))
    rotation = Message(**dict(zip("xyzw", turn.as_quat().tolist(), strict=True)))
    pose = Message(translation=translation, rotation=rotation)
    header = Message(stamp=stamp, frame_id=parent)
    return Message(transforms=[Message(header=header, child_frame_id=child, transform=pose)])


def frames_of(*messages, fixed=False, kept_s=None):
    frames = Frames(kept_s)
    for message in messages:
        frames.add(message, 0.0, fixed)
    return frames


def x_of(frames, time_s, frame="base", target="map"):
    """Where the origin of a frame is on the x axis of another one."""
    return frames.placed(np.zeros((1, 3)), time_s, frame, target)[0, 0]


def moving(times_s, parent="map", kept_s=None):
    """The frame base, which moves along x at 1 m/s."""
    poses = (transform(parent, "base", time_s, offset=(time_s, 0.0, 0.0)) for time_s in times_s)
    return frames_of(*poses, kept_s=kept_s)


@given(SEEDS)
def test_rotations_are_those_of_scipy(seed):
    rng = np.random.default_rng(seed)
    ends = Rotation.from_quat(rng.normal(size=(6, 4)))
    points, part = rng.normal(0.0, 10.0, (6, 3)), rng.choice([0.0, 1.0, rng.uniform()], 5)
    np.testing.assert_allclose(rotate_points(ends.as_quat(), points), ends.apply(points), atol=1e-12)
    back = rotate_points(inverse(ends.as_quat()), points)
    np.testing.assert_allclose(back, ends.inv().apply(points), atol=1e-12)
    between = Rotation.from_quat(interpolate(ends.as_quat()[:-1], ends.as_quat()[1:], part))
    assert (between * Slerp(np.arange(6.0), ends)(np.arange(5) + part).inv()).magnitude().max() < 1e-9


@given(SEEDS)
def test_points_go_through_all_frames_and_back(seed):
    """Both ends hang below a third frame."""
    rng = np.random.default_rng(seed)
    poses = {child: (Rotation.from_quat(rng.normal(size=4)), rng.normal(size=3)) for child in "abc"}
    parents = {"a": "b", "b": "top", "c": "top"}
    frames = frames_of(*(transform(parents[child], child, 0.0, *poses[child]) for child in "abc"), fixed=True)
    expected = points = rng.normal(size=(4, 3))
    for child in "ab":
        expected = poses[child][0].apply(expected) + poses[child][1]
    expected = poses["c"][0].inv().apply(expected - poses["c"][1])
    placed = frames.placed(points, 7.0, "a", "c")
    np.testing.assert_allclose(placed, expected, atol=1e-12)
    np.testing.assert_allclose(frames.placed(placed, 7.0, "c", "a"), points, atol=1e-12)
    np.testing.assert_array_equal(frames.placed(points, 7.0, "a", "a"), points)


def test_poses_are_interpolated_and_not_extrapolated():
    """Over gaps of any length; each point has its own time."""
    frames = moving([10.0, 10.1, 10.5, 10.5, 60.0])
    times_s = np.array([10.4, 10.0, 9.0, 10.03, 10.25, 10.5, 30.0, 60.1])
    placed = frames.placed(np.zeros((8, 3)), times_s, "base", "map")[:, 0]
    np.testing.assert_allclose(placed, np.where((times_s < 10.0) | (times_s > 60.0), np.nan, times_s))
    for time_s in (9.99, 61.5):
        assert np.isnan(x_of(frames, time_s))
        assert frames.explain_missing("base", "map", time_s)


def test_a_frame_moves_if_its_poses_differ():
    still = frames_of(*(transform("map", "base", time_s, offset=(3.0, 0.0, 0.0)) for time_s in (10.0, 20.0)))
    assert (moving([10.0, 10.1]).moves("base"), still.moves("base")) == (True, False)


def test_the_last_parent_of_a_frame_wins():
    frames = moving([10.0, 10.1])
    frames.add(transform("odom", "base", 10.05), 0.0, False)
    assert frames.chain("base") == ["base", "odom"]
    assert np.isnan(x_of(frames, 10.05))
    assert frames.explain_missing("base", "map", 10.05)


def test_impossible_poses_are_left_out():
    """Also of a frame that is its own parent; a loop leads nowhere."""
    broken = transform("map", "base", 0.0, offset=(np.nan, 0.0, 0.0))
    unturned = transform("map", "base", 0.0)
    unturned.transforms[0].transform.rotation.w = 0.0
    assert frames_of(broken, unturned, transform("base", "base")).chain("base") == ["base"]
    loop = frames_of(transform("a", "b"), transform("b", "a"))
    assert loop.explain_missing("a", "map", 0.0)


def test_poses_without_a_stamp_are_of_their_arrival():
    """And names lose their leading slash."""
    frames = Frames()
    frames.add(transform("/map", "/base"), 12.5, False)
    assert frames.chain("base") == ["base", "map"]
    assert not frames.explain_missing("base", "map", 12.5)


# Live streams


def test_old_poses_are_forgotten():
    times_s = 100.0 + np.arange(0.0, 40.0, 0.1)
    live, kept = moving(times_s, kept_s=10.0), moving(times_s)
    assert x_of(live, 130.0) == x_of(kept, 130.0) == pytest.approx(130.0)
    assert np.isnan(x_of(live, 110.0))
    assert x_of(kept, 110.0) == pytest.approx(110.0)


def test_the_memory_of_a_live_stream_is_bounded(monkeypatch):
    """Also at 10 kHz, and with a frame for each person."""
    monkeypatch.setattr(tf, "MOST_POSES", 100)
    monkeypatch.setattr(tf, "MOST_FRAMES", 50)
    frames = moving(np.linspace(100.0, 105.0, 500), kept_s=10.0)
    assert len(frames._edges["base"]._samples) <= 2 * 8 * 100 + 8
    frames.add(transform("map", "camera"), 0.0, True)
    for number in range(100):
        frames.add(transform("map", f"person_{number}"), 0.0, False)
    assert len(frames._edges) == 50
    assert frames.chain("camera") == ["camera", "map"]
    assert frames.chain("base") == ["base"]


def test_a_frame_whose_time_goes_back_begins_anew():
    """As where a simulation restarts; other frames stay."""
    frames = moving([100.0, 100.1], kept_s=10.0)
    frames.add(transform("map", "other", 100.0), 0.0, False)
    frames.add(transform("map", "base", 5.0, offset=(7.0, 0.0, 0.0)), 0.0, False)
    assert x_of(frames, 5.0) == 7.0
    assert np.isnan(x_of(frames, 100.1))
    assert not frames.explain_missing("other", "map", 100.0)


# Robots


@pytest.mark.parametrize(
    ("odometry", "base", "fixed", "frame", "expected"),
    [
        ("odom", "base_link", "camera", "camera", "odom"),
        ("vio", "r2/base_footprint", "r2/base_link", "r2/base_link", "vio"),
        ("r2_odom", "body", "lidar", "lidar", "r2_odom"),
        ("camera_init", "base_link", "camera", "camera_init", "camera_init"),
        ("map", "base_link", "camera", "camera", ""),
    ],
)
def test_odometry_is_where_the_base_moves(odometry, base, fixed, frame, expected):
    frames = frames_of(transform(base, fixed), fixed=True)
    frames.add(transform(odometry, base, 1.0), 0.0, False)
    if odometry != "map":
        frames.add(transform("map", odometry, 1.0), 0.0, False)
    assert frames.odometry(frame, "map") == expected
    assert frames.base(frame) == (base if "base" in base else "")
