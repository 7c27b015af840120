"""Tables of tracks: how they may look, and what is said about those that cannot be read."""

import re

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pedpred.errors import FileError, SourceError, StorageError, ValueRuleError
from pedpred.scenes import Trajectories
from pedpred.storage.tracks import read_parquet_tracks, tracks_table, write_parquet_tracks
from pedpred.tables import text
from pedpred.tables.options import TableOptions
from pedpred.tables.reading import read_table
from pedpred.tables.titles import NAMES
from tests.scenes import assert_same, scenes

ROWS = [(0.5 * k, who, 0.5 * k + who, -0.25 * k) for k in range(5) for who in (3, 7)]
TRACKS = Trajectories(
    *map(np.array, zip(*[(t, who) for t, who, *_ in ROWS], strict=True)), [r[2:] for r in ROWS]
)


def lines(separator, header=("time", "id", "x", "y"), rows=ROWS):
    return [separator.join(map(str, row)) for row in ([header] if header else []) + list(rows)]


@pytest.fixture
def write(tmp_path):
    def written(content):
        path = tmp_path / "tracks.csv"
        path.write_text("\n".join(content) + "\n")
        return path

    return written


@pytest.mark.parametrize("separator", [",", ";", "\t", " ", ", ", "   "])
def test_any_separator_is_found(write, separator):
    assert_same(read_table(write(lines(separator))), TRACKS)


@given(st.data())
@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_alias_in_any_order_beside_other_columns(write, data):
    named = [data.draw(st.sampled_from(NAMES[name])) for name in ("time_s", "track_id", "x_m", "y_m")]
    order = data.draw(st.permutations(range(5)))
    header = [(*named, "note")[k] for k in order]
    rows = [[(*map(str, row), "'a b'")[k] for k in order] for row in ROWS]
    assert_same(read_table(write(lines(",", header, rows))), TRACKS)
    assert_same(read_table(write(lines(";", [f'"{title.upper()}"' for title in header], rows))), TRACKS)


def test_columns_may_be_named_by_the_caller(write):
    assert_same(read_table(write(lines(",", None)), TableOptions(("t", "id", "x", "y"))), TRACKS)
    rows = [(who, 9, y, x, t) for t, who, x, y in ROWS]
    options = TableOptions(("id", "_", "y", "x", "t"))
    assert_same(read_table(write(lines(" ", None, rows)), options), TRACKS)
    assert_same(
        read_table(write(["# measured", *lines(" ", ("a", "b", "c", "d", "e"), rows)]), options), TRACKS
    )


def test_a_clock_may_count_frames_or_milliseconds(write):
    frames = [(round(8 * t), *rest) for t, *rest in ROWS]
    path = write(lines(",", ("frame", "id", "x", "y"), frames))
    assert_same(read_table(path, TableOptions(rate_hz=8.0)), TRACKS)
    with pytest.raises(SourceError, match=r"frame numbers, but no rate.*--rate"):
        read_table(path)
    millis = [(round(1000 * t), *rest) for t, *rest in ROWS]
    assert_same(read_table(write(lines(",", ("time_ms", "id", "x", "y"), millis))), TRACKS)


def test_a_comment_may_be_the_header(write):
    assert_same(read_table(write(["# a walk", *(f"#{h}" for h in lines(" ")[:1]), *lines(" ")[1:]])), TRACKS)


@pytest.mark.parametrize("columns", [("time", "id", "x", "y"), ("time", "id", "x", "y", "a", "b")])
def test_too_few_or_too_many_names_of_columns_are_no_fault_of_the_line(write, columns):
    path = write([f"{k},1,{k},2,9" for k in range(3)])
    with pytest.raises(SourceError, match=r"5 columns, expected [46].*--columns names all columns in order"):
        read_table(path, TableOptions(columns))


@given(row=st.integers(1, len(ROWS)), many=st.booleans(), separator=st.sampled_from(",;\t "))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_row_with_a_value_too_many_or_too_few_is_named(write, row, many, separator):
    content = lines(separator)
    content[row] = f"{content[row]}{separator}9" if many else content[row].rpartition(separator)[0]
    with pytest.raises(
        SourceError, match=rf"tracks\.csv, line {row + 1}: {5 if many else 3} columns"
    ) as error:
        read_table(write(content))
    assert error.value.line == row + 1


@pytest.mark.parametrize(
    ("content", "named"),
    [
        ("", "no detections, the file is empty"),
        ("time,id,x\n0,1,2\n", r"no column for y_m, .* y, y_m, pos_y.* There are time \| id \| x;"),
        (
            "when~who~x~y\n0~1~2~3\n",
            "no column for time_s.* t, time, .* There are when~who~x~y.*semicolons, tabs, . or blanks",
        ),
        ("time,t,id,x,y\n0,0,1,2,3\n", "columns time and t are both time_s"),
        ("0,1,2,3\n", "line 1: no header, the first line is '0,1,2,3'.*--columns time,id,x,y"),
        ("time,id,x,y\n0,1,2,left\n", "line 2: y = 'left' is not a number"),
        ("time;id;x;y\n0;1;1.002,5;3\n", "line 2: x = '1.002,5' is not a number"),
        ("time;id;x;y\n0;1;2,5;3\n1;1;2.5;3\n", "line 3: .* commas in line 2 and points in line 3.*without"),
        ("time,id,x,y\n0,1,2,5,3\n", "line 2: 5 columns, .*decimal ones.*semicolons"),
        ("time,id,x,y\n0,1,inf,3\n", "line 2: x = 'inf', but it must be finite"),
        ("time,id,x,y\n0,1.5,2,3\n", "line 2: id = 1.5, but it must be a whole number"),
        (f"frame,id,x,y\n{2**63},1,2,3\n", "line 2: frame = 9223372036854775808, but .* 64 bits"),
        (
            "time,id,x,y\n0,1,2,3\n\n1,1,2,3\n0,1,2,4\n",
            "line 5: .* again, first in line 2",
        ),
        ("time,id,x,y\n0,1,2," + "3" * 70_000, "line 2"),
    ],
)
def test_what_is_wrong_is_said(write, content, named):
    with pytest.raises(SourceError, match=named.replace("|", r"\|")) as error:
        read_table(write([content]))
    assert "tracks.csv" in str(error.value)
    assert "dvc" not in str(error.value)


@pytest.mark.parametrize("columns", [("t", "id", "x"), ("t", "t", "id", "x", "y"), ()])
def test_columns_of_the_caller_are_checked(columns):
    with pytest.raises(ValueRuleError, match="columns"):
        TableOptions(columns)


@pytest.mark.parametrize("rate_hz", [0.0, -1.0, np.nan, np.inf])
def test_a_rate_is_checked(rate_hz):
    with pytest.raises(ValueRuleError, match="rate_hz"):
        TableOptions(rate_hz=rate_hz)


@given(st.lists(st.integers(-(2**62), 2**62), unique=True, min_size=1, max_size=5))
@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_ids_of_64_bits_are_exact_in_text_and_parquet(write, tmp_path, ids):
    path = write(["time,id,x,y", *(f"0,{who},0,0" for who in ids)])
    assert sorted(read_table(path).track_id.tolist()) == sorted(ids)
    table = pd.DataFrame({"time_s": 0.0, "track_id": ids, "x_m": 0.0, "y_m": 0.0})
    table.to_parquet(tmp_path / "tracks.parquet")
    assert sorted(read_parquet_tracks(tmp_path / "tracks.parquet").track_id.tolist()) == sorted(ids)


@given(scenes())
@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_parquet_there_and_back(tmp_path, scene):
    write_parquet_tracks(scene.trajectories, tmp_path / "tracks.parquet")
    assert_same(read_parquet_tracks(tmp_path / "tracks.parquet"), scene.trajectories)


@pytest.mark.parametrize("content", [b"time,id,x,y\n0,1,2,\x81\n", "time,id,x,y\n".encode("utf-16")[:-1]])
def test_what_is_no_text_is_said(write, content):
    path = write([])
    path.write_bytes(content)
    with pytest.raises(SourceError, match="not a readable text file"):
        read_table(path)


# Bounds


def test_other_columns_are_not_decoded(tmp_path):
    """A small file with a dictionary column that would fill the memory."""
    table = tracks_table(TRACKS).assign(
        note=pd.Categorical(["a" * 2**20] * len(TRACKS)), fields=[[1]] * len(TRACKS)
    )
    table.to_parquet(tmp_path / "tracks.parquet")
    assert_same(read_parquet_tracks(tmp_path / "tracks.parquet"), TRACKS)


@pytest.mark.parametrize("kind", ["category", "string"])
def test_a_needed_column_of_another_type_is_refused_before_it_is_decoded(tmp_path, kind):
    table = tracks_table(TRACKS)
    table["x_m"] = table["x_m"].astype(str).astype(kind)
    table.to_parquet(tmp_path / "tracks.parquet")
    with pytest.raises(StorageError, match=r"column x_m: .*not numbers"):
        read_parquet_tracks(tmp_path / "tracks.parquet")


def test_rows_are_bounded_before_they_are_decoded(tmp_path, write, monkeypatch):
    write_parquet_tracks(TRACKS, tmp_path / "tracks.parquet")
    monkeypatch.setattr("pedpred.storage.tracks.MOST_NUMBERS", 4 * len(TRACKS) - 1)
    monkeypatch.setattr("pedpred.storage.tracks.read_columns", lambda *_: pytest.fail("it was decoded"))
    with pytest.raises(StorageError, match=re.escape(f"{len(TRACKS)} rows of 4 numbers")):
        read_parquet_tracks(tmp_path / "tracks.parquet")
    monkeypatch.setattr(text, "MOST_NUMBERS", 20)
    with pytest.raises(FileError, match="more than 4 rows"):
        read_table(write(lines(",")))
