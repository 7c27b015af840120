"""Features: causal, and the same however the world is turned."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pedpred.features import FeatureSettings, angular_grids, extract, occupancy_crops, unpack_crops
from pedpred.features.targets import future_velocities
from pedpred.geometry import rotate, to_world
from pedpred.scenes import OccupancyMap, Recording, Scene
from pedpred.tracking import KalmanSettings, follow
from pedpred.tracking.tracks import TIME_TOLERANCE_S
from tests.worlds import empty_map, walled_scene

KALMAN = KalmanSettings(acceleration_noise=0.3, position_noise_m=0.1)
SOURCES = {
    "annotations": dict(kind="kalman", kalman=KALMAN, dt_s=0.4, clocks=3, truth=False),
    "simulation": dict(kind="truth", kalman=None, dt_s=0.3, clocks=1, truth=True),
}
INPUTS = (
    "position",
    "heading_rad",
    "velocity",
    "last_position",
    "last_velocity",
    "last_acceleration",
    "occupancy",
    "angular_grid",
)


def table_of(scene, source):
    tracks = follow(scene.recording, source["kind"], source["kalman"], 0.2)
    return extract(scene, tracks, FeatureSettings(clocks=source["clocks"]))


@pytest.mark.parametrize("source", SOURCES)
@given(seed=st.integers(0, 2**32 - 1), now=st.floats(3.0, 12.0))
def test_no_input_depends_on_a_later_detection(source, seed, now):
    """Perturb, drop and add everything after `now`: all inputs up to then stay bit-identical."""
    source = SOURCES[source]
    rng = np.random.default_rng(seed)
    scene = walled_scene(rng, source["dt_s"], source["truth"])
    before = table_of(scene, source)
    later = scene.recording.time_s > now + TIME_TOLERANCE_S
    moved = {"position": scene.recording.position + later[:, None] * rng.normal(0, 3, (len(later), 2))}
    if source["truth"]:
        moved["velocity"] = scene.recording.velocity + later[:, None] * rng.normal(0, 3, (len(later), 2))
    changed = dataclasses.replace(scene.recording, **moved)
    changed = changed.select(~later | (rng.random(len(later)) < 0.7))
    after = table_of(dataclasses.replace(scene, recording=changed), source)

    def keyed(table):
        rows = np.flatnonzero(table.time_s <= now)
        return {(table.track_id[r], table.clock[r], table.step[r]): r for r in rows}

    old, new = keyed(before), keyed(after)
    common = old.keys() & new.keys()
    # A track that ends earlier has fewer steps, but none before its last detection may be missing.
    assert len(common) >= len(new) > 0
    a, b = [old[k] for k in common], [new[k] for k in common]
    for name in INPUTS:
        np.testing.assert_array_equal(getattr(before, name)[a], getattr(after, name)[b], err_msg=name)


@given(st.integers(0, 2**32 - 1), st.floats(-np.pi, np.pi))
def test_velocities_targets_and_neighbours_do_not_see_the_world_frame(seed, turn):
    rng = np.random.default_rng(seed)
    scene = walled_scene(rng)
    shift = rng.uniform(-50, 50, 2)
    recording = dataclasses.replace(
        scene.recording, position=rotate(scene.recording.position, np.float64(turn)) + shift
    )
    turned = dataclasses.replace(scene, recording=recording)
    a, b = (table_of(s, SOURCES["annotations"]) for s in (scene, turned))
    walking = np.hypot(*a.velocity.T) > 0.25  # a pedestrian that never moved looks along world x
    np.testing.assert_allclose(a.velocity[walking], b.velocity[walking], atol=1e-5)
    np.testing.assert_allclose(a.future[walking], b.future[walking], atol=1e-4)
    grids = np.isclose(a.angular_grid, b.angular_grid, atol=1e-4)[walking]
    assert grids.mean() > 0.999  # a neighbour on the edge of a cone may fall to either side


def test_crop_turns_with_the_map():
    """Map and pedestrian turned together by a right angle: the same crop."""
    rng = np.random.default_rng(0)
    occupied = rng.random((81, 81)) < 0.3
    room = OccupancyMap(occupied, np.array([-4.05, -4.05]), 0.1)
    turned = OccupancyMap(occupied[:, ::-1].T, np.array([-4.05, -4.05]), 0.1)  # (x, y) -> (-y, x)
    here = np.array([[0.3, -0.7]])
    a = occupancy_crops(room, here, np.array([0.4]), 60, 0.1)
    b = occupancy_crops(turned, rotate(here, np.pi / 2), np.array([0.4 + np.pi / 2]), 60, 0.1)
    assert (unpack_crops(a, 60) == unpack_crops(b, 60)).mean() > 0.999


@given(st.floats(-np.pi, np.pi), st.floats(-6, 6), st.floats(-6, 6), st.integers(30, 90), st.integers(30, 90))
def test_crop_equals_a_look_up_of_every_cell_centre(heading, x, y, size_x, size_y):
    occupied = np.random.default_rng(size_x).random((size_x, size_y)) < 0.5
    room = OccupancyMap(occupied, np.array([-2.0, -3.0]), 0.1)
    centre = (np.arange(60) + 0.5 - 30) * 0.1
    cells = np.stack(np.meshgrid(centre, centre, indexing="ij"), axis=-1)
    expected = room.is_occupied(to_world(cells, np.array([x, y]), np.float64(heading)))
    crop = unpack_crops(occupancy_crops(room, np.array([[x, y]]), np.array([heading]), 60, 0.1), 60)[0]
    assert (crop != expected).sum() <= 4  # a centre on a cell's edge may round to either side


def test_an_obstacle_ahead_and_to_the_left_is_there_in_the_crop():
    room = empty_map()
    occupied = room.occupied.copy()
    occupied[tuple(room.cell_of(np.array([-1.0, 2.0])))] = True
    room = OccupancyMap(occupied, room.origin, 0.1)
    # Looking along world y: the cell is 2 m ahead and 1 m to the left.
    crop = unpack_crops(occupancy_crops(room, np.array([[0.0, 0.0]]), np.array([np.pi / 2]), 60, 0.1), 60)[0]
    (i,), (j,) = np.nonzero(crop)
    assert abs((i + 0.5 - 30) * 0.1 - 2.0) < 0.11
    assert abs((j + 0.5 - 30) * 0.1 - 1.0) < 0.11


def apg(position, heading, crowd):
    span = np.array([[0, len(crowd)]])
    return angular_grids(
        np.array([position]), np.array([heading]), crowd, np.arange(len(crowd)), np.array([-1]), span, 72, 6.0
    )[0]


@given(st.integers(0, 2**32 - 1), st.integers(-100, 100))
def test_apg_shifts_by_k_cells_when_the_crowd_turns_by_k_cones(seed, k):
    rng = np.random.default_rng(seed)
    angle = (rng.integers(0, 72, 12) + rng.uniform(0.05, 0.95, 12)) * np.deg2rad(5)
    crowd = rng.uniform(0.5, 7.0, 12)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    turned = rotate(crowd, np.deg2rad(5.0 * k))
    np.testing.assert_allclose(
        np.roll(apg([0.0, 0.0], 0.0, crowd), k), apg([0.0, 0.0], 0.0, turned), atol=1e-5
    )


@given(st.integers(0, 2**32 - 1))
def test_apg_equals_its_definition(seed):
    rng = np.random.default_rng(seed)
    crowd, here, heading = rng.uniform(-8, 8, (30, 2)), rng.uniform(-1, 1, 2), rng.uniform(-np.pi, np.pi)
    relative = rotate(crowd - here, -np.float64(heading))
    distance = np.hypot(*relative.T)
    cell = (
        np.floor(np.mod(np.arctan2(relative[:, 1], relative[:, 0]), 2 * np.pi) / np.deg2rad(5)).astype(int)
        % 72
    )
    expected = np.full(72, 6.0)
    np.minimum.at(expected, cell, distance)
    np.testing.assert_allclose(apg(here, heading, crowd), expected, atol=1e-5)


def test_nobody_sees_itself_and_an_empty_crowd_is_far_away():
    one = Recording(np.arange(20) * 0.4, np.zeros(20), np.stack([np.arange(20) * 0.5, np.zeros(20)], axis=-1))
    table = table_of(Scene("alone", one, empty_map(), 0.4), SOURCES["annotations"])
    assert len(table) > 20
    assert (table.angular_grid == 6.0).all()


@given(st.integers(0, 2**32 - 1))
def test_integrated_targets_land_on_the_true_path(seed):
    rng = np.random.default_rng(seed)
    position, path = rng.normal(size=(5, 2)), rng.normal(size=(5, 10, 2))
    velocities = future_velocities(position, path, 0.3)
    np.testing.assert_allclose(position[:, None] + np.cumsum(velocities * 0.3, axis=1), path, atol=1e-12)


def test_clocks_cover_every_annotation_once():
    scene = walled_scene(np.random.default_rng(5))
    table = table_of(scene, SOURCES["annotations"])
    annotated = {
        (int(t), round(s / 0.4))
        for t, s in zip(scene.recording.track_id, scene.recording.time_s, strict=True)
    }
    on = np.abs(table.time_s / 0.4 - np.round(table.time_s / 0.4)) < 1e-6
    covered = list(
        zip(table.track_id[on].tolist(), np.round(table.time_s[on] / 0.4).astype(int).tolist(), strict=True)
    )
    assert len(covered) == len(set(covered))
    assert set(covered) == annotated


def test_a_track_of_one_detection_and_an_empty_recording_have_an_answer():
    lonely = Recording(np.array([1.0]), np.array([7]), np.array([[50.0, 50.0]]))  # and outside the map
    table = table_of(Scene("one", lonely, empty_map(), 0.4), SOURCES["annotations"])
    assert len(table) == 1
    assert not table.window.any()
    assert not table.occupancy.any()
    assert table.future_steps.tolist() == [0]
    nothing = Recording(np.zeros(0), np.zeros(0), np.zeros((0, 2)))
    assert len(table_of(Scene("none", nothing, empty_map(), 0.4), SOURCES["annotations"])) == 0
