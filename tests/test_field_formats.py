"""Formats that the field has: written after their specifications and read to the value."""

import re
import sqlite3

import h5py
import numpy as np
import pandas as pd
import pedpy
import pytest

from pedpred.command import main
from pedpred.errors import SourceError, ValueRuleError
from pedpred.sources.single_file import FORMATS, format_of, read_file
from pedpred.storage.scenes import read_scene
from pedpred.tables.options import TableOptions
from tests.field_formats import (
    BINARY,
    OPTIONS,
    PATHS,
    PEOPLE,
    PIXEL_M,
    RATE_HZ,
    ROWS,
    UNIX_S,
    WKT,
    WRITERS,
    lines,
    write_archive,
    write_atc,
    write_drone,
    write_jupedsim,
    write_magni,
    write_qtm,
    write_stanford,
    write_sumo,
    write_vadere,
    write_viswalk,
)
from tests.scenes import assert_same

SUFFIXES = ("", ".data", ".txt", ".csv", ".xml", ".SQLITE")


@pytest.mark.parametrize("hidden", ["NULL", "", "NaN"])
def test_hidden_markers_of_qtm_may_be_written_otherwise(tmp_path, hidden):
    path = write_qtm(tmp_path)
    text = path.read_text()
    path.write_text(text.replace("\t0.000\t0.000\t0.000", f"\t{hidden}" * 3))
    assert path.read_text() != text
    np.testing.assert_allclose(read_file(path).trajectories.position, PEOPLE.position, atol=1e-6)


@pytest.mark.parametrize("columns_before", [0, 1, 2])
@pytest.mark.parametrize("ends", ["", "\t"])
def test_the_last_marker_of_qtm_may_be_hidden_where_columns_have_no_titles(tmp_path, columns_before, ends):
    path = write_qtm(tmp_path)
    *head, _ = [row for row in path.read_text().splitlines() if not row[0].isdecimal()]
    data = [row.split("\t") for row in path.read_text().splitlines() if row[0].isdecimal()]
    rows = ["\t".join([*row[2 - columns_before : -4], "", "", ""]) + ends for row in data]
    people = read_file(lines(path, *head, *rows)).trajectories
    np.testing.assert_allclose(people.position, PEOPLE.position, atol=1e-6)


def decimal_commas(text):
    return re.sub(r"(?<=\d)\.(?=\d)", ",", text)


@pytest.mark.parametrize("separator", ["\t", ";"])
@pytest.mark.parametrize("titled", [True, False])
def test_motion_capture_may_have_decimal_commas(tmp_path, separator, titled):
    path = write_qtm(tmp_path)
    text = path.read_text()
    if not titled:
        text = re.sub(r"^Frame\tTime.*\n", "", text, flags=re.MULTILINE)
    path.write_text(
        decimal_commas(text.replace("FREQUENCY\t5\n", "FREQUENCY\t5.0\n")).replace("\t", separator)
    )
    np.testing.assert_allclose(read_file(path).trajectories.position, PEOPLE.position, atol=1e-6)
    path.write_text(path.read_text().replace("1800,000", "1800.000", 1))
    with pytest.raises(SourceError, match=r"numbers have commas in line .* and points in line"):
        read_file(path)


def test_a_table_of_motion_capture_may_come_from_a_spreadsheet_with_decimal_commas(tmp_path):
    path = write_magni(tmp_path)
    path.write_text(decimal_commas(path.read_text().replace(",", ";")))
    np.testing.assert_allclose(read_file(path).trajectories.position, PEOPLE.position, atol=1e-6)


@pytest.mark.parametrize("hidden", [(0,), (0, 1), (7,), (7, 8, 9), (0, 12)])
def test_frames_of_motion_capture_in_which_nobody_is_seen_take_their_time(tmp_path, hidden):
    """Where frames have no numbers, blank lines count."""
    path = write_qtm(tmp_path)
    head, data = [], []
    for row in path.read_text().splitlines():
        if row[0].isdecimal():
            data.append("\t".join(row.split("\t")[2:]))
        elif not row.startswith("Frame\t"):
            head.append(row)
    for k in hidden:
        data[k] = "\t" * data[k].count("\t")
    found = read_file(lines(path, *head, *data)).trajectories
    seen = np.unique(found.time_s) * RATE_HZ
    wanted = np.delete(np.arange(20), hidden)
    np.testing.assert_allclose(seen - seen[0], wanted - wanted[0], atol=1e-6)
    assert len(found) == 2 * len(wanted)


def doubt_of(path, caplog):
    """What is said of a file that is read, or the error of one that is not."""
    try:
        read_file(path)
    except SourceError as error:
        return str(error)
    return caplog.text


@pytest.mark.parametrize("write", [write_qtm, write_magni, write_atc])
@pytest.mark.parametrize(
    ("faster", "named"),
    [
        (10.0, r"Lengths of this format are mm: .*write a table \(time,id,x,y\), and give its unit: --unit"),
        (4.0, "which is running: does the file hold mm"),
        (0.001, "are lengths mm, times seconds"),
    ],
)
def test_doubts_about_speeds_name_the_unit_of_the_format(tmp_path, monkeypatch, caplog, write, faster, named):
    paths = {who: faster * path for who, path in PATHS.items()}
    monkeypatch.setattr("tests.field_formats.PATHS", paths)
    monkeypatch.setattr("tests.field_formats.ROWS", [(k, who, *paths[who][k - 1]) for k, who, *_ in ROWS])
    path = write(tmp_path)
    said = doubt_of(path, caplog)
    assert re.search(named, said)
    assert "metres" not in said


def test_rows_like_those_of_atc_in_metres_are_a_text(tmp_path):
    """Also with its eight columns; nobody is higher than a few metres."""
    path = write_atc(tmp_path)
    rows = [line.split(",") for line in path.read_text().splitlines()]
    metres = [[*row[:2], *(f"{float(value) / 1000:.4f}" for value in row[2:6]), *row[6:]] for row in rows]
    wanted, found = (
        read_file(path).trajectories,
        read_file(lines(tmp_path / "metres.csv", *map(",".join, metres))),
    )
    np.testing.assert_allclose(found.trajectories.position, wanted.position, atol=1e-6)


def test_a_drone_recording_with_another_name_is_told_what_it_lacks(tmp_path):
    path = write_drone(tmp_path)
    with pytest.raises(SourceError, match=r"walk\.csv.*name of this one.*NN_tracks\.csv"):
        read_file(path.rename(path.with_name("walk.csv")))


@pytest.mark.parametrize("name", WRITERS)
def test_a_format_is_read_to_the_value(tmp_path, name):
    people = read_file(WRITERS[name](tmp_path), OPTIONS.get(name)).trajectories
    start_s = UNIX_S if name == "ATC shopping centre" else 0.0
    ids = np.unique(people.track_id, return_inverse=True)[1] + 1  # words are numbered from 0
    np.testing.assert_allclose(people.time_s - start_s, PEOPLE.time_s, atol=1e-6)
    np.testing.assert_array_equal(ids, PEOPLE.track_id)
    np.testing.assert_allclose(people.position, PEOPLE.position, atol=1e-3 if start_s else 1e-4)


def with_a_copy(folder, name, moved=False):
    """A recording with one detection twice, the second time perhaps at another place."""
    if name in BINARY:
        frame, who, x, y = ROWS[5]
        return WRITERS[name](folder, [*ROWS, (frame, who, x + moved, y)])
    path = WRITERS[name](folder)
    rows = path.read_text().splitlines()
    if name == "SUMO FCD":
        place = rows[5].index('<person id="ped')
        again = rows[5][place : rows[5].index("/>", place) + 2]
        rows[5] = rows[5].replace(again, again + (again.replace('x="', 'x="1') if moved else again))
    else:
        at = len(rows) // 2 + 3
        x = _MOVED.get(name, "")
        assert not moved or re.search(x, rows[at])
        rows.insert(at + 1, re.sub(x, r"\g<1>9", rows[at], count=1) if moved else rows[at])
    return lines(path, *rows)


_MOVED = {
    "Stanford Drone Dataset": r"^(\d+ )\d",
    "drone recording (inD, rounD, uniD)": r"^((?:\d+,){4})\d",
    "Vadere": r"^(\S+ \S+ \S+ )\d",
    "PTV Viswalk": r"^(\d+;[^;]+;)\d",
    "ATC shopping centre": r"^([^,]+,\d+,)\d",
    "KITTI tracking labels": r"(1.70 0.60 0.80 )-?\d",
    "motion capture (THÖR, THÖR-MAGNI, QTM)": r"^(\S+\t\S+\t)\d",
    "motion capture, THÖR-MAGNI": r"^((?:[^,]*,){8})\d",
    "TrajNet++": r'("x": )\d',
}
"""What comes before x in a line of a text, and its first digit."""


@pytest.mark.parametrize("name", WRITERS)
def test_a_detection_that_is_written_twice_counts_once(tmp_path, name, caplog):
    whole = read_file(WRITERS[name](tmp_path), OPTIONS.get(name)).trajectories
    caplog.clear()
    assert_same(read_file(with_a_copy(tmp_path, name), OPTIONS.get(name)).trajectories, whole)
    assert caplog.text.count("that repeat another one are left out") == 1


@pytest.mark.parametrize("name", [name for name in WRITERS if not name.startswith("motion capture")])
def test_a_person_at_two_places_in_one_instant_is_refused(tmp_path, name):
    with pytest.raises(SourceError, match=r"again, first in (line|row) .*, at another place"):
        read_file(with_a_copy(tmp_path, name, moved=True), OPTIONS.get(name))


@pytest.mark.parametrize("write", [write_qtm, write_magni])
def test_of_frames_of_motion_capture_at_one_time_the_first_counts_with_a_warning(tmp_path, write, caplog):
    name = next(name for name, writer in WRITERS.items() if writer is write)
    whole = read_file(write(tmp_path)).trajectories
    assert_same(read_file(with_a_copy(tmp_path, name, moved=True)).trajectories, whole)
    assert "with other values, are left out: 1, the first in line" in caplog.text


@pytest.mark.parametrize("name", WRITERS)
def test_a_format_is_told_by_its_content(tmp_path, name):
    path = WRITERS[name](tmp_path)
    for suffix in SUFFIXES:
        other = tmp_path / f"renamed{suffix}"
        other.write_bytes(path.read_bytes())
        assert format_of(other).name == format_of(path).name
    assert name.startswith(format_of(path).name.split(" (")[0])


def test_every_format_is_written_here():
    assert {kind.name for kind in FORMATS} <= set(WRITERS)


@pytest.mark.parametrize("name", WRITERS)
def test_what_a_file_was_taken_for_is_said(tmp_path, name, capsys):
    about = OPTIONS.get(name, TableOptions())
    stated = {"--scale": about.pixel_m, "--rate": about.rate_hz}
    options = [word for option, value in stated.items() if value for word in (option, str(value))]
    main(["info", str(WRITERS[name](tmp_path)), *options])
    assert f"read as  {name.split(',')[0].split(' (')[0]}" in capsys.readouterr().out


@pytest.mark.parametrize("name", WRITERS)
def test_every_format_bounds_what_it_reads(tmp_path, monkeypatch, name):
    path = WRITERS[name](tmp_path)
    for module in (
        "tables.text",
        *(f"sources.{own}" for own in ("jupedsim_database", "vadere", "motion_capture", "data_archive")),
    ):
        monkeypatch.setattr(f"pedpred.{module}.MOST_NUMBERS", 20)
    with pytest.raises(SourceError, match=r"more than \d+ (rows|numbers)|too (large|many)"):
        read_file(path, OPTIONS.get(name))


@pytest.mark.parametrize("write", [write_jupedsim, write_archive])
def test_the_geometry_inside_a_file_is_the_map(tmp_path, write):
    ground = read_file(write(tmp_path)).occupancy
    x, y = np.meshgrid(np.arange(0.25, 12, 0.5), np.arange(0.25, 8, 0.5))
    points = np.stack([x, y], axis=-1).reshape(-1, 2)
    pillar = ((points > [4, 5]) & (points < [5, 6])).all(axis=-1)
    np.testing.assert_array_equal(ground.occupied[tuple(ground.cell_of(points).T)], pillar)
    assert ground.occupied[tuple(ground.cell_of(np.array([[-1.0, 4.0], [13.0, 4.0], [6.0, 9.0]])).T)].all()


def test_people_may_walk_in_each_of_several_geometries(tmp_path):
    halves = [
        "POLYGON ((0 0, 6 0, 6 8, 0 8, 0 0))",
        "GEOMETRYCOLLECTION (POLYGON ((6 0, 12 0, 12 8, 6 8, 6 0)))",
    ]
    ground = read_file(write_jupedsim(tmp_path, wkt=halves)).occupancy
    assert not ground.occupied[tuple(ground.cell_of(PEOPLE.position).T)].any()
    for nothing in ((), ("",)):
        assert not read_file(write_jupedsim(tmp_path, wkt=nothing)).occupancy.occupied.any()


@pytest.mark.parametrize(
    ("wkt", "named"),
    [
        ("POLYGON ((0 0, 1 0", "ParseException"),
        ("POINT (0 0)", "neither ground nor a wall"),
        ("POLYGON EMPTY", "is empty"),
        ("POLYGON ((0 0, 1e12 0, 1 1, 0 0))", "farther than"),
        ("GEOMETRYCOLLECTION (" * 99_999, "more than 16 deep"),
    ],
)
def test_a_geometry_that_is_no_ground_is_refused(tmp_path, wkt, named):
    with pytest.raises(SourceError, match=rf"simulation\.sqlite: .*{named}"):
        read_file(write_jupedsim(tmp_path, wkt=[wkt]))


def test_the_rate_is_asked_for_where_no_file_says_it(tmp_path):
    path = write_jupedsim(tmp_path, fps=None)
    with pytest.raises(SourceError, match="--rate"):
        read_file(path)
    assert read_file(path, TableOptions(rate_hz=5.0)).detection_dt_s == pytest.approx(0.2)


def _qtm_without_times(folder):
    path = write_qtm(folder)
    path.write_text(path.read_text().replace("\tTime\t", "\tOther\t"))
    return path


RATES = {
    write_jupedsim: "fps",
    write_archive: "fps",
    write_drone: "frameRate",
    _qtm_without_times: "FREQUENCY",
}


@pytest.mark.parametrize(("write", "name"), RATES.items())
def test_another_rate_than_that_of_the_file_is_refused(tmp_path, write, name):
    path = write(tmp_path)
    assert_same(read_file(path, TableOptions(rate_hz=5.0)).trajectories, read_file(path).trajectories)
    assert len(read_file(path, TableOptions(rate_hz=4.99999)).trajectories) == len(PEOPLE), "fewer digits"
    with pytest.raises(SourceError, match=rf"{name} = 5, but --rate says 4.*Leave --rate out"):
        read_file(path, TableOptions(rate_hz=4.0))


@pytest.mark.parametrize("write", [write_jupedsim, write_archive])
def test_columns_that_a_file_names_are_not_named_again(tmp_path, write):
    with pytest.raises(ValueRuleError, match=r"--columns = .*whose columns are known"):
        read_file(write(tmp_path), TableOptions(columns=("time", "id", "x", "y")))


def test_a_database_of_version_3_has_no_orientations(tmp_path):
    path = write_jupedsim(tmp_path)
    whole = read_file(path).trajectories
    with sqlite3.connect(path) as database:
        for column in ("ori_x", "ori_y"):
            database.execute(f"ALTER TABLE trajectory_data DROP COLUMN {column}")
    database.close()
    assert_same(read_file(path).trajectories, whole)


@pytest.mark.parametrize("write", [write_qtm, write_magni, write_sumo, write_viswalk, write_atc])
def test_a_rate_is_called_unused_where_a_file_has_times(tmp_path, write, caplog):
    read_file(write(tmp_path), TableOptions(rate_hz=4.0))
    assert "so that --rate is not used" in caplog.text


@pytest.mark.parametrize(
    ("statement", "named"),
    [
        ("DROP TABLE trajectory_data", "without a table trajectory_data; it has metadata"),
        ("ALTER TABLE trajectory_data RENAME pos_x TO x", "no column pos_x; it has frame, id, x"),
        (
            "UPDATE trajectory_data SET pos_x = 'far' WHERE frame = 2",
            r"row 3 .*pos_x = 'far' is not a number",
        ),
        ("UPDATE trajectory_data SET id = 1.5 WHERE frame = 2", r"id = 1.5 is not a whole number"),
        (
            "UPDATE trajectory_data SET id = 1",
            "row 2: track_id 1 and frame 1 again, first in row 1, at another place",
        ),
        ("DELETE FROM trajectory_data", "trajectory_data is empty"),
        (
            "UPDATE metadata SET value = 'fast' WHERE key = 'fps'",
            "fps in the table metadata: could not convert string to float: 'fast'",
        ),
        ("UPDATE metadata SET value = '0' WHERE key = 'fps'", "fps = 0 is not a rate"),
        (
            "UPDATE metadata SET value = '4' WHERE key = 'version'",
            "version '4' .* is not known, only 1, 2, 3",
        ),
        ("DROP TABLE trajectory_data; CREATE VIEW trajectory_data AS SELECT 1 AS frame", "without a table"),
    ],
)
def test_what_is_wrong_with_a_database_is_said(tmp_path, statement, named):
    path = write_jupedsim(tmp_path)
    database = sqlite3.connect(path)
    database.executescript(statement)
    database.close()
    with pytest.raises(SourceError, match=rf"simulation\.sqlite: .*{named}"):
        read_file(path)


def test_a_database_that_is_still_written_is_refused(tmp_path):
    path = write_jupedsim(tmp_path)
    (tmp_path / "simulation.sqlite-wal").write_bytes(b"pages")
    with pytest.raises(SourceError, match="still being written"):
        read_file(path)


def test_a_bag_under_another_name_is_named(tmp_path):
    with sqlite3.connect(tmp_path / "bag.sqlite") as database:
        database.executescript("CREATE TABLE topics (id); CREATE TABLE messages (id);")
    database.close()
    with pytest.raises(SourceError, match=r"ends in \.db3"):
        read_file(tmp_path / "bag.sqlite")


@pytest.mark.parametrize(
    ("write", "old", "new", "named"),
    [
        (write_sumo, "<fcd-export>", '<!DOCTYPE a [<!ENTITY b "c">]><fcd-export>', "document type"),
        (write_sumo, "<person", f'<person note="{"x" * 2**21}"', "an element of more than"),
        (write_sumo, "<timestep", "<a>" * 50 + "<timestep", "more than 8 deep"),
        (write_sumo, 'x="1.2000"', 'x="left"', r"line 4: x = 'left' is not a number"),
        (write_sumo, 'id="ped1"', 'name="ped1"', "line 4: a <person> without an id"),
        (write_sumo, "</fcd-export>", "", "no element found"),
        (write_sumo, "person", "container", "no <person>|mismatched"),
        (write_stanford, " 0 0 1 ", " 0 1 ", "line 1: 9 columns, expected 10"),
        (write_stanford, '"Pedestrian"', '"Biker"', "no row with the label"),
        (write_drone, "0,1,1,0,1.2", "0,1,1,0,far1.2", "line 2: xCenter = 'far1.2"),
        (write_qtm, "1200.000", "near", r"line 12: Helmet_1 - 1 X = 'near' is not a number"),
        (write_magni, "1,0.2,", "1,,", "line 11: the time is missing"),
        (write_vadere, "endTime-PID1", "endTime-PID1 endTime-PID7", "2 columns endTime"),
        (write_vadere, "1 0.2 0.6", "1 0.9 0.6", "endTime is before simTime"),
        (write_viswalk, "COORDCENTX", "LENGTH", "the attribute COORDCENTX was not recorded"),
        (write_viswalk, "1.2000", "1,2000", r"numbers have commas in line 6 and points in line 6"),
        (
            write_atc,
            "1200,",
            "1200,7,",
            "line 1: 9 columns|no header|no comment says the frame rate|line 2: 8 columns",
        ),
    ],
)
def test_what_is_wrong_with_a_text_is_said(tmp_path, write, old, new, named):
    path = write(tmp_path)
    text = path.read_text()
    assert old in text
    path.write_text(
        text.replace(old, new) if old in ("person", '"Pedestrian"') else text.replace(old, new, 1)
    )
    with pytest.raises(SourceError, match=named):
        read_file(path, TableOptions(pixel_m=PIXEL_M) if write is write_stanford else None)


@pytest.mark.parametrize(
    ("write", "name", "person", "other"),
    [
        (write_drone, "00_tracksMeta.csv", "pedestrian", "bicycle"),
        (write_stanford, "annotations.txt", '"Pedestrian"', '"Biker"'),
        (write_sumo, "fcd.xml", "<person ", "<container "),
    ],
)
def test_a_recording_without_pedestrians_is_not_called_wrong(tmp_path, write, name, person, other):
    path = write(tmp_path)
    (tmp_path / name).write_text((tmp_path / name).read_text().replace(person, other))
    with pytest.raises(SourceError, match=r"Only pedestrians are read: name a recording with some$"):
        read_file(path, TableOptions(pixel_m=PIXEL_M if write is write_stanford else None))


def test_bodies_of_qtm_without_places_are_to_be_exported_again(tmp_path):
    """6D data have titles such as `Helmet_1 X`, `Y` and `Z`."""
    path = write_qtm(tmp_path)
    path.write_text(re.sub(r"Helmet_\d - \d ([YZ])", r"\1", path.read_text()))
    with pytest.raises(SourceError, match=r"no columns such as .*Export 3D data"):
        read_file(path)


def test_pixels_need_their_size_and_nothing_else_has_one(tmp_path):
    with pytest.raises(SourceError, match=r"pixels.*--scale 0\.03"):
        read_file(write_stanford(tmp_path))
    with pytest.raises(
        ValueRuleError, match=r"--scale = 0\.1, but .*SUMO FCD, whose positions are not pixels"
    ):
        read_file(write_sumo(tmp_path), TableOptions(pixel_m=0.1))
    with pytest.raises(ValueRuleError, match=r"--unit = 'cm', but .*ATC.*whose unit is known"):
        read_file(write_atc(tmp_path), TableOptions(unit="cm"))


@pytest.mark.parametrize(("factor", "named"), [(100.0, r"metres here: .*cm"), (4.0, "running")])
@pytest.mark.parametrize("write", [write_jupedsim, write_archive, write_sumo])
def test_a_unit_that_cannot_be_given_is_no_remedy(tmp_path, caplog, write, factor, named):
    path = write(tmp_path, [(k, who, factor * x, factor * y) for k, who, x, y in ROWS])
    said = doubt_of(path, caplog)
    assert re.search(named, said)
    assert "ay --unit" not in said


@pytest.mark.parametrize("title", ["LEVEL", "LEVEL\\NO", "SIMRUN"])
def test_floors_and_runs_of_viswalk_are_warned_about(tmp_path, caplog, title):
    path = write_viswalk(tmp_path)
    text = path.read_text().replace("PEDTYPE\\NAME", title)
    path.write_text(text.replace(";Man", ";1"))
    read_file(path)
    assert "one floor" not in caplog.text
    path.write_text(text.replace(";Man", ";1", 5).replace(";Man", ";2"))
    read_file(path)
    assert f"{title} is 1, 2: all are read as one recording on one floor" in caplog.text


def test_other_headers_of_viswalk_are_named(tmp_path):
    path = write_viswalk(tmp_path)
    path.write_text(path.read_text().replace("$PEDESTRIAN:", "$FUSSGAENGER:"))
    with pytest.raises(SourceError, match=r"begins with \$PEDESTRIAN:, but with \$FUSSGAENGER:.*in English"):
        read_file(path)


def test_longitude_and_latitude_are_not_metres(tmp_path):
    degrees = [(k, who, 11.5 + x * 1e-5, 48.1 + y * 1e-5) for k, who, x, y in ROWS]
    path = write_sumo(tmp_path, degrees)
    path.write_text(path.read_text().replace('.00" angle', '.00001" angle'))
    with pytest.raises(SourceError, match=r"longitude.*fcd-output\.geo"):
        read_file(path)


@pytest.mark.parametrize("form", ["quotes", "semicolons", "parquet"])
def test_cars_of_a_drone_recording_in_another_spelling_are_no_people(tmp_path, form):
    path = write_drone(tmp_path)
    wanted = read_file(path).trajectories
    if form == "parquet":
        pd.read_csv(path).to_parquet(path := path.with_suffix(".parquet"))
    for file in tmp_path.glob("*.csv"):
        text = file.read_text()
        if form == "semicolons":
            file.write_text(text.replace(",", ";").replace(".", ","))
        elif form == "quotes":
            file.write_text(re.sub(r"[^,\n]+", r'"\g<0>"', text))
    found = read_file(path).trajectories
    np.testing.assert_array_equal(found.track_id, wanted.track_id)
    np.testing.assert_array_equal(found.time_s, wanted.time_s)
    np.testing.assert_allclose(found.position, wanted.position, atol=1e-6)


def test_the_files_of_a_drone_recording_lie_together(tmp_path):
    path = write_drone(tmp_path)
    (tmp_path / "00_tracksMeta.csv").unlink()
    with pytest.raises(SourceError, match=r"00_tracksMeta\.csv: the file is missing.*lie together"):
        read_file(path)


def test_a_rate_may_stand_for_a_lost_file_of_a_drone_recording(tmp_path):
    path = write_drone(tmp_path)
    whole = read_file(path).trajectories
    (tmp_path / "00_recordingMeta.csv").unlink()
    with pytest.raises(SourceError, match=r"00_recordingMeta\.csv: the file is missing.*--rate"):
        read_file(path)
    assert_same(read_file(path, TableOptions(rate_hz=5.0)).trajectories, whole)


@pytest.mark.parametrize("write", [write_jupedsim, write_archive])
def test_the_geometry_inside_a_file_may_have_an_open_end(tmp_path, write):
    path, ends = str(write(tmp_path)), ["--open-end", "12", "0", "12", "8"]
    main(["convert", path, "-o", str(tmp_path / "closed")])
    main(["convert", path, "-o", str(tmp_path / "open"), *ends])
    beyond = np.array([[12.5, 4.0], [17.5, 4.0]])
    closed, opened = (read_scene(tmp_path / name).occupancy for name in ("closed", "open"))
    assert closed.is_occupied(beyond[:1]).all()
    assert not opened.is_occupied(beyond).any()
    assert opened.is_occupied(np.array([[-0.5, 4.0]])).all()


@pytest.mark.parametrize("write", [write_jupedsim, write_archive])
def test_a_geometry_inside_a_file_that_is_replaced_is_not_read(tmp_path, write):
    good = write(tmp_path)
    (tmp_path / "broken").mkdir()
    path = write(tmp_path / "broken", wkt=("nonsense",) if write is write_jupedsim else "nonsense")
    walls = tmp_path / "walls.wkt"
    walls.write_text("POLYGON ((0 0, 12 0, 12 8, 0 8, 0 0))")
    with pytest.raises(SystemExit, match="NONSENSE"):
        main(["info", str(path)])
    for given in (["--no-map"], ["--map", str(walls)]):
        for name in (good, path):
            main(["info", str(name), *given])


def test_pedpy_reads_the_archive_that_we_read(tmp_path):
    path = write_archive(tmp_path)
    theirs = pedpy.load_trajectory_from_ped_data_archive_hdf5(trajectory_file=path)
    ours = read_file(path).trajectories
    assert theirs.frame_rate == 5.0
    order = np.lexsort((ours.track_id, ours.time_s))
    rows = theirs.data.sort_values(["frame", "id"])
    np.testing.assert_allclose(ours.position[order], rows[["x", "y"]].to_numpy())


def linked(path):
    """The table lies in another file."""
    path.rename(path.with_name("other.h5"))
    with h5py.File(path, "w") as file:
        file["trajectory"] = h5py.ExternalLink("other.h5", "/trajectory")


def renamed(path):
    with h5py.File(path, "r+") as file:
        file.move("trajectory", "tracks")


def without_ids(path):
    with h5py.File(path, "r+") as file:
        rows = file["trajectory"].fields(["frame", "x", "y"])[:]
        del file["trajectory"]
        file.create_dataset("trajectory", data=rows).attrs["fps"] = 5.0


def with_pairs(path):
    """Each x is two numbers."""
    with h5py.File(path, "r+") as file:
        del file["trajectory"]
        kinds = [("id", "i8"), ("frame", "i8"), ("x", "f8", 2), ("y", "f8")]
        file.create_dataset("trajectory", data=np.zeros(4, kinds)).attrs["fps"] = 5.0


def with_zstandard(path):
    """As JuPedSim writes HDF5; needs a plugin."""
    with h5py.File(path, "r+") as file:
        kind, filters = file["trajectory"].id.get_type(), h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        del file["trajectory"]
        filters.set_chunk((10,))
        filters.set_filter(32015, h5py.h5z.FLAG_OPTIONAL, (3,))
        h5py.h5d.create(file.id, b"trajectory", kind, h5py.h5s.create_simple((10,)), filters)


def cut(path):
    path.write_bytes(path.read_bytes()[:-500])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (linked, "no data set 'trajectory'; there is trajectory"),
        (renamed, "no data set 'trajectory'; there is tracks"),
        (without_ids, "no column id; it has frame, x, y"),
        (with_pairs, r"column x has the shape \(4, 2\), it must be a list of numbers"),
        (with_zstandard, r"a filter \(32015\), which is not read: bring them to gzip"),
        (cut, "HDF5: .*truncated"),
    ],
)
def test_an_archive_that_is_not_as_it_should_be_is_refused(tmp_path, change, message):
    path = write_archive(tmp_path)
    change(path)
    with pytest.raises(SourceError, match=message):
        read_file(path)


def write_schema(folder, version=2, regions=(WKT,)):
    """As `jupedsim.Hdf5TrajectoryWriter` does, but without its compression: every 20th step of 10 ms."""
    path = folder / "simulation.h5"
    kinds = [("frame", "<u8"), ("id", "<u8"), ("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("region_id", "<u8")]
    with h5py.File(path, "w") as file:
        file.attrs.update({"schema_version": version, "producer": "JuPedSim", "producer_version": "2.0.0"})
        file.attrs.update({"dt": 0.01, "every_nth_frame": 20, "created": "2026-01-01T00:00:00+00:00"})
        given = np.array([(k, who, x, y, 0.0, 0) for k, who, x, y in ROWS], np.dtype(kinds, align=True))
        file.create_dataset("trajectory", data=given, maxshape=(None,), shuffle=True)
        kinds = np.dtype([("id", "<u8"), ("wkt", h5py.string_dtype())], align=True)
        file.create_dataset("regions", data=np.array(list(enumerate(regions)), kinds))
    return path


@pytest.mark.parametrize("parts", [1, 2])
def test_hdf5_of_jupedsim_has_its_time_step_and_its_regions(tmp_path, parts):
    halves = ("POLYGON ((0 0, 6 0, 6 8, 0 8, 0 0))", "POLYGON ((6 0, 12 0, 12 8, 6 8, 6 0))")
    wkt = (WKT,) if parts == 1 else halves
    scene, whole = (
        read_file(path) for path in (write_schema(tmp_path, regions=wkt), write_jupedsim(tmp_path, wkt=wkt))
    )
    np.testing.assert_allclose(scene.trajectories.position, whole.trajectories.position, atol=1e-6)
    np.testing.assert_allclose(scene.trajectories.time_s, whole.trajectories.time_s)
    np.testing.assert_array_equal(scene.occupancy.occupied, whole.occupancy.occupied)


def test_hdf5_of_jupedsim_may_have_a_list_of_geometries(tmp_path):
    """Version 1: people may walk in each of them."""
    path = write_archive(tmp_path)
    larger = "POLYGON ((0 0, 20 0, 20 8, 0 8, 0 0))"
    with h5py.File(path, "a") as file:
        file.attrs["schema_version"] = 1
        file.create_group("geometry").create_dataset("wkt", data=[WKT, larger], dtype=h5py.string_dtype())
    whole = read_file(write_jupedsim(tmp_path, wkt=(WKT, larger)))
    np.testing.assert_array_equal(read_file(path).occupancy.occupied, whole.occupancy.occupied)


def test_hdf5_of_jupedsim_with_another_version_is_refused(tmp_path):
    with pytest.raises(SourceError, match=r"simulation\.h5: .*schema_version 3 .* is not known, only 1, 2"):
        read_file(write_schema(tmp_path, version=3))


def test_an_archive_without_a_rate_asks_for_it(tmp_path):
    path = write_archive(tmp_path, fps=None, wkt=None)
    with pytest.raises(SourceError, match=r"no fps.*--rate"):
        read_file(path)
    assert read_file(path, TableOptions(rate_hz=10.0)).detection_dt_s == pytest.approx(0.1)
    with pytest.raises(SourceError, match="Leave --rate out"):
        read_file(write_archive(tmp_path), TableOptions(rate_hz=10.0))


def test_footsteps_are_sampled_as_often_as_asked(tmp_path):
    scene = read_file(write_vadere(tmp_path), TableOptions(rate_hz=20.0))
    people = scene.trajectories.select(scene.trajectories.track_id == 1)
    assert scene.detection_dt_s == pytest.approx(0.05)
    np.testing.assert_allclose(people.position[:, 0], 1.0 + people.time_s, atol=1e-9)


def test_footsteps_begin_at_zero_and_not_at_minus_zero(tmp_path):
    path = write_vadere(tmp_path)
    _, head, *steps = path.read_text().splitlines()
    begin = min(float(step.split()[1]) for step in steps)
    rows = [step.split() for step in steps]
    rows = [[who, str(float(one) - begin), str(float(end) - begin), *rest] for who, one, end, *rest in rows]
    time_s = read_file(lines(path, head, *map(" ".join, rows))).trajectories.time_s
    assert not np.signbit(time_s).any()


def test_nobody_is_invented_between_footsteps_that_do_not_meet(tmp_path, caplog):
    """Who stands is there all the time; who goes on elsewhere is not, and is warned about."""
    head = "pedestrianId simTime endTime-PID1 startX-PID1 startY-PID1 endX-PID1 endY-PID1"
    stands = ["1 0 1 0 0 1 0", "1 1 2 1 0 2 0", "1 9 10 2 0 3 0"]
    goes_on = ["2 0 1 0 5 1 5", "2 1 2 1 5 2 5", "2 9 10 30 5 31 5"]
    path = tmp_path / "postvis.traj"
    path.write_text("\n".join([head, *stands, *goes_on]) + "\n")
    people = read_file(path, TableOptions(rate_hz=4.0)).trajectories
    times = [people.time_s[people.track_id == who] for who in (1, 2)]
    np.testing.assert_allclose(times[0], np.arange(41) / 4)
    np.testing.assert_allclose(times[1], np.concatenate([np.arange(9) / 4, 9 + np.arange(5) / 4]))
    assert "27 detections between footsteps" in caplog.text


@pytest.mark.parametrize(
    ("raw", "named"),
    [
        (b"\x1f\x8b\x08\0", "gzip archive.*Unpack"),
        (b"PK\x03\x04", "zip archive or a spreadsheet"),
        (b"#ROSBAG V2.0\n", r"bag of ROS 1.*\.bag"),
        (b"PAR1\0\0", "Parquet"),
        (b"\x89HDF\r\n\x1a\n\0", "HDF5.*Pedestrian Dynamics Data Archive"),
        (b"\x80\x04\x95", "pickle"),
        (b"\x80\x05\x95", "pickle"),
        ("time,id,x,y".encode("utf-16-le"), "UTF-16.*UTF-8"),
        (b"<geometry unit='m'><rooms/></geometry>", r"<geometry>.*--map"),
        (b"walk.csv".ljust(257, b"\0") + b"ustar\x0000", "tar archive.*Unpack"),
        (
            b"Format Version,1.23,Take Name,walk,Export Frame Rate,120.0\n\n,Type,Rigid Body\n",
            "Motive.*a line per body",
        ),
        (
            b"Trajectories\r\n100\r\n,,Ped1:Head,,,Ped2:Head,,\r\nFrame,Sub Frame,X,Y,Z,X,Y,Z\r\n",
            "Nexus.*a line per",
        ),
        (b"Model Outputs\n100\n\t\tPed1\nFrame\tSub Frame\tX\tY\tZ\n", "Nexus.*a line per body"),
        (b"\0\1\2\3", "neither text nor a known recording.*00 01 02 03"),
    ],
)
def test_what_is_not_read_is_named(tmp_path, raw, named):
    for name in ("walk.dat", "walk.csv", "walk"):
        (tmp_path / name).write_bytes(raw)
        with pytest.raises(SourceError, match=named):
            read_file(tmp_path / name)


def test_a_text_of_any_name_is_a_table_or_a_text(tmp_path):
    rows = [f"{k / 5},{who},{x},{y}" for k, who, x, y in ROWS]
    np.testing.assert_allclose(
        read_file(lines(tmp_path / "walk.dat", "time,id,x,y", *rows)).trajectories.position, PEOPLE.position
    )
    rows = [f"{who} {k} {x} {y}" for k, who, x, y in ROWS]
    np.testing.assert_allclose(
        read_file(lines(tmp_path / "walk", *rows), TableOptions(rate_hz=5.0)).trajectories.position,
        PEOPLE.position,
    )
