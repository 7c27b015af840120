"""Features: causality, invariance to rotation, and agreement of online and offline values."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks import features as benchmark
from pedpred.features import ForecastProtocol, Neighbours, Pedestrians, Surroundings, extract_blocks
from pedpred.features.surroundings import pedestrians_at
from pedpred.geometry import rotate
from pedpred.models.lstm.features.grids import angular_grids, occupancy_crops, unpack_crops
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from pedpred.simulation.sensor import SensorSettings, apply_sensor
from pedpred.tracking import KalmanSettings, follow, resampled
from pedpred.tracking.tracks import TIME_TOLERANCE_S
from tests.exported import LSTM_ROWS
from tests.refused import refused
from tests.worlds import EXCERPT, empty_map, extract, recorded, tracked, walled_scene
from tools.latency import room

PROTOCOL, FEATURES = LSTM_ROWS.protocol, LSTM_ROWS.features
KALMAN = KalmanSettings(acceleration_noise=0.3, position_noise_m=0.1)
SOURCES = {
    "annotations": dict(kind="kalman", kalman=KALMAN, dt_s=0.4, phase_offsets=3, truth=False),
    "simulation": dict(kind="truth", kalman=None, dt_s=0.3, phase_offsets=1, truth=True),
    "sensor": dict(kind="kalman", kalman=KALMAN, dt_s=0.1, phase_offsets=1, truth=False, detections=60),
}
SENSOR = SensorSettings(
    rate_hz=5.0, position_noise_m=0.1, quantum_m=0.02, drop_out_share=0.1, switch_share=0.2
)
MOTION = ("position", "heading_rad", "velocity", "last_position", "last_velocity", "last_acceleration")
INPUTS = (*MOTION, "occupancy", "angular_grid")


def table_of(scene, source, truth=None):
    tracks = follow(scene.trajectories, source["kind"], source["kalman"], 0.2)
    return extract(scene, tracks, PROTOCOL, FEATURES, truth=truth, phase_offsets=source["phase_offsets"])


def paper_table(scene):
    """The leaky protocol."""
    prepared = resampled(scene, 0.3)
    tracks = follow(prepared.trajectories, "truth", None, 0.2)
    return extract(prepared, tracks, ForecastProtocol(noncausal=True), FEATURES, truth=scene.trajectories)


def column(table, name):
    """A column or an input."""
    return {**table.columns, **table.inputs}[name]


def otherwise_later(scene, now, rng):
    """The scene with detections after `now` moved, dropped and added."""
    trajectories = scene.trajectories
    later = trajectories.time_s > now + TIME_TOLERANCE_S
    moved = {"position": trajectories.position + later[:, None] * rng.normal(0, 3, (len(later), 2))}
    if trajectories.velocity is not None:
        moved["velocity"] = trajectories.velocity + later[:, None] * rng.normal(0, 3, (len(later), 2))
    changed = dataclasses.replace(trajectories, **moved).select(~later | (rng.random(len(later)) < 0.7))
    new = changed.select(changed.time_s > now + TIME_TOLERANCE_S)
    new = dataclasses.replace(new, track_id=new.track_id + 100, position=new.position + 1.0)
    columns = {f.name: (getattr(changed, f.name), getattr(new, f.name)) for f in dataclasses.fields(new)}
    both = {name: np.concatenate(pair) for name, pair in columns.items() if pair[0] is not None}
    return dataclasses.replace(scene, trajectories=Trajectories(**both))


def inputs_until(before, after, now):
    """Rows of the same (track, clock, step) up to `now` in both tables; nobody's may be missing."""
    old, new = (
        {(t.track_id[r], t.phase[r], t.step[r]): r for r in np.flatnonzero(t.time_s <= now)}
        for t in (before, after)
    )
    common = sorted(old.keys() & new.keys())
    # A track that ends earlier has fewer steps, but none before its last detection may be missing.
    assert len(common) >= len(new) > 0
    return [old[k] for k in common], [new[k] for k in common]


def assert_same_inputs(before, after, now):
    a, b = inputs_until(before, after, now)
    for name in INPUTS:
        np.testing.assert_array_equal(column(before, name)[a], column(after, name)[b], err_msg=name)


@pytest.mark.parametrize("name", SOURCES)
@settings(max_examples=25)
@given(seed=st.integers(0, 2**32 - 1), now=st.floats(3.0, 12.0))
def test_no_input_depends_on_a_later_detection(name, seed, now):
    """Move, drop and add anything after `now`: all inputs up to then stay bit-identical."""
    source, rng = SOURCES[name], np.random.default_rng(seed)
    scene = walled_scene(rng, source["dt_s"], source["truth"], detections=source.get("detections", 40))
    if name == "sensor":
        scene, now = apply_sensor(scene, SENSOR, rng), now / 3
    before, after = table_of(scene, source), table_of(otherwise_later(scene, now, rng), source)
    assert_same_inputs(before, after, now)


@pytest.mark.parametrize("place", [EXCERPT, "eth", "hotel"])
def test_no_input_depends_on_a_later_real_annotation(place):
    scene = minute_of(place)
    source = SOURCES["annotations"]
    before = table_of(scene, source)
    for now in np.array([0.2, 0.503, 0.788]) * scene.trajectories.time_s.max():
        after = table_of(otherwise_later(scene, now, np.random.default_rng(0)), source)
        assert_same_inputs(before, after, now)


def test_the_paper_protocol_does_leak():
    """A detection moved after `now` changes the position, velocity and crop that the network gets before."""
    scene, now = walled_scene(np.random.default_rng(1)), 6.0
    before = paper_table(scene)
    after = paper_table(otherwise_later(scene, now, np.random.default_rng(2)))
    a, b = inputs_until(before, after, now)
    for name in ("position", "velocity", "occupancy", "angular_grid"):
        assert (column(before, name)[a] != column(after, name)[b]).any(), name


def minute_of(place):
    """The first minute of a real recording, or what there is of it."""
    scene = recorded(place)
    start = scene.trajectories.time_s.min()
    minute = scene.trajectories.select(scene.trajectories.time_s < start + 60.0)
    return dataclasses.replace(scene, trajectories=dataclasses.replace(minute, time_s=minute.time_s - start))


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.floats(-np.pi, np.pi))
def test_features_do_not_depend_on_the_world_frame(seed, turn):
    rng = np.random.default_rng(seed)
    scene = walled_scene(rng)
    shift = rng.uniform(-50, 50, 2)
    position = rotate(scene.trajectories.position, np.float64(turn)) + shift
    trajectories = dataclasses.replace(scene.trajectories, position=position)
    turned = dataclasses.replace(scene, trajectories=trajectories)
    a, b = (table_of(s, SOURCES["annotations"]) for s in (scene, turned))
    walking = np.hypot(*a.velocity.T) > 0.25  # a pedestrian that never moved looks along world x
    np.testing.assert_allclose(a.velocity[walking], b.velocity[walking], atol=1e-5)
    np.testing.assert_allclose(a.future[walking], b.future[walking], atol=1e-4)
    grids = np.isclose(*(column(t, "angular_grid") for t in (a, b)), atol=1e-4)[walking]
    assert grids.mean() > 0.999  # a neighbour on the edge of a cone may fall to either side


def slow_crop(room, position, heading, cells, resolution_m):
    """The definition, cell by cell, in the same floating-point steps as the compiled loop."""
    scale = 1.0 / room.resolution_m
    step = resolution_m * scale
    cos, sin = math.cos(heading) * step, math.sin(heading) * step
    start = [(float(p) - float(o)) * scale for p, o in zip(position, room.origin, strict=True)]
    crop = np.zeros((cells, cells), np.uint8)
    for i, j in np.ndindex(crop.shape):
        forward, left = i + 0.5 - 0.5 * cells, j + 0.5 - 0.5 * cells
        x = math.floor(start[0] + cos * forward - sin * left)
        y = math.floor(start[1] + sin * forward + cos * left)
        if 0 <= x < room.occupied.shape[0] and 0 <= y < room.occupied.shape[1]:
            crop[i, j] = room.occupied[x, y]
    return crop


@settings(max_examples=30)
@given(
    st.sampled_from([0.0, np.pi / 2, -np.pi, np.pi / 4]) | st.floats(-10, 10),
    st.tuples(st.floats(-6, 6), st.floats(-6, 6)) | st.just((1e4, -1e4)),
    st.tuples(st.integers(1, 90), st.integers(1, 90)),
    st.sampled_from([0.05, 0.1, 0.37]),
    st.sampled_from([(60, 0.1), (20, 0.3)]),
)
def test_crop_equals_a_look_up_of_every_cell_centre(heading, position, size, resolution_m, window):
    """Bit by bit: any angle, any place in or outside any map."""
    occupied = np.random.default_rng(size).random(size) < 0.5
    room = OccupancyMap(occupied, np.array([-2.0, -3.03]), resolution_m)
    crop = occupancy_crops(room, np.array([position]), np.array([heading]), *window)
    np.testing.assert_array_equal(
        unpack_crops(crop, window[0])[0], slow_crop(room, position, heading, *window)
    )
    cells, side_m = window
    centre = (np.arange(cells) + 0.5 - cells / 2) * side_m
    centres = np.stack(np.meshgrid(centre, centre, indexing="ij"), axis=-1)
    points = rotate(centres, np.float64(heading)) + np.array(position)
    inside = np.abs((points - room.origin) / resolution_m % 1.0 - 0.5).max(axis=-1) < 0.5 - 1e-6
    found = unpack_crops(crop, cells)[0]
    np.testing.assert_array_equal(found[inside], room.is_occupied(points)[inside])  # on an edge, either side


def apg(position, heading, crowd, cells=72):
    span, names = np.array([[0, len(crowd)]]), np.arange(len(crowd))
    here, nobody = np.array([position]), np.array([-1])
    return angular_grids(here, np.array([heading]), crowd, names, nobody, span, cells, 6.0)[0]


@given(st.integers(0, 2**32 - 1), st.integers(-100, 100))
def test_apg_shifts_by_k_cells_when_the_crowd_turns_by_k_cones(seed, k):
    rng = np.random.default_rng(seed)
    angle = (rng.integers(0, 72, 12) + rng.uniform(0.05, 0.95, 12)) * np.deg2rad(5)
    crowd = rng.uniform(0.5, 7.0, 12)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    turned = rotate(crowd, np.deg2rad(5.0 * k))
    before, after = (apg([0.0, 0.0], 0.0, people) for people in (crowd, turned))
    np.testing.assert_allclose(np.roll(before, k), after, atol=1e-5)


@given(st.integers(0, 2**32 - 1), st.sampled_from([4, 72, 720]), st.sampled_from([1.0, 50.0]))
def test_apg_equals_its_definition(seed, cells, largest_turn):
    """Bit by bit, also with neighbours on the edges of cones and with one at the very same point."""
    rng = np.random.default_rng(seed)
    here, heading = rng.uniform(-1, 1, 2), rng.uniform(-largest_turn, largest_turn)
    edge = heading + rng.integers(0, cells, 30) * (2 * np.pi / cells)
    on_edges = here + rng.uniform(0, 8, 30)[:, None] * np.stack([np.cos(edge), np.sin(edge)], axis=-1)
    crowd = np.concatenate([rng.uniform(-8, 8, (60, 2)), on_edges, here[None]])
    expected = np.full(cells, 6.0, dtype=np.float32)
    for dx, dy in (crowd - here).tolist():
        distance = math.sqrt(dx * dx + dy * dy)
        if distance < 6.0:
            k = math.floor((math.atan2(dy, dx) - heading) * (cells / (2.0 * np.pi))) % cells
            expected[k] = min(expected[k], np.float32(distance))
    np.testing.assert_array_equal(apg(here, heading, crowd, cells), expected)


def test_one_detection_and_an_empty_recording_have_features():
    lonely = Trajectories(np.array([1.0]), np.array([7]), np.array([[50.0, 50.0]]))  # and outside the map
    table = table_of(Scene("one", lonely, empty_map(), 0.4), SOURCES["annotations"])
    assert len(table) == 1
    assert not column(table, "occupancy").any()
    assert table.future_steps.tolist() == [0]
    nothing = Trajectories(np.zeros(0), np.zeros(0), np.zeros((0, 2)))
    assert len(table_of(Scene("none", nothing, empty_map(), 0.4), SOURCES["annotations"])) == 0


@pytest.mark.parametrize("source", ["annotations", "simulation"])
def test_online_equals_offline_bit_by_bit(source):
    """Replay a scene detection by detection; the inputs of each step equal those of the table."""
    source = SOURCES[source]
    scene = walled_scene(np.random.default_rng(3), source["dt_s"], source["truth"], detections=14)
    table = table_of(scene, source)
    max_age_s = scene.detection_dt_s * PROTOCOL.max_age_intervals
    compared = 0
    for now in np.unique(table.time_s):
        heard = scene.trajectories.select(scene.trajectories.time_s <= now + TIME_TOLERANCE_S)
        tracks = follow(heard, source["kind"], source["kalman"], 0.2)
        last = np.flatnonzero(np.diff(tracks.track_id, append=-1))
        last = last[tracks.time_s[last] >= now - max_age_s]
        frame = pedestrians_at(tracks, last, np.full(len(last), now))
        around, now_s = Neighbours.of_crowd(frame, len(frame)), np.full(len(frame), now)
        seen = FEATURES.compute(Surroundings.of(tracks, last, now_s, around, scene.occupancy), 0.3)
        rows = np.flatnonzero(table.time_s == now)
        who = np.searchsorted(frame.track_id, table.track_id[rows])
        np.testing.assert_array_equal(frame.track_id[who], table.track_id[rows])
        for name in ("position", "heading_rad"):
            np.testing.assert_array_equal(getattr(frame, name)[who], getattr(table, name)[rows])
        for name, values in ({"state": table.velocity} | table.inputs).items():
            np.testing.assert_array_equal(seen[name][who], values[rows])
        compared += len(rows)
    assert compared == len(table) > 30


def test_blocks_hold_whole_tracks_and_together_the_table():
    scene = walled_scene(np.random.default_rng(0), tracks=6)
    tracks = tracked(scene, KALMAN)
    whole = extract(scene, tracks, PROTOCOL, FEATURES, phase_offsets=3)
    for rows in (1, 350, 10**6):
        blocks = list(extract_blocks(scene, tracks, PROTOCOL, FEATURES, rows, phase_offsets=3))
        owners = [set(block.track_id.tolist()) for block in blocks]
        assert sum(map(len, owners)) == len(set.union(*owners)) == 6
        assert all(len(block) <= rows or len(names) == 1 for block, names in zip(blocks, owners, strict=True))
        for name in (*whole.columns, *whole.inputs):
            parts = np.concatenate([column(block, name) for block in blocks])
            np.testing.assert_array_equal(parts, column(whole, name), err_msg=name)


def pedestrians(*positions, heading_rad=0.0):
    where = np.reshape(np.array(positions, dtype=float), (-1, 2))
    rows = len(where)
    return Pedestrians(np.arange(rows), where, np.full(rows, heading_rad), np.zeros((rows, 2)))


def observe_frame(frame, occupancy):
    """The grids around people whose past is not known."""
    return FEATURES.compute(benchmark.standing(frame, occupancy), 0.3)


def test_frames_of_nobody_and_outside_the_map_have_features():
    full = OccupancyMap(np.ones((30, 30), bool), np.zeros(2), 0.1)
    nobody = observe_frame(pedestrians(), full)
    assert [values.shape for values in nobody.values()] == [(0, 2), (0, 450), (0, 72)]
    alone = observe_frame(pedestrians((1.5, 1.5)), full)
    assert unpack_crops(alone["occupancy"], 60).sum() == 900  # the whole map, and free ground around it
    assert (alone["angular_grid"] == 6.0).all()
    outside = observe_frame(pedestrians((50.0, 50.0), (51.0, 50.0)), full)
    assert not outside["occupancy"].any()
    assert outside["angular_grid"][0].min() == 1.0
    assert not observe_frame(pedestrians((0.0, 0.0)), empty_map())["occupancy"].any()


def test_states_that_are_no_numbers_are_named():
    with refused("position[1]"):
        pedestrians((0.0, 0.0), (np.nan, 0.0))
    with refused("heading_rad[0]"):
        pedestrians((0.0, 0.0), heading_rad=np.inf)
    with refused("velocity"):
        Pedestrians(np.arange(2), np.zeros((2, 2)), np.zeros(2), np.zeros(2))


def test_targets_are_the_truth_whatever_the_sensor_says():
    """Two people change names for good; each name's target is the path of whom it stands for."""
    rng = np.random.default_rng(4)
    scene = walled_scene(rng, 0.1, tracks=6, detections=100, noise_m=0.0)
    seen = apply_sensor(scene, SENSOR, rng)
    tracks = tracked(seen, KALMAN)
    assert (tracks.person_id != tracks.track_id).any()
    table = extract(seen, tracks, PROTOCOL, FEATURES, truth=scene.trajectories)
    row = tracks.last_row(table.track_id, table.time_s)
    own = tracked(scene, KALMAN)
    ahead = own.last_row(tracks.person_id[row], table.time_s + 0.3)
    landed = table.position + rotate(table.future[:, 0] * 0.3, table.heading_rad)
    known = table.future_steps > 0
    assert np.abs(landed - own.detection[ahead])[known].max() < 0.3  # one detection interval of walking


def test_the_benchmark_compares_with_the_same_grids():
    rng = np.random.default_rng(0)
    place, frame = room(rng), benchmark.crowd(20, rng)
    crops, grids = benchmark.plain_numpy(frame, place)
    seen = benchmark.both_grids(frame, place)
    # A centre on a cell's edge may round to either side.
    assert np.unpackbits(crops ^ seen["occupancy"]).sum() <= 20
    np.testing.assert_allclose(grids, seen["angular_grid"], atol=1e-5)
