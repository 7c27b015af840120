"""Planners find modes, weights, covariances and predicted occupancy in standard messages."""

from dataclasses import replace

import numpy as np
import pytest

from pedpred.command import main
from pedpred.errors import ShapeError, ValueRuleError
from pedpred.ros import check_recordable, read_recording, write_recording
from pedpred.ros.message_types import known_types, serialize
from pedpred.ros.planning import (
    GRID_TYPE,
    PREDICTIONS,
    PREDICTIONS_TYPE,
    ROW,
    grid_messages,
    grid_topic,
    predictions_message,
)
from pedpred.scenes import OccupancyMap, Predictions, predicted_occupancy
from pedpred.storage.scenes import write_scene
from tests.scenes import assert_same
from tests.test_recording import STEPS, contents, small_scene, walking_on

NUMPY = {4: "<u2", 5: "<i4", 6: "<u4", 7: "<f4"}


def forecasts(count=3, modes=2, steps=4):
    rng = np.random.default_rng(0)
    path = rng.uniform(-1, 1, (count, modes, steps, 2))
    root = rng.normal(0, 0.2, (count, modes, steps, 2, 2))
    covariance = root @ root.swapaxes(-1, -2) + 0.01 * np.eye(2)
    return Predictions(path[:, 0], path, np.tile([0.75, 0.25], (count, 1)), 0.3, covariance)


def table_of(message):
    """Read a cloud as a planner does, from what the message says of itself."""
    names, kinds, offsets = zip(
        *((field.name, NUMPY[field.datatype], field.offset) for field in message.fields), strict=True
    )
    kind = {"names": names, "formats": kinds, "offsets": offsets, "itemsize": message.point_step}
    assert message.row_step == message.point_step * message.width
    return np.frombuffer(bytes(message.data), np.dtype(kind))


def received(kind, content):
    return known_types().deserialize_cdr(serialize(kind, content), kind)


def test_a_planner_reads_every_mode_with_weight_and_covariance():
    given, tracks = forecasts(), np.array([7, -1, 2**53 + 1])
    message = received(PREDICTIONS_TYPE, predictions_message(tracks, given, 12_000_000_005, "odom"))
    assert (message.header.frame_id, message.header.stamp.sec, message.header.stamp.nanosec) == (
        "odom",
        12,
        5,
    )
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


def test_unknown_covariances_and_nobody_are_messages_too():
    bare = replace(forecasts(), covariance=None)
    rows = table_of(received(PREDICTIONS_TYPE, predictions_message(np.arange(3), bare, 0, "map")))
    assert np.isnan(rows["cov_xy"]).all()
    nobody = bare.select(np.zeros(0, int))
    assert received(PREDICTIONS_TYPE, predictions_message(np.zeros(0, int), nobody, 0, "map")).width == 0


def test_grids_are_stamped_with_the_time_that_they_are_about():
    ground, given = OccupancyMap(np.ones((30, 20)), [-1.5, -1.0], 0.1), forecasts()
    expected = predicted_occupancy(given, ground)
    for step in range(4):
        content = grid_messages(given, ground, 5 * 10**9, "map")[grid_topic(step + 1)]
        message = received(GRID_TYPE, content)
        assert message.header.stamp.sec + message.header.stamp.nanosec / 1e9 == pytest.approx(
            5 + 0.3 * (step + 1)
        )
        assert (message.info.map_load_time.sec, message.info.width, message.info.height) == (5, 30, 20)
        cells = message.data.reshape(20, 30).T
        np.testing.assert_allclose(cells, 100 * expected[step], atol=0.51)


def counted_squares(monkeypatch):
    """A list to which each computed forecast of one mode and step adds its squares within 4 deviations."""
    asked = []

    def noted(people, cells):
        reach_m = 4 * np.sqrt(people.covariance[:, 0, 0, 0, 0, None])
        low, high = people.path[:, 0, 0] - reach_m, people.path[:, 0, 0] + reach_m
        inside = np.minimum(high, cells.origin + cells.extent_m) - np.maximum(low, cells.origin)
        asked.extend((inside / cells.resolution_m).prod(axis=1))
        return predicted_occupancy(people, cells)

    monkeypatch.setattr("pedpred.ros.planning.predicted_occupancy", noted)
    return asked


@pytest.mark.parametrize("spread_m", [0.05, 1.0, 3.0, 7.0, 40.0])
def test_somebody_who_may_be_nearly_anywhere_takes_no_longer_than_others(spread_m, monkeypatch):
    """As who was seen once, beside somebody who is known: few cells are computed, and grids are the same."""
    path = np.array([[[[0.3, 0.4]]], [[[-2.0, 1.0]]]])
    spread = np.eye(2) * np.array([spread_m, 0.1])[:, None, None, None, None] ** 2
    both = Predictions(path[:, 0], path, np.ones((2, 1)), 0.3, spread)
    ground = OccupancyMap(np.zeros((800, 900), bool), np.array([-30.0, -50.0]), 0.1)
    expected, asked = 100 * predicted_occupancy(both, ground)[0], counted_squares(monkeypatch)
    content = grid_messages(both, ground, 0, "map")[grid_topic(1)]
    np.testing.assert_allclose(np.reshape(content["data"], (900, 800)).T, expected, atol=1.01)
    assert len(asked) == 2
    assert max(asked) < 25_000


@pytest.mark.parametrize("people", [20, 300])
def test_a_crowd_is_shown_in_squares_of_a_number_that_does_not_grow_with_it(people, monkeypatch):
    path = np.random.default_rng(0).uniform(-10, 10, (people, 1, 1, 2))
    spread = np.full((people, 1, 1, 1, 1), 1.1**2) * np.eye(2)
    crowd = Predictions(path[:, 0], path, np.ones((people, 1)), 0.3, spread)
    asked = counted_squares(monkeypatch)
    grid_messages(crowd, OccupancyMap(np.zeros((400, 400), bool), np.array([-20.0, -20.0]), 0.1), 0, "map")
    assert len(asked) == people
    assert sum(asked) < 1_500_000


def test_a_recording_carries_what_planners_read(tmp_path):
    scene = small_scene()
    windows, path = walking_on(scene), tmp_path / "x.mcap"
    write_recording(scene, path, windows, planned="lstm", cell_m=0.5)
    instants = len(np.unique(scene.trajectories.time_s))
    clouds = contents(path, PREDICTIONS)
    assert len(clouds) == instants
    for time_s, cloud in zip(np.unique(windows.time_s), clouds, strict=True):
        given = windows.predictions["lstm"].path[windows.time_s == time_s]
        np.testing.assert_array_equal(table_of(cloud)["x"], given[..., 0].ravel().astype(np.float32))
    for step in range(STEPS):
        assert len(contents(path, grid_topic(step + 1))) == instants
    assert_same(read_recording(path), scene)


@pytest.mark.parametrize(
    ("cell_m", "error"), [(0.0, ValueRuleError), (np.nan, ValueRuleError), (1e-4, ShapeError)]
)
def test_absurd_cells_are_refused_and_leave_no_file(tmp_path, cell_m, error):
    scene = small_scene()
    with pytest.raises(error, match="cell"):
        check_recordable(scene, STEPS, cell_m)
    with pytest.raises(error, match="cell"):
        write_recording(scene, tmp_path / "x.mcap", walking_on(scene), planned="lstm", cell_m=cell_m)
    with pytest.raises(ValueRuleError, match="cv"):
        write_recording(scene, tmp_path / "x.mcap", walking_on(scene), planned="cv")
    assert list(tmp_path.iterdir()) == []


def test_predict_writes_what_planners_read(tmp_path, mixture):
    write_scene(small_scene(), tmp_path / "hall")
    arguments = [
        "predict",
        str(tmp_path / "hall"),
        "--model",
        str(mixture[0]),
        "-o",
        str(tmp_path / "x.mcap"),
    ]
    with pytest.raises(SystemExit, match="cells of all steps"):
        main([*arguments, "--grid", "0.01"])
    main([*arguments, "--grid", "0.5"])
    rows = table_of(contents(tmp_path / "x.mcap", PREDICTIONS)[-1])
    assert rows["mode"].max() == 3
    first = (rows["step"] == 1) & (rows["track_id"] == rows["track_id"][0])
    assert rows["weight"][first].sum() == pytest.approx(1)
    assert max(max(grid.data) for grid in contents(tmp_path / "x.mcap", grid_topic(1))) > 0
