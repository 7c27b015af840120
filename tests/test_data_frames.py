"""`pedpred.predict`: forecasts of a data frame in one call are those of the command, also as Parquet."""

import ast
import logging
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import pedpred
from pedpred import tables
from pedpred.command import main
from pedpred.command.forecast_tables import COLUMNS
from pedpred.command.foreign import read_forecasts
from pedpred.errors import FileError, SourceError, ValueRuleError, worded
from pedpred.scenes import OccupancyMap
from pedpred.sources import doubts, plausibility, times
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
        (lambda t: t.drop(columns="x"), ValueRuleError, "no column for x_m"),
        (lambda t: t.assign(time=t.time.where(t.index != 3)), SourceError, "line 4: time = '' is not a"),
        (lambda t: t.assign(id=t.id.where(t.index != 3)), ValueRuleError, "row 4 has no id"),
        (
            lambda t: t.rename(columns={"time": "frame"}).round().drop_duplicates(["frame", "id"]),
            SourceError,
            "rate",
        ),
        (lambda t: t.assign(x=100 * t.x, y=100 * t.y), SourceError, "faster than people walk"),
        (lambda t: t.assign(time=1000 * t.time), SourceError, "looks like milliseconds"),
        (lambda t: t.assign(x=13 + 1e-7 * t.x, y=52 + 1e-7 * t.y), SourceError, "look like degrees"),
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
    assert "1 row, the first in line 6" in caplog.text
    pd.testing.assert_frame_equal(found, pedpred.predict(gap.drop(index=5)))
    vehicles = pd.concat([WALKS, pd.DataFrame({"time": [0.2, 0.6]})], ignore_index=True)
    pd.testing.assert_frame_equal(pedpred.predict(vehicles), pedpred.predict(WALKS), check_dtype=False)


def test_rows_that_repeat_another_one_are_left_out_as_in_files(caplog, forecasts):
    pd.testing.assert_frame_equal(pedpred.predict(pd.concat([WALKS, WALKS[:3]])), forecasts)
    assert "3 rows" in caplog.text


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


DAYS = pd.to_datetime(WALKS.time + 1709683197, unit="s")  # through midnight


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"date": DAYS.dt.date, "time": DAYS.dt.time}, ""),
        ({"scene": WALKS.id.map({1: "a", 2: "b"})}, "column scene holds a, b"),
        ({"type": WALKS.id.map({1: "car", 2: "person"})}, "left out: 8 of 'car'"),
    ],
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


PLACES = pd.MultiIndex.from_tuples([("time", ""), ("id", ""), ("pos", "x"), ("pos", "y")])


@pytest.mark.parametrize(
    "change",
    [
        lambda t: t.set_index("time"),
        lambda t: t.set_index(["id", "time"]),
        lambda t: t.assign(time=pd.to_datetime(t.time + 1709683200, unit="s", utc=True)).set_index("time"),
        lambda t: t.set_axis(PLACES, axis="columns"),
        lambda t: t.set_axis(PLACES, axis="columns").set_index(("time", "")).rename_axis("time"),
    ],
    ids=["index", "levels of the index", "dates", "levels of titles", "both"],
)
def test_a_table_means_what_the_file_of_it_means(change, tmp_path, forecasts):
    """Columns that pandas keeps in an index are columns of the file, and levels of titles one title."""
    table = change(WALKS)
    found = pedpred.predict(table)
    np.testing.assert_allclose(found[["track", "x", "y"]], forecasts[["track", "x", "y"]], atol=1e-4)
    table.to_csv(tmp_path / "walk.csv")
    main(["predict", str(tmp_path / "walk.csv"), "-o", str(tmp_path / "theirs.parquet")])
    by, theirs = ["track", "time", "mode", "step"], pd.read_parquet(tmp_path / "theirs.parquet")
    found, theirs = (each.sort_values(by, ignore_index=True) for each in (found, theirs))
    pd.testing.assert_frame_equal(found, theirs, check_dtype=False)


@pytest.mark.parametrize("name", ["id", "frame", "ped_id", "y", "row"])
def test_an_index_beside_columns_that_say_everything_is_not_read(name, forecasts):
    numbered = WALKS.set_axis(pd.Index(range(100, 116), name=name))
    pd.testing.assert_frame_equal(pedpred.predict(numbered), forecasts)


def test_heights_in_place_of_positions_are_refused():
    with pytest.raises(SourceError, match="y looks like a height"):
        pedpred.predict(WALKS.assign(z=WALKS.x + WALKS.y, y=1.7))


@pytest.mark.parametrize(
    ("change", "remedy"),
    [
        ({"time": None, "frame": range(16)}, "how many frames a second has: rate_hz"),
        ({"x": 1000 * WALKS.x, "y": 1000 * WALKS.y}, 'unit="mm" if lengths are mm, unit="m" if they'),
        (
            {"x": None, "x_px": WALKS.x, "y": None, "y_px": WALKS.y},
            "size is unknown. Bring them to metres first",
        ),
        ({"z": WALKS.x, "y": 1.7}, r"table.columns = \['time', 'id', 'x', 'height', 'y'\]"),
        ({"x": None}, r"There are time \| id \| y$"),
        ({"x": 1e12 + WALKS.x}, "at most 1e\\+08 from 0.*Correct these values"),
        ({"x": "", "y": ""}, "no detections.*Give a table with tracks"),
        ({"time": 0.0, "id": [1] * 8 + [2] * 8}, "make a table for each|Write times with more decimals"),
    ],
)
def test_a_remedy_is_one_for_a_table(change, remedy):
    table = WALKS.assign(**change).dropna(axis="columns", how="all")
    with pytest.raises((SourceError, ValueRuleError), match=remedy) as refused:
        pedpred.predict(table)
    assert not re.search(r"--|\bfiles?\b", str(refused.value))


@pytest.mark.parametrize(
    ("change", "arguments", "said"),
    [
        ({"type": ["chair", "car"] * 8}, {}, "all rows are read; leave out the rows of others"),
        ({}, {"rate_hz": 2.5}, "times are in column time, so that rate_hz is not used"),
        ({"x": 4 * WALKS.x}, {}, 'which is running: say unit="ft" if lengths are ft, or unit="m"'),
        ({"scene": ["a", "b"] * 8}, {}, "divide the table if they are several"),
        ({"x": WALKS.x / 10, "y": WALKS.y / 10}, {}, "Then bring them to metres first"),
        ({"time": (2.5 * WALKS.time).round()}, {}, "call the column frame, and give rate_hz"),
    ],
)
def test_a_warning_is_one_for_a_table(change, arguments, said, caplog):
    pedpred.predict(WALKS.assign(**change), **arguments)
    assert said in caplog.text
    assert "--" not in caplog.text
    caplog.clear()
    logging.getLogger("pedpred.tables.reading").warning("say --rate")
    assert "say --rate" in caplog.text, "afterwards the command has its own words"


def test_every_message_about_a_table_has_words_for_python():
    """Options of the command stand in the first words of a choice, whose second ones have none."""
    of_files = {"comments.py", "lines.py"}  # what only texts have
    modules = [
        *Path(tables.__path__[0]).glob("*.py"),
        Path(plausibility.__file__),
        Path(doubts.__file__),
        Path(times.__file__),
    ]
    for module in [module for module in modules if module.name not in of_files]:
        tree = ast.parse(module.read_text(encoding="utf-8"))
        calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
        choices = [call.args for call in calls if getattr(call.func, "id", None) == "worded"]
        chosen = {node for first, _ in choices for node in ast.walk(first)}
        for node in {*ast.walk(tree)} - chosen:
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and "\n" not in node.value:
                assert not re.search(r"--[a-z]", node.value), (module.name, node.value)


def test_words_for_python_end_with_the_call():
    with pytest.raises(SourceError, match="give unit"):
        pedpred.predict(WALKS.rename(columns={"x": "x [cm]"}))
    assert worded("--unit", "unit") == "--unit"


def test_ids_mean_what_they_mean_in_files(forecasts, caplog):
    """The id -1 means nobody, and an error names the id of the table, whatever it is."""
    nobody = pd.DataFrame({"time": [0.4, 0.4, 0.8], "id": -1, "x": [9.0, 8.0, 7.0], "y": 0.0})
    pd.testing.assert_frame_equal(pedpred.predict(pd.concat([WALKS, nobody])), forecasts)
    assert "rows with the id -1 are about nobody" in caplog.text
    for called in ({1: 70, 2: 2**53 + 1}, {1: "Ann", 2: "Bo"}, {1: 0.5, 2: 1.5}, {1: "1", 2: 1}):
        ids = WALKS.id.map(called).astype(object if isinstance(called[1], str) else type(called[1]))
        found = pedpred.predict(WALKS.assign(id=ids))
        assert found.track.tolist() == forecasts.track.map(called).tolist()
        twice = WALKS.assign(id=ids, time=WALKS.time.where(WALKS.index != 5, 0.0))
        with pytest.raises(SourceError, match=f"line 6: track_id {called[2]} and time_s 0 again"):
            pedpred.predict(twice)


def test_an_error_names_the_row_of_the_whole_table():
    table = WALKS.assign(type=["car", "person"] * 8, x=WALKS.x.astype(object))
    table.loc[5, "x"] = "here"
    with pytest.raises(SourceError, match="line 6: x = 'here'"):
        pedpred.predict(table)
    with pytest.raises(ValueRuleError, match="row 6 has no id"):
        pedpred.predict(WALKS.assign(type=table.type, id=WALKS.id.where(WALKS.index != 5)))


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
        ({"x": "a"}, "column x: .*not numbers"),
        ({"x": np.nan}, "column x: .*missing values"),
        ({"x": np.inf}, "column x holds other values than finite numbers"),
        ({"track": 0.5}, "column track holds other values than whole numbers"),
        ({"track": [None, *"Bo"] * 320}, "column track has 320 missing values"),
    ],
)
def test_what_is_wrong_with_forecasts_in_parquet_is_said(tmp_path, forecasts, change, named):
    forecasts.assign(**change).to_parquet(tmp_path / "theirs.parquet")
    with pytest.raises(FileError, match=rf"theirs\.parquet.*{named}"):
        read_forecasts(tmp_path / "theirs.parquet", None)


@pytest.mark.parametrize("kind", ["float64", "float32", "int8", "uint16"])
def test_whole_numbers_in_parquet_may_be_of_any_type(tmp_path, forecasts, kind):
    """A column that once missed a value, or was merged, is one of floats."""
    forecasts.to_parquet(tmp_path / "usual.parquet")
    forecasts.astype(dict.fromkeys(("track", "mode", "step"), kind)).to_parquet(tmp_path / "theirs.parquet")
    usual, theirs = (read_forecasts(tmp_path / f"{name}.parquet", None) for name in ("usual", "theirs"))
    np.testing.assert_array_equal(theirs.track_id, usual.track_id)
    np.testing.assert_array_equal(theirs.path, usual.path)


def test_ids_that_floats_have_rounded_are_refused(tmp_path, forecasts):
    forecasts.assign(track=2.0**53).to_parquet(tmp_path / "theirs.parquet")
    with pytest.raises(SourceError, match="column track holds other values than whole numbers"):
        read_forecasts(tmp_path / "theirs.parquet", None)


def test_a_column_that_is_missing_in_parquet_is_named(tmp_path, forecasts):
    forecasts.drop(columns="x").to_parquet(tmp_path / "theirs.parquet")
    with pytest.raises(SourceError, match="no column x"):
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
