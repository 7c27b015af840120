"""Bags in which z is not the height of people on one ground."""

import numpy as np
import pytest

from pedpred.errors import InputError, ValueRuleError
from pedpred.ros import Transform, read_bag
from pedpred.ros.heights import check_heights
from tests.bags import PEOPLE, check_moving, moving_bag
from tests.robots import from_camera


def walks(seed=0, count=5, steps=60):
    """Where people walk on the ground, at 10 Hz, and their heights, which are noisy. [count, steps, 3]"""
    rng = np.random.default_rng(seed)
    way_m = rng.uniform(0.05, 0.15, (count, 1)) * np.arange(steps)
    heading_rad = rng.uniform(-np.pi, np.pi, (count, 1))
    ground = rng.uniform(0, 10, (count, 1, 2)) + np.stack(
        [way_m * np.cos(heading_rad), way_m * np.sin(heading_rad)], -1
    )
    return np.concatenate([ground, rng.normal(0.9, 0.05, (count, steps, 1))], -1)


def bag(store, path, places, frame="map"):
    found = []
    for k in range(places.shape[1]):
        several = []
        for who, at in enumerate(places[:, k].tolist()):
            pose = store.pose(*at[:2])
            pose.position.z = at[2]
            several.append(store._one("people_msgs/msg/Person", who, pose, None))
        found.append(
            ("/seen", PEOPLE, store.make(PEOPLE, header=store.header(k / 10, frame), people=several))
        )
    store.write(path, found)
    return path


@pytest.mark.parametrize(("axes", "name"), [([0, 2, 1], "y"), ([2, 0, 1], "x")])
@pytest.mark.parametrize("noisy", [0.0, 1.0])
@pytest.mark.parametrize("transform", [None, Transform(1.0, 2.0, 0.5)])
def test_another_height_than_z_is_refused_with_what_to_do(axes, name, noisy, transform, ros2, tmp_path):
    """As from a simulator whose y looks up, or a camera whose y looks down."""
    places = walks()
    places[..., 2] = 0.9 + noisy * (places[..., 2] - 0.9)
    path = bag(ros2, tmp_path / "hall", places[..., axes])
    told = (
        rf"hall: /seen: position = .{name} changes by .* z by .* m in 'map'.*{name} looks like a height.*/tf"
    )
    with pytest.raises(InputError, match=told):
        read_bag(path, transform=transform)


def test_depth_in_the_frame_of_a_camera_is_no_height(ros2, tmp_path):
    """Also where people come down from above, so that y changes, too."""
    places = walks()
    places[..., 2] += np.linspace(0.0, 3.0, 60)
    with pytest.raises(InputError, match=r"z looks forward in frames of cameras.*a frame whose z looks up"):
        read_bag(bag(ros2, tmp_path / "hall", places[..., [0, 2, 1]], "cam0_optical_frame"))


@pytest.mark.parametrize("seed", range(5))
def test_people_on_the_ground_are_read_silently(seed, ros2, tmp_path, caplog):
    for name, places in (("hall", walks(seed)), ("one", walks(seed, 1)), ("short", walks(seed, 5, 3))):
        for frame in ("map", "cam0_optical_frame"):
            path = bag(ros2, tmp_path / f"{name}_{frame}", places, frame)
            np.testing.assert_allclose(
                read_bag(path).trajectories.position, places.transpose(1, 0, 2).reshape(-1, 3)[:, :2]
            )
    assert "height" not in caplog.text


def test_floors_are_warned_about_and_stairs_are_no_other_axis(ros2, tmp_path, caplog):
    floors = walks()
    floors[:, :, 1] *= 0.01  # a corridor on each floor
    floors[::2, :, 2] += 4.0
    assert len(read_bag(bag(ros2, tmp_path / "floors", floors)).trajectories) == 300
    assert "/seen: heights (z) differ by 4" in caplog.text
    caplog.clear()
    stairs = walks()
    stairs[:, :, 1] *= 0.01
    stairs[:, :, 2] += 0.6 * stairs[:, :, 0]
    assert len(read_bag(bag(ros2, tmp_path / "stairs", stairs)).trajectories) == 300
    assert "heights (z) differ by" in caplog.text


def test_a_camera_with_transforms_is_level_after_them(ros2, tmp_path, caplog):
    check_moving(read_bag(moving_bag(ros2, tmp_path / "hall", "camera", from_camera)))
    assert "height" not in caplog.text


def test_nobody_and_unknown_heights_are_nothing_to_check():
    told = []
    check_heights(np.zeros((0, 3)), np.zeros(0, np.int64), "map", told.append)
    check_heights(np.full((4, 3), np.nan), np.arange(4), "map", told.append)
    flat = walks()[..., [0, 2, 1]].reshape(-1, 3)
    flat[::2] = np.nan
    with pytest.raises(ValueRuleError, match="y looks like a height"):
        check_heights(flat, np.repeat(np.arange(5), 60), "map", told.append)
    assert not told
