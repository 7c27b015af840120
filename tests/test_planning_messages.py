"""Planners find modes, weights, covariances and predicted occupancy in standard messages."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pedpred.command import main
from pedpred.errors import ValueRuleError
from pedpred.ros import check_recordable, write_recording
from pedpred.ros.grids import GRID_TYPE, HORIZON, MOST_CELLS, fitting_ground, grid_messages, grid_topic
from pedpred.ros.message_types import known_types, serialize
from pedpred.ros.planning import PREDICTIONS, PREDICTIONS_TYPE, ROW, predictions_message
from pedpred.ros.scene_messages import seconds
from pedpred.scenes import OccupancyMap, Predictions, predicted_occupancy
from pedpred.storage.scenes import write_scene
from tests.recorded import STEPS, contents, small_scene, walking_on

NUMPY = {4: "<u2", 5: "<i4", 6: "<u4", 7: "<f4"}


def forecasts(count=3, modes=2, steps=4):
    rng = np.random.default_rng(0)
    path = rng.uniform(-1, 1, (count, modes, steps, 2))
    root = rng.normal(0, 0.2, (count, modes, steps, 2, 2))
    covariance = root @ root.swapaxes(-1, -2) + 0.01 * np.eye(2)
    return Predictions(path[:, 0], path, np.tile([0.75, 0.25], (count, 1)), 0.3, covariance)


def table_of(message):
    """Read a cloud as a planner does, from what the message says of itself."""
    about = ((field.name, NUMPY[field.datatype], field.offset) for field in message.fields)
    names, kinds, offsets = zip(*about, strict=True)
    kind = {"names": names, "formats": kinds, "offsets": offsets, "itemsize": message.point_step}
    assert message.row_step == message.point_step * message.width
    return np.frombuffer(bytes(message.data), np.dtype(kind))


def received(kind, content):
    return known_types().deserialize_cdr(serialize(kind, content), kind)


def test_a_planner_reads_every_mode_with_weight_and_covariance():
    given, tracks = forecasts(), np.array([7, -1, 2**53 + 1])
    message = received(PREDICTIONS_TYPE, predictions_message(tracks, given, 12_000_000_005, "odom"))
    assert (message.header.frame_id, message.header.stamp.sec) == ("odom", 12)
    assert message.header.stamp.nanosec == 5
    rows = table_of(message)
    assert rows.dtype.names == ROW.names
    assert len(rows) == 3 * 2 * 4
    for row in rows:
        track = int(row["track_high"]) * 2**32 + int(row["track_id"])
        at = tracks.tolist().index(track), row["mode"], row["step"] - 1
        assert (row["x"], row["y"]) == tuple(given.path[at].astype(np.float32))
        assert row["weight"] == given.weight[at[:2]]
        assert row["time_s"] == pytest.approx(0.3 * row["step"])
        spread = np.array([[row["cov_xx"], row["cov_xy"]], [row["cov_xy"], row["cov_yy"]]])
        np.testing.assert_allclose(spread, given.covariance[at], rtol=1e-6)


def test_forecasts_without_covariances_or_people_are_messages():
    bare = replace(forecasts(), covariance=None)
    rows = table_of(received(PREDICTIONS_TYPE, predictions_message(np.arange(3), bare, 0, "map")))
    assert np.isnan(rows["cov_xy"]).all()
    none = bare.select(np.zeros(0, int))
    assert received(PREDICTIONS_TYPE, predictions_message(np.zeros(0, int), none, 0, "map")).width == 0


def test_grids_are_stamped_with_the_time_that_they_are_about():
    ground, given = OccupancyMap(np.ones((30, 20)), [-1.5, -1.0], 0.1), forecasts()
    found = grid_messages(given, ground, 5 * 10**9, "map", horizon=True)
    for step, topic in enumerate((HORIZON, *map(grid_topic, range(1, 5)))):  # that of all steps is of now
        message = received(GRID_TYPE, found[topic])
        assert seconds(message.header.stamp) == pytest.approx(5 + 0.3 * step)
        assert (message.info.map_load_time.sec, message.info.width, message.info.height) == (5, 30, 20)


@given(
    st.integers(0, 2**32 - 1),
    st.integers(0, 4),
    st.sampled_from([3.0, 30.0, 300.0]),
    st.sampled_from([0.1, 0.5]),
)
@settings(max_examples=25)
def test_grids_are_those_of_the_whole_ground(seed, people, spread_m, cell_m):
    """Wide modes are computed on larger cells: within 1.5 per cent."""
    rng = np.random.default_rng(seed)
    path = rng.normal(0, spread_m, (people, 2, 3, 2))
    weight = np.tile([0.7, 0.3], (people, 1))
    covariance = np.eye(2) * rng.uniform(1e-4, 1.0, (people, 2, 3, 1, 1))
    forecasts = Predictions((weight[..., None, None] * path).sum(1), path, weight, 0.3, covariance)
    ground = OccupancyMap(np.zeros((70, 40), bool), cell_m * np.array([-40.0, -14.0]), cell_m)
    expected = np.rint(100 * predicted_occupancy(forecasts, ground)).astype(int)
    found = grid_messages(forecasts, ground, 0, "map", horizon=True)
    cells = [np.asarray(found[grid_topic(step + 1)]["data"]).reshape(40, 70).T for step in range(3)]
    assert np.abs(np.array(cells) - expected).max() <= 2
    np.testing.assert_array_equal(found[HORIZON]["data"], np.max(cells, axis=0).T.ravel())


@given(st.integers(1, 300), st.integers(1, 300), st.floats(-3, 6), st.floats(-1, 1), st.integers(1, 20))
def test_the_cells_of_all_grids_are_never_too_many(width, height, side, cell, steps):
    """Nor larger than asked for without need."""
    ground = OccupancyMap(np.zeros((width, height), bool), np.zeros(2), 10.0**side)
    cut = fitting_ground(ground, 10.0**cell, steps)
    assert cut.occupied.size * steps <= MOST_CELLS
    assert cut.resolution_m == 10.0**cell or cut.occupied.size * steps > MOST_CELLS / 8
    assert (cut.extent_m >= ground.extent_m * (1 - 1e-9)).all()


def test_a_recording_carries_what_planners_read(tmp_path):
    scene = small_scene()
    windows, path = walking_on(scene), tmp_path / "x.mcap"
    write_recording(scene, path, windows, planned="lstm", cell_m=0.5)
    instants, clouds = np.unique(windows.time_s), contents(path, PREDICTIONS)
    for time_s, cloud in zip(instants, clouds, strict=True):
        given = windows.predictions["lstm"].path[windows.time_s == time_s]
        np.testing.assert_array_equal(table_of(cloud)["x"], given[..., 0].ravel().astype(np.float32))
    for step in range(STEPS):
        assert len(contents(path, grid_topic(step + 1))) == len(instants)


def test_absurd_cells_are_refused_and_leave_no_file(tmp_path):
    scene, path = small_scene(), tmp_path / "x.mcap"
    for cell_m in (0.0, np.nan, 1e-4):
        with pytest.raises(ValueRuleError):
            check_recordable(scene, STEPS, cell_m)
        with pytest.raises(ValueRuleError):
            write_recording(scene, path, walking_on(scene), planned="lstm", cell_m=cell_m)
    assert list(tmp_path.iterdir()) == []


def test_predict_writes_what_planners_read(tmp_path, mixture):
    write_scene(small_scene(), tmp_path / "hall")
    hall, out = str(tmp_path / "hall"), str(tmp_path / "x.mcap")
    arguments = ["predict", hall, "--model", str(mixture[0]), "-o", out]
    with pytest.raises(SystemExit):
        main([*arguments, "--grid", "0.01"])
    main([*arguments, "--grid", "0.5"])
    rows = table_of(contents(tmp_path / "x.mcap", PREDICTIONS)[-1])
    assert rows["mode"].max() == 3
    first = (rows["step"] == 1) & (rows["track_id"] == rows["track_id"][0])
    assert rows["weight"][first].sum() == pytest.approx(1)
    assert max(max(grid.data) for grid in contents(tmp_path / "x.mcap", grid_topic(1))) > 0
