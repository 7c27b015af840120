"""The same people in every spelling of a table: titles, orders, units, separators, encodings, ids."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pedpred.command import main
from pedpred.errors import SourceError, ValueRuleError
from pedpred.sources.single_file import read_file
from pedpred.tables.lines import titles_in
from pedpred.tables.options import TableOptions
from pedpred.tables.titles import meaning_of, titles_of_tracks
from pedpred.tables.units import PER_SECOND, UNITS
from tests.test_plausibility import crowd

RATE_HZ, PEOPLE, STEPS = 10.0, 4, 24
ROWS = crowd(5, PEOPLE, STEPS)
LENGTH = {"m": "m meter metres", "cm": "cm centimeter centimetres", "mm": "mm millimeters", "ft": "ft feet"}
LENGTH["inch"] = "inch inches"
TIME = {"s": "s sec seconds", "ms": "ms millis", "us": "us µs microseconds", "ns": "ns", "min": "min minutes"}
TITLED = ("{0} [{1}]", "{0} ({1})", "{0}/{1}", "{0}_{1}", "{0} in {1}", "{0}{1}", "{1}_{0}", "{0}.{1}")
IDS = ("id", "ID", "person_id", "personID", "trackId", "Track ID", "ped", "pedestrian", "agent", "object_id")
PLACES = (
    "{}",
    "pos {}",
    "pos_{}",
    "position_{}",
    "{}Center",
    "center_{}",
    "world {}",
    "{}-coordinate",
    "Pos{}",
)
FIXTURE = [HealthCheck.function_scoped_fixture]


def values(rows, time="s", x="m", y="m", decimals=9):
    """Fields of the rows as text, in these units."""
    seconds = rows[:, 1] / RATE_HZ
    columns = (seconds * PER_SECOND[time], rows[:, 2] / UNITS[x], rows[:, 3] / UNITS[y])
    return [[f"{value:.{decimals}f}" for value in column] for column in columns]


def written(path, titles, columns, separator=",", encoding="utf-8", end="\n"):
    lines = [separator.join(line) for line in ([titles] if titles else []) + list(zip(*columns, strict=True))]
    path.write_bytes((end.join(lines) + end).encode(encoding))
    return path


def assert_are_the_people(people, atol=1e-5):
    """Whatever their ids are, the same tracks."""
    order = np.lexsort((ROWS[:, 0], ROWS[:, 1]))
    wanted = ROWS[order]
    np.testing.assert_allclose(np.sort(people.time_s), wanted[:, 1] / RATE_HZ, atol=atol)
    by_place = np.lexsort((people.position[:, 0], np.round(people.time_s, 3)))
    same = np.lexsort((wanted[:, 2], np.round(wanted[:, 1] / RATE_HZ, 3)))
    np.testing.assert_allclose(people.position[by_place], wanted[same, 2:], atol=atol)
    pairs = np.unique(np.stack([people.track_id[by_place], wanted[same, 0]], axis=-1), axis=0)
    assert len(pairs) == len(np.unique(pairs[:, 0])) == len(np.unique(pairs[:, 1])) == PEOPLE


@given(st.data())
@settings(max_examples=80, deadline=None, suppress_health_check=FIXTURE)
def test_any_spelling_is_the_same_people(tmp_path, data):
    draw = data.draw
    spell, place = draw(st.sampled_from(TITLED)), draw(st.sampled_from(PLACES))
    time, length = draw(st.sampled_from(list(TIME))), draw(st.sampled_from(list(LENGTH)))
    word, words = draw(st.sampled_from(TIME[time].split())), draw(st.sampled_from(LENGTH[length].split()))
    titles = [
        spell.format(draw(st.sampled_from(["time", "Time", "timestamp"])), word),
        draw(st.sampled_from(IDS)),
        *((spell if place == "{}" else "{0} [{1}]").format(place.format(axis), words) for axis in "xy"),
        "note",
    ]
    of_people = (
        {1: "anna", 2: "01", 3: "1", 4: "1e0"} if draw(st.booleans()) else {k: f"{k}" for k in range(9)}
    )
    clock, *places = values(ROWS, time, length, length)
    columns = [clock, [of_people[who] for who in ROWS[:, 0]], *places, ["a"] * len(ROWS)]
    order = draw(st.permutations(range(5)))
    separator, comma = draw(
        st.sampled_from([(",", False), (";", False), (";", True), ("\t", True), (" ; ", True)])
    )
    if comma:
        at = [0, 2, 3]
        columns = [[f.replace(".", ",") if k in at else f for f in c] for k, c in enumerate(columns)]
    if draw(st.booleans()):
        titles = [f'"{title}"' for title in titles]
        columns = [[f'"{field}"' for field in column] for column in columns]
    path = written(
        tmp_path / f"walk.{draw(st.sampled_from(['csv', 'txt', 'tsv']))}",
        [titles[k] for k in order],
        [columns[k] for k in order],
        separator,
        draw(st.sampled_from(["utf-8", "utf-8-sig"])),
        draw(st.sampled_from(["\n", "\r\n", "\n\n"])),
    )
    assert_are_the_people(read_file(path).trajectories)


@pytest.mark.parametrize("written_by", ["to_parquet", "to_feather"])
@pytest.mark.parametrize("clock", ["seconds", "dates", "zoned", "spans"])
def test_tables_of_parquet_and_arrow_are_those_of_csv(tmp_path, written_by, clock):
    """Words with separators, categories, missing values, lists and row groups, too; not what is cut."""
    spans = pd.to_timedelta(ROWS[:, 1] / RATE_HZ, unit="s")
    day = pd.Timestamp("2024-03-05 10:00")
    dates = day + spans
    clocks = {
        "seconds": ROWS[:, 1] / RATE_HZ,
        "spans": spans,
        "dates": dates,
        "zoned": dates.tz_localize("UTC"),
    }
    table = pd.DataFrame({"name": [f'#{who:g}, "a"' for who in ROWS[:, 0]], "time": clocks[clock]})
    table = table.assign(x_cm=100.0 * ROWS[:, 2], y_cm=100.0 * ROWS[:, 3], box=[[1, 2]] * len(ROWS))
    table["kind"] = pd.Categorical(["person"] * len(ROWS))
    table = pd.concat([table, table[:1].assign(kind="car", x_cm=9e4), table[:1].assign(x_cm=np.nan)])
    path = tmp_path / "walk"
    getattr(table.reset_index(drop=True), written_by)(path)
    people = read_file(path).trajectories
    start_s = day.timestamp() if clock in ("dates", "zoned") else 0.0
    assert_are_the_people(replace(people, time_s=people.time_s - start_s))
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(SourceError, match=r"walk: .*Write the file again"):
        read_file(path)


@pytest.mark.parametrize("written_by", ["to_parquet", "to_feather"])
def test_values_in_structures_of_parquet_and_arrow_are_columns(tmp_path, written_by):
    """As messages of ROS are written."""
    table = pd.DataFrame({"id": ROWS[:, 0].astype(int)})
    table["header"] = [
        {"stamp": {"sec": int(k // RATE_HZ), "nanosec": int(k % RATE_HZ * 1e8)}} for k in ROWS[:, 1]
    ]
    table["pose"] = [{"position": {"x": x, "y": y}, "covariance": [0.1]} for x, y in ROWS[:, 2:]]
    getattr(table, written_by)(tmp_path / "walk")
    assert_are_the_people(read_file(tmp_path / "walk").trajectories)
    table.at[3, "pose"] = None
    getattr(table, written_by)(tmp_path / "walk")
    assert len(read_file(tmp_path / "walk").trajectories) == len(ROWS) - 1


@pytest.mark.parametrize("text_of", [str, lambda span: str(span.to_pytimedelta())])
def test_spans_of_time_go_on_beyond_a_day(tmp_path, text_of):
    start = pd.Timedelta(hours=23, minutes=59, seconds=59)
    clock, *places = values(ROWS)
    spans = [text_of(start + pd.Timedelta(seconds=float(time))) for time in clock]
    path = written(
        tmp_path / "walk.csv",
        ["time", "id", "x", "y"],
        [spans, [f"{who:g}" for who in ROWS[:, 0]], *places],
        ";",
    )
    people = read_file(path).trajectories
    assert_are_the_people(replace(people, time_s=people.time_s - start.total_seconds()))


@pytest.mark.parametrize(
    ("titles", "meant"),
    [
        ("frame, timestamp, actor_id, x, y, z, yaw", "frame time_s track_id x_m y_m"),
        ("frame_idx, person_idx, x, y", "frame track_id x_m y_m"),
        ("timestep, track_id, position_x, position_y", "frame track_id x_m y_m"),
        ("time_step, id, x_est, y_est, vx_est", "frame track_id x_m y_m"),
        ("timestep_time, ped_id, person_x, person_y", "time_s track_id x_m y_m"),
        ("Zeit [Sek], Person Nr, X-Koordinate [cm], Y-Koordinate in cm", "time_s s track_id x_m cm y_m cm"),
        ("ZEITSTEMPEL, Fußgänger-ID, Rechtswert, Hochwert", "time_s track_id x_m y_m"),
        ("Uhrzeit (Sekunden), Fussgaenger, x in Metern, y in Metern", "time_s s track_id x_m m y_m m"),
        ("Bildnummer, Personennummer, x, y", "frame track_id x_m y_m"),
        ("Temps (secondes), Piéton, Coordonnée X, Coordonnée Y", "time_s s track_id x_m y_m"),
        ("tiempo [s], Peatón, posición x, posición y", "time_s s track_id x_m y_m"),
        ("fotogramma, pedone, x (metri), y (metri)", "frame track_id x_m m y_m m"),
        ("tijd, voetganger, x, y", "time_s track_id x_m y_m"),
        ("date_time_utc, object, x_pos, y_pos", "time_s track_id x_m y_m"),
        ("Timestamp (UTC), person, East, North", "time_s track_id x_m y_m"),
        ("timeStep, pedestrianId, x-PID2, y-PID2", "frame track_id x_m y_m"),
        ("Clock, Agent Name, x_filt, y_filt", "time_s track_id x_m y_m"),
        ("local_time, ped, east_m, north_m", "time_s track_id x_m m y_m m"),
    ],
)
def test_titles_may_be_those_of_other_languages(titles, meant):
    found = [meaning_of(title) for title in titles_in(titles)]
    words = [word for one in found if one for word in (one.name, one.unit) if word]
    assert " ".join(words) == meant


@given(
    st.sampled_from([" ", "\t", ",", ";", ", ", "  "]),
    st.booleans(),
    st.booleans(),
    st.sampled_from(list(LENGTH)),
)
@settings(max_examples=40, deadline=None, suppress_health_check=FIXTURE)
def test_a_text_without_titles_may_have_any_separator(tmp_path, separator, frame_first, comma, unit):
    comma = comma and "," not in separator
    _, *places = values(ROWS, x=unit, y=unit)
    places = [[field.replace(".", ",") if comma else field for field in column] for column in places]
    whole = [[f"{value:.0f}" for value in column] for column in ROWS[:, :2].T]
    path = written(
        tmp_path / "walk.txt", None, [*(whole[::-1] if frame_first else whole), *places], separator
    )
    path.write_text(f"# framerate: {RATE_HZ}\n# lengths in {unit}\n{path.read_text()}")
    assert_are_the_people(read_file(path).trajectories)


@pytest.mark.parametrize(
    "title",
    [
        "vx",
        "vehicle_id",
        "x_min",
        "x_velocity",
        "x [m/s]",
        "bbox_x",
        "image_x",
        "distance",
        "group",
        "z",
        "frame_rate",
        "edge",
        "id_x",
        "tx",
        "idx",
        "s",
        "x2",
        "person_speed",
        "x_time",
    ],
)
def test_other_words_make_other_columns(title):
    assert meaning_of(title) is None


@pytest.mark.parametrize(
    ("titles", "named"),
    [
        ("time,id,world_x,map_x,y", "columns world_x and map_x are both x_m"),
        ("time,person,agent,x,y", "columns person and agent are both track_id"),
        ("time,id,lon,lat", "lon is in degrees: project positions to metres"),
        ("time,id,x_cm,y", "column x_cm has the unit cm, column y has none.*--unit"),
        ("time,id,x,y_ft", "column y_ft has the unit ft, column x has none.*--unit"),
        ("time [h],id,x,y", r"no column for time_s.*Not used: time \[h\] because of 'h'"),
        ("time,id,x [km],y [km]", r"no column for x_m.*Not used: x \[km\] because of 'km'"),
        ("time,x,y", "no column for track_id.*if all rows are about one person, add a column id"),
        ("time,target_id,x,y", "no column for track_id.*Not used: target_id because of 'target'"),
        ("time,global_id,track_uuid,x,y", "columns global_id and track_uuid are both track_id"),
    ],
)
def test_titles_that_leave_something_open_are_refused(tmp_path, titles, named):
    path = tmp_path / "walk.csv"
    path.write_text(f"{titles}\n" + ",".join("1" for _ in titles.split(",")))
    with pytest.raises(SourceError, match=named):
        read_file(path)


@pytest.mark.parametrize(
    "title", ["global_id", "track_uuid", "tracked_object", "entity", "Visitor ID", "uniqueId", "device_id"]
)
def test_further_ids_count_where_no_title_says_more(title):
    assert titles_of_tracks(("time", title, "x", "y"))[title] == "track_id"
    assert title not in titles_of_tracks(("time", title, "person", "x", "y"))


@pytest.mark.parametrize("title", ["tracked", "global", "local", "unique", "tracker_name", "target"])
def test_other_words_beside_ids_are_no_ids(title):
    with pytest.raises(ValueRuleError, match="no column for track_id"):
        titles_of_tracks(("time", title, "x", "y"))


def test_plain_titles_win_over_other_words():
    assert "world_x" not in titles_of_tracks(("time", "id", "x", "y", "world_x"))
    assert titles_of_tracks(("frame", "time [ms]", "person_id", "x", "y"))["person_id"] == "track_id"
    assert titles_of_tracks(("time", "id", "person_id", "x", "y"))["person_id"] == "person_id"
    assert titles_of_tracks(("time", "Person Name", "Object ID", "x", "y"))["Object ID"] == "track_id"
    assert "frame" not in titles_of_tracks(("frame", "time [ms]", "id", "x", "y"))


def test_each_column_has_its_own_unit(tmp_path):
    clock, x, y = values(ROWS, x="cm", y="ft")
    ids = [f"{who:.0f}" for who in ROWS[:, 0]]
    path = written(tmp_path / "walk.csv", ["t", "id", "x_cm", "y [ft]"], [clock, ids, x, y])
    assert_are_the_people(read_file(path).trajectories)


# Titles that are wrong


@given(st.integers(0, 10_000), st.integers(2, 30), st.integers(10, 40), st.sampled_from([1, 2, 5]))
@settings(max_examples=40, deadline=None, suppress_health_check=FIXTURE)
def test_exchanged_titles_of_id_and_frame_are_refused(tmp_path, seed, people, steps, every):
    rows = crowd(seed, people, steps, every)
    columns = [[f"{value:.6g}" for value in column] for column in rows.T]
    titles, options = ["id", "frame", "x", "y"], TableOptions(rate_hz=25.0)
    right = read_file(written(tmp_path / "walk.csv", titles, columns), options)
    assert len(right.trajectories) == len(rows)
    wrong = written(tmp_path / "wrong.csv", ["frame", "id", "x", "y"], columns)
    with pytest.raises(SourceError, match=r"--columns"):
        read_file(wrong, options)
    named = read_file(wrong, TableOptions(tuple(titles), 25.0)).trajectories
    np.testing.assert_array_equal(named.position, right.trajectories.position)


@pytest.mark.parametrize(
    ("titles", "named"),
    [
        ("x,id,time,y", "x advances like a clock"),
        ("y,id,x,time", "y advances like a clock"),
        ("time,x,id,y", "id = .*whole number.*--columns"),
        ("time,y,x,id", "id = .*whole number.*--columns"),
        ("id,time,x,y", "id = .*whole number.*--columns"),
    ],
)
def test_other_exchanged_titles_are_refused(tmp_path, titles, named):
    clock, x, y = values(ROWS)
    columns = [clock, [f"{who:.0f}" for who in ROWS[:, 0]], x, y]
    with pytest.raises(SourceError, match=named):
        read_file(written(tmp_path / "walk.csv", titles.split(","), columns))


def test_degrees_are_refused(tmp_path):
    clock, x, y = values(ROWS * [1, 1, 1.35e-5, 0.9e-5] + [0, 0, 11.5, 48.1])
    columns = [clock, [f"{who:.0f}" for who in ROWS[:, 0]], x, y]
    path = written(tmp_path / "walk.csv", ["time", "id", "x", "y"], columns)
    with pytest.raises(SourceError, match=r"look like degrees of longitude and latitude.*Project"):
        read_file(path)
    assert len(read_file(path, TableOptions(unit="m")).trajectories) == len(ROWS)


# Rows and values


@pytest.mark.parametrize("suffix", ["csv", "txt"])
@pytest.mark.parametrize("missing", ["nan", "NaN", "NA", "null"])
def test_missing_positions_are_left_out_and_copies_too(tmp_path, caplog, suffix, missing):
    columns = [[f"{value:.6g}" for value in column] for column in ROWS.T]
    for column in columns:
        column.append(column[0])  # a copy
    for at, column in enumerate(columns):
        column.append("9" if at < 2 else missing)
    titles = ["id", "frame", "x", "y"] if suffix == "csv" else None
    path = written(tmp_path / f"walk.{suffix}", titles, columns, " ")
    assert_are_the_people(read_file(path, TableOptions(rate_hz=RATE_HZ)).trajectories)
    last = len(ROWS) + 2 + (titles is not None)
    assert f"missing detections, and left out: 1 row, the first in line {last}" in caplog.text
    assert f"repeat another one are left out: 1 row, the first in line {last - 1}" in caplog.text


@pytest.mark.parametrize(
    ("content", "named"),
    [
        (
            't,id,x,y\n0,1,"1,234",2\n',
            "line 2: the comma in 1,234 may be a decimal one, or separate thousands",
        ),
        ("t;id;x;y\n0;1;1,5;2.5\n", "line 2: numbers have commas in line 2 and points in line 2"),
        ("t,id,x,y\n0,1,-inf,2\n", "line 2: x = '-inf', but it must be finite.*remove"),
        ("t,id,x,y\n0,,1,2\n", "line 2: id = '', but everybody needs an id"),
        ("t,id,x,y\nnan,1,1,2\n", "line 2: t = 'nan', but it must be finite"),
        ("t,id,x,y\n0,1,1,2\n0,1,1,3\n", "line 3: .* again, first in line 2, at another place.*each"),
        (f"t,id,x,y\n0,{'a' * 300},1,2\n", "line 2: id has 300 characters, expected at most 200"),
        ("# lengths in cm\nt,id,x [m],y [m]\n0,1,1,2\n", "lengths are said to be cm and m.*comments"),
        ("t,x_1,y_1,x_2,y_2\n0,1,2,3,4\n", "x_1, y_1 and x_2, y_2 are those of several.*a line per person"),
        ("t;p1.x [cm];p1.y [cm];p2.x [cm];p2.y [cm]\n0;1;2;3;4\n", r"p1\.x \[cm\], p1\.y \[cm\] and p2\.x"),
        ("frame,id,x1,y1,x2,y2\n0,1,2,3,4,5\n", "x1, y1 and x2, y2 are .* corners of boxes"),
        ("id,x,y,x1,y1,x2,y2\n1,0,0,2,3,4,5\n", "no column for time_s.*Rename columns"),
    ],
)
def test_what_cannot_be_meant_is_refused_with_a_remedy_for_an_own_file(tmp_path, content, named):
    path = tmp_path / "walk.csv"
    path.write_text(content)
    with pytest.raises(SourceError, match=named) as error:
        read_file(path)
    assert "fetch" not in str(error.value)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
@pytest.mark.parametrize("unit", ["µs", "s"])
def test_any_usual_encoding_is_the_same_people(tmp_path, encoding, unit, caplog):
    """Comments, titles and names have letters that are no ASCII."""
    clock, *places = values(ROWS, time=unit.replace("µ", "u"))
    names = [f"Jürgen {who:.0f}" for who in ROWS[:, 0]]
    path = written(
        tmp_path / "walk.csv", [f"t [{unit}]", "id", "x", "y", "größe"], [clock, names, *places, clock]
    )
    path.write_bytes(f"# überall in m\n{path.read_text()}".encode(encoding))
    options = TableOptions()
    assert_are_the_people(read_file(path, options).trajectories)
    assert set(options.names.of_number.values()) == set(names)
    assert ("Windows-1252" in caplog.text) == (encoding == "cp1252")


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
def test_other_encodings_are_named(tmp_path, encoding):
    path = tmp_path / "walk.csv"
    path.write_bytes("t,id,x,y,größe\n0,1,1,2,3\n".encode(encoding))
    with pytest.raises(SourceError, match="UTF-8"):
        read_file(path)


@pytest.mark.parametrize("ends", [(",", ","), ("", ","), (",", "")])
def test_a_separator_may_end_lines(tmp_path, ends):
    clock, *places = values(ROWS)
    columns = [clock, [f"{who:.0f}" for who in ROWS[:, 0]], *places]
    head, *rows = written(tmp_path / "w.csv", ["t", "id", "x", "y"], columns).read_text().splitlines()
    path = tmp_path / "walk.csv"
    path.write_text("\n".join([head + ends[0], *(row + ends[1] for row in rows), ",,,"]))
    assert_are_the_people(read_file(path).trajectories)


def test_info_says_what_was_taken_for_what(tmp_path, caplog):
    clock, *places = values(ROWS, time="ms", x="cm", y="cm")
    columns = [clock, [f"p{who:.0f}" for who in ROWS[:, 0]], *places, clock]
    path = written(tmp_path / "walk.csv", ["t [ms]", "ped", "xcm", "ycm", "note"], columns)
    caplog.set_level("INFO")
    main(["info", str(path)])
    assert (
        "columns time = t [ms] (ms), track_id = ped, x = xcm (cm), y = ycm (cm); not used: note"
        in caplog.text
    )
    assert "ids are words, and numbered: p1 is 0" in caplog.text
