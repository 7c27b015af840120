"""Tables of tracks: every way to say what a table holds gives the same people; others are refused by line."""

import gzip
from functools import partial

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pedpred.command import main
from pedpred.errors import InputError
from pedpred.reading import read_recording
from pedpred.reading.options import UNITS, ReadOptions
from pedpred.reading.table import TITLES
from pedpred.scenes import Trajectories
from pedpred.sources.scene_folder import read_folder
from pedpred.storage.tracks import read_parquet_tracks, tracks_table, write_parquet_tracks
from tests.refused import refused, unread
from tests.scenes import assert_same

ROWS = [(0.5 * k, who, 0.5 * k + who, -0.25 * k) for k in range(12) for who in (3, 7)]
TRACKS = Trajectories([t for t, *_ in ROWS], [who for _, who, *_ in ROWS], [row[2:] for row in ROWS])
HEADER = ("time", "id", "x", "y")
LABELS = ["pedestrian", "Child", "human.pedestrian.adult", "person_using_crutches", "wheelchair", "stroller"]
EACH = settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])


def lines(separator=",", header=HEADER, rows=ROWS):
    return [separator.join(map(str, row)) for row in ([header] if header else []) + list(rows)]


@pytest.fixture
def write(tmp_path):
    def written(content, encoding="utf-8"):
        path = tmp_path / "walk.csv"
        path.write_bytes("\n".join([*content, ""]).encode(encoding))
        return path

    return written


def people_in(path, **options):
    return read_recording(path, ReadOptions(**options)).scene.trajectories


@given(st.data())
@EACH
def test_any_spelling_is_the_same_people(write, data):
    """Separators, order and titles of columns, units, other columns, comments, decimal marks, encodings."""
    separator = data.draw(st.sampled_from([",", ";", "\t", " ", ", ", "   ", "|"]))
    unit = data.draw(st.sampled_from(list(UNITS)))
    clock = data.draw(st.sampled_from(["s", "ms", "us", "ns"]))
    title = {name: data.draw(st.sampled_from(TITLES[name])) for name in ("time", "id", "x", "y")}
    title["time"] += f"_{clock}" if clock != "s" else ""
    form = data.draw(st.sampled_from(["{}_{}", "{}[{}]", "{}/{}"]))
    title |= {axis: form.format(title[axis], unit) for axis in "xy"}
    order = data.draw(st.permutations(range(5)))
    per_s = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}[clock]
    rows = [(t * per_s, who, x / UNITS[unit], y / UNITS[unit]) for t, who, x, y in ROWS]
    decimal = data.draw(st.sampled_from(".," if separator not in (",", ", ") else "."))
    rows = [[*(str(value).replace(".", decimal) for value in row), "note"] for row in rows]
    header = [*(title[name] for name in HEADER), "speed_x"]
    content = lines(separator, None, [[row[k] for k in order] for row in [header, *rows]])
    encoding = data.draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "cp1252"]))
    comments = ["# Jülich"] * data.draw(st.integers(0, 2))
    options = {"decimal": decimal, "encoding": encoding if encoding == "cp1252" else None}
    found = people_in(write([*comments, *content], encoding), **options)
    np.testing.assert_allclose(found.time_s, TRACKS.time_s)
    np.testing.assert_allclose(found.position, TRACKS.position)
    np.testing.assert_array_equal(found.track_id, TRACKS.track_id)


def test_columns_may_be_named_by_title_or_by_position(write):
    rows = [(who, 9, y, x, t) for t, who, x, y in ROWS]
    own = write(lines(",", ("agent", "id", "py", "px", "t_ros"), rows))
    assert_same(people_in(own, columns={"time": "t_ros", "id": "agent", "x": "px", "y": "py"}), TRACKS)
    for header in (None, ("a", "b", "c", "d", "e")):
        path = write(["# measured", *lines(" ", header, rows)])
        assert_same(people_in(path, columns=("id", "_", "y", "x", "time")), TRACKS)
    with unread(path, remedy="x=TITLE,y=TITLE"):
        people_in(path, columns={"time": "a", "id": "b"})


@pytest.mark.parametrize("comments", [["# framerate: 2", "# id frame x/m y/m"], ["# x [cm], 2 fps"]])
def test_comments_say_rate_and_unit_of_frames(write, comments):
    found = people_in(write([*comments, *lines(" ", None, [(w, int(2 * t), x, y) for t, w, x, y in ROWS])]))
    np.testing.assert_allclose(found.position, (0.01 if "cm" in comments[0] else 1.0) * TRACKS.position)
    np.testing.assert_allclose(found.time_s, TRACKS.time_s)


def test_dates_of_iso_8601_are_seconds(write):
    days = pd.to_datetime(1_709_683_190 + np.array([row[0] for row in ROWS]), unit="s")  # through midnight
    for text in (days.strftime("%Y-%m-%dT%H:%M:%S.%fZ"), days.tz_localize("UTC").astype(str)):
        found = people_in(write(lines(rows=[(d, *row[1:]) for d, row in zip(text, ROWS, strict=True)])))
        np.testing.assert_allclose(found.time_s - 1_709_683_190, TRACKS.time_s, atol=1e-6)
    path = write(lines(rows=[("5.3.2024", *row[1:]) for row in ROWS]))
    with unread(path, remedy="ISO 8601"):
        people_in(path)


def test_a_table_may_be_compressed_with_gzip_within_a_bound(write, monkeypatch):
    path = write(lines())
    packed = path.with_name("walk.csv.gz")
    packed.write_bytes(gzip.compress(path.read_bytes()))
    assert_same(people_in(packed), TRACKS)
    monkeypatch.setattr("pedpred.reading._LARGEST_BYTES", 100)
    with unread(packed):
        people_in(packed)


def test_a_folder_may_hold_one_person_per_file(tmp_path):
    for who in (3, 7):
        rows = [(t, x, y) for t, one, x, y in ROWS if one == who]
        (tmp_path / f"walker_{who}.csv").write_text("\n".join(lines(",", ("timestamp", "x", "y"), rows)))
    recording = read_recording(tmp_path, ReadOptions(one_person_per_file=True))
    assert recording.names.of_number == {0: "walker_3", 1: "walker_7"}
    np.testing.assert_array_equal(recording.scene.trajectories.time_s, TRACKS.time_s)


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".feather"])
def test_a_table_of_any_kind_is_read_within_a_bound(tmp_path, suffix, monkeypatch):
    frame = pd.DataFrame(ROWS, columns=["time", "ped_id", "x [cm]", "y [cm]"]).assign(note="a")
    frame[["x [cm]", "y [cm]"]] *= 100
    path = tmp_path / f"walk{suffix}"
    write = {".parquet": frame.to_parquet, ".feather": frame.to_feather}
    write.get(suffix, partial(frame.to_csv, index=False))(path)
    np.testing.assert_allclose(people_in(path).position, TRACKS.position)
    monkeypatch.setattr("pedpred.reading.text.MOST_NUMBERS", 20)
    with unread(path, remedy="Divide the file"):
        people_in(path)


# Rows: ids, classes, copies, missing ones


@given(st.lists(st.integers(-(2**63), 2**63 - 1), unique=True, min_size=1, max_size=5))
@EACH
def test_ids_of_64_bits_are_exact_in_text_and_parquet(write, tmp_path, ids):
    ids = [who for who in ids if who != -1] or [5]
    rows = [(k, who, 0.1 * k, 0.0) for who in ids for k in (0, 1)]
    assert sorted(set(people_in(write(lines(rows=rows))).track_id.tolist())) == sorted(ids)
    pd.DataFrame(rows, columns=HEADER).to_parquet(tmp_path / "walk.parquet")
    assert sorted(set(people_in(tmp_path / "walk.parquet").track_id.tolist())) == sorted(ids)


def test_rows_that_are_no_detections_are_dropped(write, caplog):
    assert_same(people_in(write([*lines(), "9,3,,", "9,,1,1", "9,-1,1,1", lines()[1], ",,,"])), TRACKS)
    assert [record.levelname for record in caplog.records] == ["WARNING"] * 4


def test_other_road_users_than_people_are_left_out(write):
    rows = [(*row, LABELS[k % len(LABELS)]) for k, row in enumerate(ROWS)]
    rows += [(0.5 * k, 9, 5.0 * k, 0.0, "bicycle") for k in range(12)]
    path = write(lines(",", (*HEADER, "class"), rows))
    assert_same(people_in(path), TRACKS)
    assert set(people_in(path, classes=("bicycle",), any_speed=True).track_id) == {9}
    assert len(people_in(path, classes=("",), any_speed=True)) == len(rows)
    path = write(lines(",", (*HEADER, "type"), [(*row, row[1]) for row in ROWS]))
    with unread(path, remedy="--class"):
        people_in(path)
    assert set(people_in(path, classes=("7",)).track_id) == {7}


# Errors name file, line and remedy


@pytest.mark.parametrize(
    ("content", "line", "remedy"),
    [
        ("time,id,x\n0,1,2\n", None, "--columns y=TITLE"),
        ("time,id,x,y\n0,1,2,3\n1,1,2\n", 3, ""),
        ("time,id,x,y\n0,1,2,left\n", 2, "line"),
        ("time;id;x;y\n0;1;2,5;3\n", 2, "--decimal ,"),
        ("frame,id,x,y\n0,1,2,3\n", None, "--rate"),
        ("time,id,x,y\n0,1,2,3\n1,1,2,3\n0,1,2,4\n", 4, "--columns id=TITLE"),
        ("time,id,x,y\n", None, "Name a file with tracks"),
        ("time,id,x,y\n0,1,2,\x81\n", None, "--encoding cp1252"),
    ],
)
def test_an_error_names_the_line_and_the_remedy(write, content, line, remedy):
    path = write([content], "latin-1")
    with unread(path, line, remedy):
        people_in(path)


def test_options_that_contradict_are_refused():
    for wrong in (
        {"columns": ("t", "id", "x")},
        {"unit": "cm", "pixel_m": 0.1},
        {"decimal": ",", "delimiter": ","},
    ):
        with refused(next(iter(wrong))):
            ReadOptions(**wrong)


# Scene folders and their tables


def test_other_stored_columns_are_not_decoded(tmp_path):
    """A small file with a dictionary column that would fill the memory."""
    path, table = tmp_path / "tracks.parquet", tracks_table(TRACKS)
    note = pd.Categorical(["a" * 2**20] * len(TRACKS))
    table.assign(note=note, fields=[[1]] * len(TRACKS)).to_parquet(path)
    assert_same(read_parquet_tracks(path), TRACKS)
    table.assign(x_m=table.x_m.astype(str)).to_parquet(path)
    with unread(path, "column x_m"):
        read_parquet_tracks(path)


def test_stored_rows_are_bounded_before_they_are_decoded(tmp_path, monkeypatch):
    write_parquet_tracks(TRACKS, tmp_path / "tracks.parquet")
    monkeypatch.setattr("pedpred.storage.tracks.MOST_NUMBERS", 4 * len(TRACKS) - 1)
    monkeypatch.setattr("pedpred.storage.tracks.read_columns", lambda *_: pytest.fail("it was decoded"))
    with pytest.raises(InputError):
        read_parquet_tracks(tmp_path / "tracks.parquet")


def test_a_folder_with_a_table_is_checked_and_stays(write, tmp_path):
    """Converted into itself, later corrections of the table would lose against what was converted."""
    own = tmp_path / "own"
    main(["convert", str(write(lines())), "-o", str(own)])
    (own / "tracks.parquet").unlink()
    (own / "tracks.csv").write_text("\n".join(lines()))
    assert_same(read_folder(own, "mine", {}).trajectories, TRACKS)
    before = {path.name: path.read_bytes() for path in own.iterdir()}
    with pytest.raises(SystemExit):
        main(["convert", str(own), "-o", str(own), "--force"])
    assert {path.name: path.read_bytes() for path in own.iterdir()} == before
    (own / "tracks.csv").write_text("\n".join(lines(rows=[(1000 * t, *rest) for t, *rest in ROWS])))
    with pytest.raises(InputError):
        read_folder(own, "mine", {})
