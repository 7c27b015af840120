"""`pedpred.predict`: forecasts of a data frame in one call are those of the command, also as Parquet."""

import numpy as np
import pandas as pd
import pytest

import pedpred
from pedpred.command import main
from pedpred.command.forecast_tables import COLUMNS
from pedpred.command.foreign import read_forecasts
from pedpred.errors import InputError, ValueRuleError
from pedpred.scenes import OccupancyMap
from pedpred.storage.scenes import write_map

WALKS = pd.DataFrame(
    [(0.4 * k, who, 0.4 * k, 1.5 * who) for k in range(8) for who in (1, 2)], columns=["time", "id", "x", "y"]
)


@pytest.fixture(scope="module")
def forecasts():
    return pedpred.predict(WALKS)


def test_forecasts_of_a_frame_are_those_of_the_command(tmp_path, forecasts):
    WALKS.to_csv(tmp_path / "walk.csv", index=False)
    for name in ("theirs.csv", "theirs.parquet"):
        main(["predict", str(tmp_path / "walk.csv"), "-o", str(tmp_path / name)])
    exact = pd.read_parquet(tmp_path / "theirs.parquet")
    assert tuple(exact.columns) == tuple(forecasts.columns) == COLUMNS
    by = ["track", "time", "mode", "step"]
    here = forecasts.sort_values(by, ignore_index=True)
    pd.testing.assert_frame_equal(here, exact.sort_values(by, ignore_index=True), check_dtype=False)
    rounded, read = (read_forecasts(tmp_path / f"theirs.{kind}", None) for kind in ("csv", "parquet"))
    np.testing.assert_allclose(rounded.path, read.path, atol=1e-4)
    np.testing.assert_array_equal(rounded.track_id, read.track_id)


def test_forecasts_lie_ahead_of_who_walks_straight(forecasts):
    last = forecasts[(forecasts.time == WALKS.time.max()) & (forecasts.step == 10)]
    best = last.loc[last.groupby("track").weight.idxmax()]
    np.testing.assert_allclose(best.x, WALKS.x.max() + 3.0, atol=1.0)  # 1 m/s for 3 s
    np.testing.assert_allclose(forecasts.groupby(["track", "time", "step"]).weight.sum(), 1.0)


def test_ids_names_units_and_frames_are_those_of_the_table(forecasts):
    own = pd.DataFrame(
        {"frame": (WALKS.time / 0.4).round().astype(int), "ped_id": WALKS.id.map({1: "Ann", 2: "Bo"})}
    )
    own["x"], own["y"] = 100 * WALKS.x, 100 * WALKS.y
    found = pedpred.predict(own, rate_hz=2.5, unit="cm")
    assert set(found.track) == {"Ann", "Bo"}
    np.testing.assert_allclose(found[["time", "x", "y"]], forecasts[["time", "x", "y"]], atol=1e-6)


def test_a_map_changes_forecasts_and_may_be_a_path(tmp_path, forecasts):
    cells = np.zeros((120, 80), bool)
    cells[70:80] = True
    ground = OccupancyMap(cells, np.array([-3.0, -2.0]), 0.1)
    write_map(ground, tmp_path)
    with_map = pedpred.predict(WALKS, ground)
    assert not np.allclose(with_map.x, forecasts.x)
    np.testing.assert_allclose(pedpred.predict(WALKS, str(tmp_path)).x, with_map.x)


@pytest.mark.parametrize(
    ("change", "error", "named"),
    [
        (lambda t: t.drop(columns="x"), InputError, "table: no column for x; there are time, id, y"),
        (lambda t: t.assign(time=t.time.where(t.index != 3)), InputError, "row 4: time is missing"),
        (
            lambda t: t.assign(x=t.x.astype(object).where(t.index != 3, "here")),
            InputError,
            "row 4: x = 'here'",
        ),
        (lambda t: t.assign(id=1), InputError, "row 2: id 0 is at another place"),
        (
            lambda t: t.assign(type=["car", "person"] * 8, x=t.x.astype(object).where(t.index != 5, "here")),
            InputError,
            "row 6: x = 'here'",
        ),
        (
            lambda t: t.rename(columns={"time": "frame"}).round().drop_duplicates(["frame", "id"]),
            InputError,
            "rate",
        ),
        (lambda t: t.assign(x=100 * t.x, y=100 * t.y), InputError, "faster than people walk"),
        (lambda t: t.assign(time=1000 * t.time), InputError, "looks like milliseconds"),
    ],
)
def test_what_is_wrong_with_a_frame_is_said(change, error, named):
    with pytest.raises(error, match=named):
        pedpred.predict(change(WALKS))


@pytest.mark.parametrize("nothing", [np.nan, None, pd.NA])
def test_rows_without_a_position_are_missing_detections_as_in_files(caplog, nothing):
    gap = WALKS.assign(id=WALKS.id.map({1: "Ann", 2: "Bo"})).astype(object)
    gap.loc[5, ["x", "y"]] = nothing
    found = pedpred.predict(gap)
    assert "dropped 1 rows without a position, the first in line 6" in caplog.text
    pd.testing.assert_frame_equal(found, pedpred.predict(gap.drop(index=5)))
    vehicles = pd.concat([WALKS, pd.DataFrame({"time": [0.2, 0.6]})], ignore_index=True)
    pd.testing.assert_frame_equal(pedpred.predict(vehicles), pedpred.predict(WALKS), check_dtype=False)


def test_rows_that_repeat_another_one_are_left_out_as_in_files(caplog, forecasts):
    pd.testing.assert_frame_equal(pedpred.predict(pd.concat([WALKS, WALKS[:3]])), forecasts)
    assert "dropped 3 rows that repeat another one" in caplog.text


def test_a_map_may_be_a_geometry_as_for_the_command(tmp_path, forecasts):
    """Walls that cross the way of both people change where they are forecast."""
    (tmp_path / "room.wkt").write_text("POLYGON ((-1 0, 4 0, 4 5, -1 5, -1 0))")
    WALKS.to_csv(tmp_path / "walk.csv", index=False)
    found = pedpred.predict(WALKS, tmp_path / "room.wkt")
    given = ["--map", str(tmp_path / "room.wkt"), "-o", str(tmp_path / "theirs.parquet")]
    main(["predict", str(tmp_path / "walk.csv"), *given])
    by = ["track", "time", "mode", "step"]
    theirs = pd.read_parquet(tmp_path / "theirs.parquet").sort_values(by, ignore_index=True)
    pd.testing.assert_frame_equal(found.sort_values(by, ignore_index=True), theirs, check_dtype=False)
    assert not np.allclose(found.x, forecasts.x)


@pytest.mark.parametrize(
    ("change", "said"), [({"type": WALKS.id.map({1: "car", 2: "person"})}, "other classes: 8 of 'car'")]
)
def test_columns_beside_mean_what_they_mean_in_files(change, said, tmp_path, caplog):
    table = WALKS.assign(**change)
    table.to_csv(tmp_path / "walk.csv", index=False)
    main(["predict", str(tmp_path / "walk.csv"), "-o", str(tmp_path / "theirs.parquet")])
    theirs = pd.read_parquet(tmp_path / "theirs.parquet")
    assert said in caplog.text
    caplog.clear()
    found = pedpred.predict(table)
    assert said in caplog.text
    np.testing.assert_array_equal(found[["track", "time", "x"]], theirs[["track", "time", "x"]])


@pytest.mark.parametrize(
    "change",
    [
        lambda t: t.set_index("time"),
        lambda t: t.set_index(["id", "time"]),
        lambda t: t.assign(time=pd.to_datetime(t.time + 1709683200, unit="s", utc=True)).set_index("time"),
    ],
    ids=["index", "levels of the index", "dates"],
)
def test_a_table_means_what_the_file_of_it_means(change, tmp_path, forecasts):
    """Columns that pandas keeps in an index are columns of the file."""
    table = change(WALKS)
    found = pedpred.predict(table)
    np.testing.assert_allclose(found[["track", "x", "y"]], forecasts[["track", "x", "y"]], atol=1e-4)
    table.to_csv(tmp_path / "walk.csv")
    main(["predict", str(tmp_path / "walk.csv"), "-o", str(tmp_path / "theirs.parquet")])
    by, theirs = ["track", "time", "mode", "step"], pd.read_parquet(tmp_path / "theirs.parquet")
    found, theirs = (each.sort_values(by, ignore_index=True) for each in (found, theirs))
    pd.testing.assert_frame_equal(found, theirs, check_dtype=False)


@pytest.mark.parametrize("called", [{1: 70, 2: 2**53 + 1}, {1: "Ann", 2: "Bo"}, {1: 0.5, 2: 1.5}])
def test_ids_may_be_anything_that_is_not_missing(forecasts, called):
    ids = WALKS.id.map(called)
    found = pedpred.predict(WALKS.assign(agent=ids).drop(columns="id"), columns={"id": "agent"})
    assert found.track.tolist() == forecasts.track.map(called).tolist()


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_forecasts_of_the_command_are_of_the_names_in_the_file(tmp_path, kind, capsys):
    """Also of names that are numbers of somebody else, and `evaluate` measures them as the network's."""
    names = {1: "Bo", 2: "0"}
    walks = pd.concat([WALKS.assign(time=WALKS.time + 3.2 * k, x=WALKS.x + 3.2 * k) for k in range(3)])
    walks.assign(id=walks.id.map(names)).to_csv(tmp_path / "walk.csv", index=False)
    theirs = tmp_path / f"theirs.{kind}"
    main(["predict", str(tmp_path / "walk.csv"), "-o", str(theirs)])
    read = pd.read_csv(theirs, dtype={"track": str}) if kind == "csv" else pd.read_parquet(theirs)
    assert set(read.track) == set(names.values())
    capsys.readouterr()
    main(["evaluate", str(tmp_path / "walk.csv"), "--forecasts", str(theirs)])
    rows = {line.split()[0]: line.split()[1] for line in capsys.readouterr().out.splitlines()[2:7] if line}
    assert float(rows["theirs"]) < 0.2, "those of the same people"
    read.assign(track=read.track.map({"Bo": "Cy", "0": "Di"})).to_csv(tmp_path / "others.csv", index=False)
    with pytest.raises(SystemExit, match="forecasts are of Cy, Di; tracks of the recording are Bo, 0"):
        main(["evaluate", str(tmp_path / "walk.csv"), "--forecasts", str(tmp_path / "others.csv")])


def test_numbers_that_a_file_is_told_to_have_still_mean_its_people(tmp_path, capsys):
    """Forecasts that call tracks by the numbers which `pedpred info` names."""
    walks = pd.concat([WALKS.assign(time=WALKS.time + 3.2 * k, x=WALKS.x + 3.2 * k) for k in range(3)])
    walks.assign(id=walks.id.map({1: "Ann", 2: "Bo"})).to_csv(tmp_path / "walk.csv", index=False)
    pedpred.predict(walks.assign(id=walks.id - 1)).to_csv(tmp_path / "theirs.csv", index=False)
    main(["evaluate", str(tmp_path / "walk.csv"), "--forecasts", str(tmp_path / "theirs.csv")])
    rows = {line.split()[0]: line.split()[1] for line in capsys.readouterr().out.splitlines()[2:7] if line}
    assert float(rows["theirs"]) < 0.2


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"x": "a"}, "row 1: x = 'a' is not a number"),
        ({"x": np.nan}, "x is missing"),
        ({"x": np.inf}, "x = inf is not finite"),
        ({"step": 0.5}, "step = 0.5, but it must be a whole number"),
        ({"track": 0.5}, "id = '0.5' is not a whole number"),
    ],
)
def test_what_is_wrong_with_forecasts_in_parquet_is_said(tmp_path, forecasts, change, named):
    forecasts.assign(**change).to_parquet(tmp_path / "theirs.parquet")
    with pytest.raises(InputError, match=rf"theirs\.parquet.*{named}"):
        read_forecasts(tmp_path / "theirs.parquet", None)


@pytest.mark.parametrize("kind", ["float64", "float32", "int8", "uint16"])
def test_whole_numbers_in_parquet_may_be_of_any_type(tmp_path, forecasts, kind):
    """A column that once missed a value, or was merged, is one of floats."""
    forecasts.to_parquet(tmp_path / "usual.parquet")
    forecasts.astype(dict.fromkeys(("track", "mode", "step"), kind)).to_parquet(tmp_path / "theirs.parquet")
    usual, theirs = (read_forecasts(tmp_path / f"{name}.parquet", None) for name in ("usual", "theirs"))
    np.testing.assert_array_equal(theirs.track_id, usual.track_id)
    np.testing.assert_array_equal(theirs.path, usual.path)


def test_a_column_that_is_missing_in_parquet_is_named(tmp_path, forecasts):
    forecasts.drop(columns="x").to_parquet(tmp_path / "theirs.parquet")
    with pytest.raises(InputError, match="no column x"):
        read_forecasts(tmp_path / "theirs.parquet", None)


@pytest.mark.parametrize(
    "wrong",
    [
        {"table": WALKS.to_dict("list")},
        {"occupancy": np.zeros((3, 3))},
        {"occupancy": 5},
        {"rate_hz": "10"},
        {"model": 5},
    ],
)
def test_an_argument_of_another_kind_is_refused_by_name(wrong):
    with pytest.raises(ValueRuleError, match=f"(?s){next(iter(wrong))} = .*it must be an? "):
        pedpred.predict(**{"table": WALKS, **wrong})
