"""Traits that exporters give to tables: repeated headers, missing values, pixels, odd ids and clocks."""

import logging
import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pedpred.errors import SourceError, ValueRuleError
from pedpred.geometry import Homography
from pedpred.sources.single_file import read_file
from pedpred.tables import quotes
from pedpred.tables.missing import MISSING
from pedpred.tables.names import TrackNames
from pedpred.tables.options import TableOptions
from tests.scenes import assert_same

STEP_S, COUNT = 0.25, 24
WALK = [
    (STEP_S * k, who, round(3 + 1.1 * STEP_S * k + 3 * who, 3), round(5 * who + 2 * math.sin(k / 9), 3))
    for k in range(COUNT)
    for who in (1, 2)
]
"""Time, id, x, y of two people who walk."""
TITLES = ("time", "id", "x", "y")
FIXTURE = [HealthCheck.function_scoped_fixture]


def write(folder, rows, header=TITLES, separator=",", name="walk.csv"):
    path = folder / name
    path.write_text(
        "\n".join(separator.join(map(str, row)) for row in ([header] if header else []) + [*rows])
    )
    return path


def tracks(path, **options):
    return read_file(path, TableOptions(**options)).trajectories


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    return tracks(write(tmp_path_factory.mktemp("plain"), WALK))


@given(st.lists(st.integers(1, len(WALK)), max_size=3), st.integers(0, 3), st.integers(0, 3), st.data())
@settings(deadline=None, suppress_health_check=FIXTURE)
def test_what_says_nothing_changes_nothing(tmp_path, plain, again, blank_titles, blanks, data):
    """Headers that are repeated, blank columns at the end, missing positions in any spelling, and nobody."""
    blanks = max(blanks, blank_titles)
    rows = [(*row, *[""] * blanks) for row in WALK]
    spelling = data.draw(st.sampled_from(sorted(MISSING)))
    rows.insert(7, (99, 1, spelling, spelling.upper(), *[""] * blanks))
    rows.insert(data.draw(st.integers(0, len(rows))), (0.5, -1, 100.0, 1.0, *[""] * blanks))
    header = (*TITLES, *[""] * blank_titles)
    for line in again:
        rows.insert(line, header)
    assert_same(tracks(write(tmp_path, rows, header)), plain)


@pytest.mark.parametrize("separator", [",", ";"])
def test_commas_in_quotes_are_decimal_unless_they_may_separate_thousands(tmp_path, plain, separator):
    rows = [[f'"{str(value).replace(".", ",")}"' for value in row] for row in WALK]
    assert_same(tracks(write(tmp_path, rows, separator=separator)), plain)
    thousands = [(1000 * t, who, f'"{1000 * x:,.0f}"', 0) for t, who, x, _ in WALK]
    with pytest.raises(SourceError, match=r"line 2: .*thousands separators"):
        tracks(write(tmp_path, thousands, ("time_ms", "id", "x_mm", "y_mm")))


@pytest.mark.parametrize("said", ["Unit,cm", "Length Units;Centimeters", "Lab 3\tunits\tcm", "# unit cm"])
def test_lines_above_a_header_say_the_unit(tmp_path, plain, said):
    rows = [(t, who, round(100 * x, 1), round(100 * y, 1)) for t, who, x, y in WALK]
    found = tracks(write(tmp_path, [TITLES, *rows], [said]))
    np.testing.assert_allclose(found.position, plain.position, atol=1e-9)


@pytest.mark.parametrize("header", [TITLES, None])
def test_who_is_at_two_places_is_named_as_in_the_file(tmp_path, header):
    rows = [(t, "AB"[who - 1], x, y) for t, who, x, y in WALK]
    path = write(tmp_path, [*rows, (rows[3][0], "B", 99.0, 1.0)], header)
    with pytest.raises(SourceError, match="track_id B and time_s"):
        tracks(path)


@pytest.mark.parametrize("separator", [";", "\t"])
def test_decimal_commas_are_read_in_every_column_that_is_used(tmp_path, plain, separator):
    rows = [[str(value).replace(".", ",") for value in (*row, 1.5, 0.25, row[1])] for row in WALK]
    found = tracks(write(tmp_path, rows, (*TITLES, "vx_mps", "vy_mps", "person_id"), separator))
    np.testing.assert_array_equal(found.velocity, [[1.5, 0.25]] * len(WALK))
    np.testing.assert_array_equal(found.position, plain.position)


@pytest.mark.parametrize(("title", "value"), [("vx_mps", ""), ("group_id", "A"), ("person_id", "0.5")])
def test_a_column_that_is_not_needed_may_hold_anything(tmp_path, plain, title, value, caplog):
    rows = [(*row, 0, value if row == WALK[9] else 0) for row in WALK]
    assert_same(tracks(write(tmp_path, rows, (*TITLES, "vy_mps", title))), plain)
    assert f"line 11: {title} = " in caplog.text
    assert f"Column {title} is not used" in caplog.text


@pytest.mark.parametrize("separator", [",", ";", "\t", " "])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\n\n"])
def test_fields_in_quotes_may_have_line_ends(tmp_path, plain, separator, end):
    note = f'"one {end}two ""three"" {end} 1,2,3,4"'
    rows = [(t, who, note, x, y) for t, who, x, y in WALK]
    path = write(tmp_path, rows, ("time", "id", f'"a{end}note"', f'"x{end}[m]"', '"y [m]"'), separator)
    assert_same(tracks(path), plain)
    path.write_text("\n".join([path.read_text(), separator.join(["1.0", "1", note, "here", "2.0"])]))
    with pytest.raises(SourceError, match=r"line \d+: x ?\[m\] = 'here'") as refused:
        tracks(path)
    line = int(str(refused.value).partition("line ")[2].partition(":")[0])
    assert path.read_text().splitlines()[line - 1].startswith(f"1.0{separator}1{separator}")


def test_a_quote_that_begins_no_field_or_is_not_closed_holds_nothing_together(tmp_path, plain):
    """Inches, and a quote in a comment."""
    rows = [(*row, '5 " wide') for row in WALK]
    assert_same(tracks(write(tmp_path, rows, ('# "quoted,a,b,c\ntime', *TITLES[1:], "note"))), plain)
    rows[3] = (*WALK[3], '"not closed')
    assert_same(tracks(write(tmp_path, rows, (*TITLES, "note"))), plain)


def test_a_quote_that_is_not_closed_is_looked_at_once(monkeypatch):
    looks = []
    look = quotes._ends_inside
    monkeypatch.setattr(quotes, "_ends_inside", lambda text: looks.append(text) or look(text))
    written = [(k, f'{k},1,2.0,3.0,"a note{" " * (k % 3)}\n') for k in range(300)]
    assert list(quotes.joined(written)) == written
    assert len(looks) == len(written)


def test_ids_with_underscores_are_words(tmp_path, plain):
    names = TrackNames()
    path = write(tmp_path, [(t, f"1_{who}", x, y) for t, who, x, y in WALK])
    assert_same(tracks(path, names=names), type(plain)(plain.time_s, plain.track_id - 1, plain.position))
    assert names.of_number == {0: "1_1", 1: "1_2"}


@pytest.mark.parametrize("separator", [",", ";", " "])
def test_rows_that_begin_like_comments_are_not_left_out_without_a_word(tmp_path, plain, separator, caplog):
    rows = [("#" * (who == 2) + str(who), t, x, y) for t, who, x, y in WALK]
    with caplog.at_level(logging.WARNING):
        found = tracks(write(tmp_path, rows, ("id", "time", "x", "y"), separator))
    assert set(found.track_id) == {1}
    assert "24 rows, the first in line 3, begin with #, % or //, and are left out" in caplog.text
    quoted = [(f'"{row[0]}"', *row[1:]) for row in rows]
    assert len(tracks(write(tmp_path, quoted, ("id", "time", "x", "y"), separator))) == len(plain)
    caplog.clear()
    notes = ("# 3 people", "# time, id, x, y", "% 1 2", "// 4")
    assert_same(tracks(write(tmp_path, [*WALK[:4], *((note,) for note in notes), *WALK[4:]])), plain)
    assert "begin with" not in caplog.text


@pytest.mark.parametrize("quote", ["", '"'])
@pytest.mark.parametrize("separator", ["\t", ";", ",", "|"])
def test_empty_fields_may_begin_and_end_lines(tmp_path, plain, separator, quote):
    rows = [("", t, f"{quote}{who}{quote}", x, y, "", "") for t, who, x, y in WALK]
    assert_same(tracks(write(tmp_path, rows, ("note", *TITLES, "a", "b"), separator)), plain)
    numbered = [(3 * n, *row[1:]) for n, row in enumerate(rows)]
    assert_same(tracks(write(tmp_path, numbered, ("", *TITLES, "a", "b"), separator)), plain)


@pytest.mark.parametrize("grouped", ["1'234.5", "1.234,5", "1,234.5", "1 234,5"])
def test_thousands_separators_are_named(tmp_path, grouped):
    rows = [(t, who, grouped, 0) for t, who, *_ in WALK]
    with pytest.raises(SourceError, match="thousands separators"):
        tracks(write(tmp_path, rows, ("time", "id", "x_mm", "y_mm"), ";"))


@given(st.integers(2**63, 2**130))
@settings(deadline=None, suppress_health_check=FIXTURE)
def test_ids_of_any_length_are_people(tmp_path, plain, first):
    found = tracks(write(tmp_path, [(t, first + who, x, y) for t, who, x, y in WALK]))
    np.testing.assert_array_equal(found.position, plain.position)
    assert np.unique(found.track_id).tolist() == [0, 1]


@pytest.mark.parametrize(
    "titles", [("frame", "id", "x_px", "y_px"), ("frame", "id", "x [pixel]", "y [pixel]"), None]
)
def test_pixels_need_their_place_on_the_ground(tmp_path, plain, titles):
    rows = [(round(t / STEP_S), who, f"{40 * x:.3f}", f"{-40 * y:.3f}") for t, who, x, y in WALK]
    path = write(tmp_path, rows, titles)
    downwards = Homography(np.diag([0.025, -0.025, 1.0])[:, [1, 0, 2]])
    for options in ({"pixel_m": 0.025}, {"homography": downwards}):
        found = tracks(path, rate_hz=1 / STEP_S, **options)
        np.testing.assert_allclose(found.position, plain.position, atol=1e-3)
        np.testing.assert_allclose(found.time_s, plain.time_s)
    if titles:
        with pytest.raises(SourceError, match=r"positions are in pixels.*--scale 0.03, or give --homography"):
            tracks(path, rate_hz=1 / STEP_S)
    with pytest.raises(ValueRuleError, match="pixels, whose size is given"):
        TableOptions(pixel_m=0.025, unit="cm")


def test_metres_beside_pixels_are_used(tmp_path, plain):
    rows = [(t, who, 40 * x, 40 * y, x, y) for t, who, x, y in WALK]
    found = tracks(write(tmp_path, rows, ("time", "id", "x_px", "y_px", "world x", "world y")))
    np.testing.assert_array_equal(found.position, plain.position)


def test_boxes_without_titles_are_no_positions(tmp_path):
    boxes = [(k, who, 40 * x, 40 * y, 20, 50) for k, (_, who, x, y) in enumerate(WALK)]
    for rest in ((1, -1, -1, -1), (1, 1, 0.75)):
        for options in ({"pixel_m": 0.025}, {"unit": "cm"}):
            path = write(tmp_path, [(*box, *rest) for box in boxes], None)
            with pytest.raises(SourceError, match=r"boxes of MOTChallenge.*frame,id,x_px,y_px"):
                tracks(path, rate_hz=4.0, **options)
    with pytest.raises(SourceError, match=r"6 columns in pixels may be those of boxes.*--columns"):
        tracks(write(tmp_path, boxes, None), pixel_m=0.025, rate_hz=4.0)


@pytest.mark.parametrize("sure", [-1, 0, 0.87, 1])
@pytest.mark.parametrize("separator", [",", " "])
def test_places_behind_boxes_without_titles_are_asked_for(tmp_path, plain, sure, separator):
    rows = [
        (round(t / STEP_S), who, 400 + 40 * x, 40 * y, 40.5, 112, sure, x, y, 0.0) for t, who, x, y in WALK
    ]
    path = write(tmp_path, rows, None, separator)
    for unit in (None, "cm"):
        with pytest.raises(SourceError, match=r"line 1: .*boxes of MOTChallenge.*ground") as refused:
            tracks(path, rate_hz=1 / STEP_S, unit=unit)
    named = str(refused.value).split("--columns ")[1].split(",")
    assert_same(tracks(path, rate_hz=1 / STEP_S, columns=tuple(named)), plain)


@pytest.mark.parametrize("classes", [(0, 0), (3, 4)])
def test_classes_without_titles_are_no_positions(tmp_path, plain, classes):
    rows = [(round(t / STEP_S), who, classes[who - 1], x, y, 0.3) for t, who, x, y in WALK]
    path = write(tmp_path, rows, None)
    with pytest.raises(SourceError, match=r"column 3 should be x.*as a class does.*--columns time,id,x,y"):
        tracks(path, rate_hz=1 / STEP_S)
    assert_same(tracks(path, columns=("frame", "id", "kind", "x", "y", "width"), rate_hz=1 / STEP_S), plain)
    lane = write(tmp_path, [(who, round(t / STEP_S), who, y) for t, who, x, y in WALK], None)
    assert len(tracks(lane, rate_hz=1 / STEP_S)) == len(WALK)


@pytest.mark.parametrize(
    ("order", "ids", "named"),
    [
        ("id frame time x y", (1, 2), r"column 3 should be x.*as a time is.*--columns"),
        ("frame id time x y", (1, 2), r"column 3 should be x.*as a time is.*--columns"),
        ("frame x y id", (5, 17), r"y holds few whole numbers.*--columns"),
        ("frame x y id", (5, 17, 40), r"y holds few whole numbers.*--columns"),
        ("id x y time", (5, 17, 40), r"y advances like a clock.*--columns"),
    ],
)
def test_other_orders_without_titles_are_asked_about(tmp_path, order, ids, named):
    rows = []
    third = [(t, 3, 4 * t / 5, 9 + math.cos(t)) for t, who, *_ in WALK if who == 1]
    for t, who, x, y in WALK + third * (len(ids) > 2):
        row = {"frame": round(t / STEP_S), "time": t, "x": 0.4 * x, "y": 0.4 * y, "id": ids[who % len(ids)]}
        rows.append([row[title] for title in order.split()])
    with pytest.raises(SourceError, match=named):
        tracks(write(tmp_path, rows, None), rate_hz=1 / STEP_S)


@given(st.floats(0.0, 0.15), st.sampled_from(["z", "Pos Z", "z [m]"]))
@settings(deadline=None, suppress_health_check=FIXTURE)
def test_heights_that_sway_are_no_positions(tmp_path, sway_m, title):
    rows = [(t, who, x, round(1.7 + sway_m * math.sin(9 * t), 3), y) for t, who, x, y in WALK]
    with pytest.raises(SourceError, match=r"y looks like a height.*--columns time,id,x,height,y"):
        tracks(write(tmp_path, rows, ("time", "id", "x", "y", title)))
    ground = [(t, who, x, y, height) for t, who, x, height, y in rows]
    assert len(tracks(write(tmp_path, ground, ("time", "id", "x", "y", title)))) == len(WALK)


@pytest.mark.parametrize("end", ["", "\n", "\r\n", " \n\n"])
@pytest.mark.parametrize("header", [(*TITLES, "z"), None])
def test_people_may_walk_along_an_axis_at_one_height_however_the_file_ends(tmp_path, header, end):
    path = tmp_path / "walk.csv"
    rows = [(time if header else round(time / STEP_S), who, x, 0, 1.1) for time, who, x, _ in WALK]
    lines = [",".join(map(str, row)) for row in ([header] if header else []) + rows]
    path.write_bytes(("\n".join(lines) + end).encode())
    read = tracks(path, rate_hz=None if header else 1 / STEP_S)
    np.testing.assert_array_equal(read.position[:, 0], [x for _, _, x, _ in WALK])


@pytest.mark.parametrize("place", [-1, 999, -9999])
@pytest.mark.parametrize("unit", ["m", "mm"])
def test_one_jump_to_a_usual_placeholder_is_enough(tmp_path, plain, place, unit):
    parts = {"m": 1, "mm": 1000}[unit]
    rows = [(t, who, parts * (x + 90), parts * (y + 90)) for t, who, x, y in WALK]
    rows[20] = (*rows[20][:2], place, place)
    found = tracks(write(tmp_path, rows), unit=unit)
    np.testing.assert_allclose(found.position, np.delete(plain.position, 20, axis=0) + 90, atol=1e-6)


@pytest.mark.parametrize(
    "form", ["%d-%b-%Y %H:%M:%S.%f", "%b %d, %Y %H:%M:%S.%f", "%Y%m%dT%H%M%S.%f", "%Y-%m-%d %H:%M:%S.%f+02"]
)
def test_further_forms_of_dates(tmp_path, plain, form):
    start = np.datetime64("2026-03-05T14:02:07").astype(object)
    moments = [np.timedelta64(round(1e6 * t), "us").astype(object) + start for t, *_ in WALK]
    rows = [(moment.strftime(form), *row[1:]) for moment, row in zip(moments, WALK, strict=True)]
    found = tracks(write(tmp_path, rows, separator=";"))
    first = np.datetime64("2026-03-05T14:02:07", "s").astype(float) - (7200 if "+02" in form else 0)
    np.testing.assert_allclose(found.time_s - first, plain.time_s, atol=1e-6)


@pytest.mark.parametrize("day", ["2026-12-24", "24.12.2026", "12/24/2026"])
def test_all_rows_have_a_date_or_none_has(tmp_path, day):
    rows = [(day if t else "", f"10:00:{t:06.3f}", *row) for t, *row in WALK]
    with pytest.raises(SourceError, match=r"line 4: time = '10:00:00.250', with a date, unlike the rows"):
        tracks(write(tmp_path, rows, ("date", *TITLES)))
    with pytest.raises(SourceError, match=r"line 48: time = '10:00:00.000', without a date"):
        tracks(write(tmp_path, rows[2:] + rows[:2], ("date", *TITLES)))
    other = {"2026-12-24": "24/12/2026"}.get(day, "2026-12-24")
    rows = [(day if t else other, *row) for (_, *row), (t, *_) in zip(rows, WALK, strict=True)]
    with pytest.raises(SourceError, match=r"line 4: .*but the dates before are written otherwise"):
        tracks(write(tmp_path, rows, ("date", *TITLES)))


def test_minutes_and_seconds_are_times_until_the_hour_ends(tmp_path, plain):
    rows = [(f"59:{50 + t:06.3f}", *row) for t, *row in WALK]
    found = tracks(write(tmp_path, rows))
    np.testing.assert_allclose(found.time_s - 59 * 60 - 50, plain.time_s)
    with pytest.raises(SourceError, match=r"time goes back from the end of an hour to 00:00"):
        tracks(write(tmp_path, [*rows, ("00:00.500", 1, 9, 9)]))


def test_times_that_are_too_coarse_and_one_id_for_all_are_told_apart(tmp_path):
    with pytest.raises(SourceError, match=r"times are too coarse.*more decimals"):
        tracks(write(tmp_path, [(int(t), *row) for t, *row in WALK]))
    runs = [*WALK, *((t, who, x + 1.5, y) for t, who, x, y in WALK)]
    with pytest.raises(SourceError, match=r"at another place\. .*in several runs, make a file for each"):
        tracks(write(tmp_path, runs))
    with pytest.raises(SourceError, match=r"all lines have this id.*--columns time,id,x,y"):
        tracks(write(tmp_path, [(t, 0, *row) for t, _, *row in WALK]))


@pytest.mark.parametrize("titles", [("frame", *TITLES[1:]), None])
@pytest.mark.parametrize("clock", [lambda k: (k + 206) % 256, lambda k: (k + 30) * (40 if k < 36 else 1)])
def test_clocks_that_begin_again_or_change_their_unit_are_doubted(tmp_path, titles, clock, caplog):
    """Of ranges that no counter has; rows of people one after the other are no such clocks."""
    walk = [
        (k, who, round(3 * who + 0.1 * k + math.sin(k / 9), 3), 5 * who + math.sin(k / 7))
        for k in range(72)
        for who in (1, 2)
    ]
    tracks(write(tmp_path, [(clock(k), *row) for k, *row in walk], titles), rate_hz=10.0)
    assert "time goes back from" in caplog.text
    assert "the same person follows" in caplog.text
    caplog.clear()
    ways = [[row for row in walk if row[1] == who] for who in (1, 2)]
    tracks(write(tmp_path, [*ways[0][:20], *ways[1], *ways[0][40:]], titles), rate_hz=10.0)
    assert "goes back" not in caplog.text


def test_recordings_that_were_joined_are_doubted(tmp_path, caplog):
    joined = [*WALK, *((t, who + 10, x, y) for t, who, x, y in WALK)]
    with caplog.at_level(logging.WARNING):
        tracks(write(tmp_path, joined))
    assert "time goes back in line 50, and other people follow" in caplog.text
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        tracks(write(tmp_path, sorted(joined, key=lambda row: row[1])))
        tracks(write(tmp_path, sorted(joined)))
    assert "time goes back" not in caplog.text


@pytest.mark.parametrize("order", [[1, 0], [0, 1]])
@pytest.mark.parametrize("separator", [",", " "])
def test_numbers_of_rows_before_a_text_without_titles_are_not_read(tmp_path, plain, order, separator):
    who_and_when = [(who, round(t / STEP_S)) for t, who, *_ in WALK]
    rows = [
        (3 * n, *(pair[k] for k in order), *row[2:])
        for n, (pair, row) in enumerate(zip(who_and_when, WALK, strict=True))
    ]
    found = tracks(write(tmp_path, rows, None, separator), rate_hz=1 / STEP_S)
    assert_same(found, plain)


@pytest.mark.parametrize(
    ("comments", "rate_hz"),
    [
        ("# sampled at 4 Hz", None),
        ("# frame rate is 4", None),
        ("# frame rate [1/s]: 4", None),
        ("# frames per second: 4", None),
        ("# framerate: 0,4e1", None),
        ("# 4,00 fps", None),
        ("# framerate: 40.0000e-01", None),
        ("# fps .4e+1", None),
        ("# Frame rate,4", None),
        ("# fps;4,0", None),
        ("# frame rate ....... 4", None),
        ("# frame rate.......4", None),
        ("# cam0 fps4", None),
        ("# r_frame_rate=4000/1000", None),
        ("# framerate: 4 fps (1920x1080)", None),
        ("# video 25 fps, tracks 4 fps", 4.0),
    ],
)
def test_comments_say_the_rate_in_any_words(tmp_path, plain, comments, rate_hz):
    rows = [(who, round(t / STEP_S), x, y) for t, who, x, y in WALK]
    path = write(tmp_path, rows, (comments,), " ")
    assert_same(tracks(path, rate_hz=rate_hz), plain)
    if rate_hz:
        with pytest.raises(SourceError, match=r"frame rate 4 and 25 Hz.*--rate"):
            tracks(path)
