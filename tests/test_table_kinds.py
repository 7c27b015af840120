"""Tables as programs write them: other road users, dates, parts of stamps, lines around a header."""

import logging
import math
from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pedpred
from pedpred.command import main
from pedpred.errors import SourceError, ValueRuleError
from pedpred.sources.single_file import read_file
from pedpred.tables.options import TableOptions
from tests.scenes import assert_same

COUNT, STEP_S = 12, 0.25
WALK = [
    (STEP_S * k, who, round(1.1 * STEP_S * k + 3 * who, 3), round(5 * who + 0.1 * math.sin(k), 3))
    for k in range(COUNT)
    for who in (1, 2)
]
"""Time, id, x, y of two people who walk."""


def write(folder, header, rows, name="walk.csv"):
    path = folder / name
    path.write_text("\n".join([*header, *(",".join(map(str, row)) for row in rows), ""]))
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("tables")


@pytest.fixture(scope="module")
def plain(folder):
    return read_file(write(folder, ["time,id,x,y"], WALK, "plain.csv")).trajectories


def tracks(path, **options):
    return read_file(path, TableOptions(**options)).trajectories


PEOPLE = st.sampled_from(["pedestrian", "Person", "PEDESTRIAN", "human.pedestrian.adult", "ped", "child"])
OTHERS = st.sampled_from(["car", "Cyclist", "robot", "VEHICLE", "vehicle.bus", "unknown"])
CLASS_TITLES = st.sampled_from(
    ["class", "type", "agent_type", "objectType", "category", "label", "Class Name"]
)


@given(CLASS_TITLES, st.lists(PEOPLE, min_size=1, max_size=3), st.lists(OTHERS, max_size=3), st.data())
def test_rows_of_other_road_users_change_nothing(folder, plain, title, people, others, data):
    rows = [(t, who, x, y, people[k % len(people)]) for k, (t, who, x, y) in enumerate(WALK)]
    for number, other in enumerate(others):
        for k in range(COUNT):
            row = (STEP_S * k, 50 + number, data.draw(st.sampled_from(["", 3.0 * k])), -2.0, other)
            rows.insert(data.draw(st.integers(0, len(rows))), row)
    assert_same(tracks(write(folder, [f"time,id,x,y,{title}"], rows)), plain)


def test_who_was_left_out_is_said(tmp_path, caplog):
    rows = [(*row, "person") for row in WALK] + [(0.0, 9, 1.0, 1.0, "dog"), (0.25, 9, 1.0, 1.0, "dog")]
    with caplog.at_level(logging.INFO):
        tracks(write(tmp_path, ["time,id,x,y,type"], rows))
    assert "y = y (m), class = type" in caplog.text
    assert "not used" not in caplog.text
    assert "column type: rows that are about no people are left out: 2 of 'dog'" in caplog.text


def test_classes_that_are_numbers_are_asked_about(tmp_path, plain, caplog, capsys):
    rows = [(*row, 7) for row in WALK] + [(t, 9, 1.0, 3.0 * t, 3) for t, who, *_ in WALK if who == 1]
    path = write(tmp_path, ["time,id,x,y,class_id"], rows)
    with caplog.at_level(logging.WARNING):
        assert len(tracks(path)) == len(rows)
    assert (
        "column class_id holds 3, 7, no words for people: all rows are read; --class chooses" in caplog.text
    )
    assert_same(tracks(path, classes=("7",)), plain)
    main(["info", str(path), "--class", "7"])
    assert "24 of 2 tracks" in capsys.readouterr().out
    with pytest.raises(SourceError, match="no row is of class 8") as error:
        tracks(path, classes=("8",))
    assert "class_id" in str(error.value)
    with pytest.raises(SourceError, match="no column has classes"):
        tracks(write(tmp_path, ["time,id,x,y"], WALK), classes=("7",))
    text = tmp_path / "walk.txt"
    text.write_text("".join(f"{who} {round(t / STEP_S)} {x} {y}\n" for t, who, x, y in WALK))
    with pytest.raises(ValueRuleError, match="without classes to choose from"):
        tracks(text, rate_hz=4.0, classes=("7",))


def test_a_column_that_holds_other_words_is_no_class(tmp_path, plain, caplog):
    walking = [(*row, "walking" if row[1] == 1 else "standing") for row in WALK]
    with caplog.at_level(logging.WARNING):
        assert_same(tracks(write(tmp_path, ["time,id,x,y,label"], walking)), plain)
    assert "label holds standing, walking, no words for people" in caplog.text
    caplog.clear()
    same = [(*row, 0) for row in WALK]
    with caplog.at_level(logging.WARNING):
        assert_same(tracks(write(tmp_path, ["time,id,x,y,class"], same)), plain)
    assert not caplog.text


def test_the_same_people_are_taken_from_a_data_frame(model):
    frame = pd.DataFrame(WALK, columns=["time", "id", "x", "y"])
    car = frame.assign(id=9, y=-4.0 * frame.time, type="car").drop_duplicates(["time", "id"])
    both = pd.concat([frame.assign(type="person"), car], ignore_index=True)
    pd.testing.assert_frame_equal(
        pedpred.predict(both, model=model[0]), pedpred.predict(frame, model=model[0])
    )


@pytest.mark.parametrize(
    "title", ["scene", "run_id", "recordingId", "floor", "camera", "topic", "log_id", "day", "hour", "minute"]
)
def test_several_recordings_in_one_table_are_warned_about(title, tmp_path, caplog):
    rows = [(*row, row[1]) for row in WALK]
    with caplog.at_level(logging.WARNING):
        tracks(write(tmp_path, [f"time,id,x,y,{title}"], rows))
    assert f"column {title} holds 1, 2: all are read as one recording" in caplog.text
    assert ("one column of times" in caplog.text) is (title in ("day", "hour", "minute"))


def test_a_column_that_counts_messages_is_no_column_of_recordings(tmp_path, plain, caplog):
    rows = [(*row, k // 2) for k, row in enumerate(WALK)]
    with caplog.at_level(logging.WARNING):
        assert_same(tracks(write(tmp_path, ["time,id,x,y,sequence"], rows)), plain)
    assert not caplog.text


@pytest.mark.parametrize(
    ("title", "seen", "unseen"),
    [("valid", "True", "False"), ("Valid", 1, 0), ("lost", 0, 1), ("outside", "f", "t")],
)
def test_rows_that_say_that_nobody_was_seen_are_warned_about(tmp_path, plain, title, seen, unseen, caplog):
    rows = [(*row, seen if row[0] < 2 else unseen) for row in WALK]
    with caplog.at_level(logging.WARNING):
        assert_same(tracks(write(tmp_path, [f"time,id,x,y,{title}"], rows)), plain)
        flag = unseen in ("True", 1, "t")
        assert (
            f"column {title} is {flag} in {2 * (COUNT - 8)} rows, which are read like others" in caplog.text
        )
        caplog.clear()
        tracks(write(tmp_path, [f"time,id,x,y,{title}"], [(*row, seen) for row in WALK]))
        assert not caplog.text


ZONES = st.sampled_from([None, UTC, timezone(timedelta(hours=-3, minutes=-30)), timezone(timedelta(hours=9))])
STARTS = st.datetimes(datetime(1971, 1, 1), datetime(2090, 1, 1), timezones=ZONES)


@settings(deadline=None)
@given(STARTS, st.sampled_from("T "), st.sampled_from(["-", "/"]), st.booleans())
def test_dates_are_seconds(folder, plain, start, between, sign, split):
    def written(t):
        moment = start + timedelta(seconds=t)
        text = moment.isoformat(sep="T", timespec="milliseconds")
        day, clock = text.split("T")
        return f"{day.replace('-', sign)},{clock}" if split else f"{day.replace('-', sign)}{between}{clock}"

    header = "date,time,id,x,y" if split else "timestamp,id,x,y"
    if split and start.tzinfo is not None:
        return  # nobody writes zones there
    found = tracks(write(folder, [header], [(written(t), *row) for t, *row in WALK]))
    first = start if start.tzinfo else start.replace(tzinfo=UTC)
    np.testing.assert_allclose(
        found.time_s, plain.time_s + math.floor(first.timestamp() * 1e3) / 1e3, atol=1e-4
    )
    np.testing.assert_array_equal(found.position, plain.position)


@pytest.mark.parametrize(
    "day", ["2024-03-{:02} 00:00:00", "202403{:02}", "{:02}.03.2024 00:00", "3/{}/2024 12:00:00 AM"]
)
def test_dates_beside_times_of_day_may_say_midnight_or_have_no_signs(tmp_path, plain, day):
    rows = [(day.format(12 + who), f"14:02:{t:06.3f}", who, *row) for t, who, *row in WALK]
    found = tracks(write(tmp_path, ["date,time,id,x,y"], rows))
    for who in (1, 2):
        mine, first = (one.select(one.track_id == who) for one in (found, plain))
        np.testing.assert_allclose(np.diff(mine.time_s), np.diff(first.time_s), atol=1e-4)
    days = [found.time_s[found.track_id == who].min() for who in (1, 2)]
    assert days[1] - days[0] == pytest.approx(86_400, abs=1)


@pytest.mark.parametrize(
    ("day", "clock"),
    [("Tue {} March", "14:02:{:06.3f}"), ("2024-03-{:02}", "{:.3f}"), ("{}. Mai", "0:02:{:06.3f}")],
)
def test_dates_that_are_not_used_are_warned_about(tmp_path, plain, caplog, day, clock):
    for days, warned in ((0, False), (1, True)):
        caplog.clear()
        rows = [(day.format(12 + days * who), clock.format(t), who, *row) for t, who, *row in WALK]
        with caplog.at_level(logging.WARNING):
            tracks(write(tmp_path, ["date,time,id,x,y"], rows))
        assert ("are not used: all is read as of one day" in caplog.text) == warned


@pytest.mark.parametrize(("clock", "used"), [("14:02:{:06.3f}", True), ("{:.3f}", False)])
def test_a_column_of_dates_is_called_unused_only_where_it_is(tmp_path, caplog, clock, used):
    rows = [("2024-03-05", clock.format(t), *row) for t, *row in WALK]
    with caplog.at_level(logging.INFO):
        tracks(write(tmp_path, ["date,time,id,x,y"], rows))
    assert ("date = date" in caplog.text, "not used: date" in caplog.text) == (used, not used)


@given(st.integers(0, 86_390))
def test_times_of_day_are_seconds_until_midnight(folder, plain, start_s):
    def written(t):
        whole, part = divmod(round(1000 * (start_s + t)), 1000)
        return f"{whole // 3600 % 24:02}:{whole // 60 % 60:02}:{whole % 60:02}.{part:03}"

    path = write(folder, ["time,id,x,y"], [(written(t), *row) for t, *row in WALK])
    assert_same(tracks(path), type(plain)(plain.time_s + start_s, plain.track_id, plain.position))
    late = write(folder, ["time,id,x,y"], [(written(t + 86_398 - start_s), *row) for t, *row in WALK])
    with pytest.raises(SourceError, match=r"line 18: time goes back from the evening to 00:00"):
        tracks(late)


CLOCKS = [("frame", 4), ("time_ms", 1000), ("time_us", 10**6), ("time", 1)]
COUNTERS = [(0, 2**16), (-(2**15), 2**15), (0, 2**32), (-(2**31), 2**31)]
"""The first value of counters, and the one after the last."""


@given(st.sampled_from(CLOCKS), st.data())
def test_clocks_that_begin_again_go_on(folder, plain, clock, data):
    """Whatever range a clock has, wherever it ends, and whether times or people order the rows."""
    title, per_second = clock
    ranges = [(0, 86_400)] if title == "time" else [one for one in COUNTERS if one[1] > 8 * per_second]
    least, end = data.draw(st.sampled_from(ranges))
    turn = data.draw(st.integers(1, COUNT - 1)) * STEP_S * per_second
    late = data.draw(st.floats(0.0, 0.9)) if title == "time" else 0
    order = data.draw(st.sampled_from([lambda row: row[0], lambda row: row[1], lambda row: -row[1]]))
    rows = [
        (f"{(t * per_second - turn + late) % (end - least) + least:.12g}", *row)
        for t, *row in sorted(WALK, key=order)
    ]
    path = write(folder, [f"{title},id,x,y"], rows)
    found = tracks(path, rate_hz=4.0 if title == "frame" else None)
    np.testing.assert_allclose(found.time_s - found.time_s[0], plain.time_s, atol=1e-6)
    np.testing.assert_array_equal(found.track_id, plain.track_id)
    np.testing.assert_array_equal(found.position, plain.position)


def test_clocks_begin_again_as_often_as_they_do(folder, caplog):
    """Of people who are seen one after the other, for longer than the range; else nobody knows."""
    lasts, between = 50, 20_000
    rows = [
        (who * between + k, who, round(0.02 * k, 3), 0.1 * who)
        for who in range(8)
        for k in range(lasts if who != 3 else 6000)
    ]
    wrapped = [(frame % 2**16, *row) for frame, *row in rows]
    found = tracks(write(folder, ["frame,id,x,y"], wrapped), rate_hz=50.0)
    assert_same(found, tracks(write(folder, ["frame,id,x,y"], rows, "whole.csv"), rate_hz=50.0))
    assert_same(found, tracks(write(folder, [], wrapped, "untitled.csv"), rate_hz=50.0))
    assert "frame numbers begin again after 65535 in line" in caplog.text
    apart = sorted(wrapped, key=lambda row: (row[1] % 2, row[1]))
    with pytest.raises(SourceError, match=r"frame numbers begin again.*Sort rows by time"):
        tracks(write(folder, ["frame,id,x,y"], apart), rate_hz=50.0)


LAST_IS_THE_YEAR = ["%d.%m.%Y", "%d.%m.%y", "%d/%m/%Y", "%m/%d/%Y", "%m/%d/%y", "%d-%m-%Y"]
DAYS = st.datetimes(datetime(2001, 1, 1), datetime(2068, 1, 1))


@settings(deadline=None)
@given(DAYS, st.sampled_from(LAST_IS_THE_YEAR), st.booleans(), st.sampled_from([";", "\t"]), st.booleans())
def test_dates_that_end_with_the_year_have_the_right_steps(folder, plain, start, form, split, sign, comma):
    """And the right day, unless day and month may be exchanged: then all rows have that date."""
    start = start.replace(microsecond=0, hour=start.hour % 23)

    def written(t):
        moment = start + timedelta(seconds=t)
        clock = f"{moment:%H:%M:%S}.{moment.microsecond // 1000:03}"
        return f"{moment.strftime(form)}{sign if split else ' '}{clock}"

    def number(value):
        return str(value).replace(".", ",") if comma else str(value)

    rows = [sign.join([written(t), *map(number, row)]) for t, *row in WALK]
    path = folder / "dates.csv"
    path.write_text(
        "\n".join([sign.join([*(["Datum"] if split else []), "Zeit", "id", "x", "y"]), *rows, ""])
    )
    found = tracks(path)
    np.testing.assert_allclose(found.time_s - found.time_s[0], plain.time_s, atol=1e-6)
    np.testing.assert_array_equal(found.position, plain.position)
    if "." in form or (start.day > 12 and form.endswith("Y")):
        assert found.time_s[0] == start.replace(tzinfo=UTC).timestamp()


def test_some_row_says_whether_the_day_comes_first(tmp_path):
    days = [datetime(2026, 12, day, tzinfo=UTC) for day in (11, 12, 13)]
    for form in ("%d/%m/%Y", "%m/%d/%Y"):
        rows = [
            (f"{day.strftime(form)} 10:00:{t:06.3f}", k, x, y)
            for k, day in enumerate(days)
            for t, _, x, y in WALK[::2]
        ]
        found = tracks(write(tmp_path, ["time,id,x,y"], rows))
        starts = [found.time_s[found.track_id == k].min() for k in range(3)]
        assert starts == [day.timestamp() + 36000 for day in days]
    rows = [row for row in rows if row[1] < 2]
    with pytest.raises(
        SourceError, match=r"line 14: time: in 12/11/2026 and 12/12/2026, day or month may come"
    ):
        tracks(write(tmp_path, ["time,id,x,y"], rows))


def test_halves_of_the_day_count(tmp_path):
    rows = [
        (f"12/24/2026 {clock}", 1, x, 0.0)
        for clock, x in (
            ("11:59:59 AM", 0.0),
            ("12:00:00 PM", 1.0),
            ("12:00:01 pm", 2.0),
            ("12:00:02 PM", 3.0),
        )
    ]
    found = tracks(write(tmp_path, ["time,id,x,y"], rows))
    assert found.time_s.tolist() == [
        datetime(2026, 12, 24, 12, tzinfo=UTC).timestamp() + k for k in (-1, 0, 1, 2)
    ]


@pytest.mark.parametrize("stamp", ["31.11.2024 14:02:07", "31/11/2024 14:02:07", "13/13/2024 14:02:07"])
def test_days_of_no_calendar_are_refused(stamp, tmp_path):
    with pytest.raises(SourceError, match=r"line 2: time.*Write (dates|times) as .*2024-03-05"):
        tracks(write(tmp_path, ["time,id,x,y"], [(stamp, *row[1:]) for row in WALK]))


@pytest.mark.parametrize("stamp", ["5.3.024 14:02:07", "13:02:07 PM", "14:02", "2:07 PM", "25:00:00"])
def test_times_that_could_mean_several_things_are_refused_with_what_to_write(stamp, tmp_path):
    with pytest.raises(
        SourceError, match=r"line 2: time = .*Write times as seconds, or as 2024-03-05 14:02:07.5"
    ):
        tracks(write(tmp_path, ["time,id,x,y"], [(stamp, *row[1:]) for row in WALK]))


@pytest.mark.parametrize(
    ("day", "start_s", "form"),
    [
        ("2024-03-05T", 7200, "%H:%M:%S.%f"),
        ("5.3.2024 ", 7200, "%H:%M:%S.%f"),
        ("", 0, "%M:%S.%f"),
        ("2024-03-05 ", 0, "%M:%S.%f"),
    ],
)
def test_parts_that_are_zero_may_be_left_out(day, start_s, form, tmp_path):
    """As Java writes times: 02:00 beside 02:00:01 and 02:00:01.500; and players: 59:58 beside 59:58.500."""
    times_s = [start_s + 59.5 + 0.5 * k for k in range(6)]
    rows = []
    for k, time_s in enumerate(times_s):
        text = datetime.fromtimestamp(time_s, UTC).strftime(form).removesuffix("000")
        text = text.removesuffix(".000")
        text = text.removesuffix(":00") if start_s else text
        rows.append((f"{day}{text}", 1, 0.5 * k, 0.0))
    assert {len(row[0]) for row in rows} != {len(rows[0][0])}
    found = tracks(write(tmp_path, ["time,id,x,y"], rows)).time_s
    midnight_s = datetime(2024, 3, 5, tzinfo=UTC).timestamp() if day else 0.0
    np.testing.assert_allclose(found, midnight_s + np.array(times_s), rtol=0, atol=1e-6)


@pytest.mark.parametrize(("day", "rate_hz"), [("", None), ("2024-03-05T", 4.0)])
def test_times_without_a_header_are_told_how_to_name_columns(tmp_path, day, rate_hz):
    path = write(tmp_path, [], [(f"{day}14:02:{t:06.3f}", *row) for t, *row in WALK])
    with pytest.raises(SourceError, match=rf"'{day}14:02:00.000' is a time.*--columns time,id,x,y"):
        tracks(path, rate_hz=rate_hz)
    assert len(tracks(path, columns=("time", "id", "x", "y"))) == len(WALK)


PAIRS = [
    ("sec,nanosec", 9),
    ("header.stamp.sec,header.stamp.nanosec", 9),
    ("secs,nsecs", 9),
    ("tv_sec,tv_usec", 6),
]


@pytest.mark.parametrize(("titles", "digits"), [*PAIRS, ("timestamp,time_ms", 3)])
@pytest.mark.parametrize("start_s", [0, 1_700_000_000])
def test_two_parts_of_a_stamp_are_one_time(titles, digits, start_s, tmp_path, plain):
    rows = [(start_s + int(t), round(t % 1 * 10**digits), *row) for t, *row in WALK]
    found = tracks(write(tmp_path, [f"{titles},id,x,y"], rows))
    np.testing.assert_allclose(found.time_s, plain.time_s + start_s, atol=1e-6)


@pytest.mark.parametrize(("title", "digits"), [("time", 0), ("time_ms", 3), ("time", 3), ("timestamp_us", 6)])
def test_dates_in_one_number_are_named(tmp_path, title, digits):
    """They are no milliseconds, in which minutes would have 100 s."""
    start = datetime(2024, 3, 5, 14, 2, 58, tzinfo=UTC)

    def written(t):
        stamp = f"{start + timedelta(seconds=t):%Y%m%d%H%M%S%f}"
        return stamp[: 14 + digits] if digits else f"{stamp[:14]}.{stamp[14:]}"

    path = write(tmp_path, [f"{title},id,x,y"], [(written(t), *row) for t, *row in WALK])
    with pytest.raises(SourceError, match=r"a date and a time of day in one number.*2024-03-05 14:02:07\.5"):
        tracks(path)


@pytest.mark.parametrize(
    ("titles", "start_s"),
    [
        ("hour,minute,second", 3599),
        ("Hours,Minutes,Seconds", 86398),
        ("min,sec", 59),
        ("minute,sec,nanosec", 1798),
    ],
)
def test_hours_minutes_and_seconds_in_columns_are_one_time(titles, start_s, tmp_path, plain, caplog):
    """Also at midnight."""

    def parts(t):
        minutes, seconds = divmod(start_s + t, 60)
        hours = [int(minutes) // 60 % 24] if "our" in titles else []
        whole = [int(seconds), round(seconds % 1 * 1e9)] if "nano" in titles else [f"{seconds:06.3f}"]
        return *hours, f"{int(minutes) % 60:02}", *whole

    found = tracks(write(tmp_path, [f"{titles},id,x,y"], [(*parts(t), *row) for t, *row in WALK]))
    np.testing.assert_allclose(found.time_s, start_s + plain.time_s, atol=1e-6)
    np.testing.assert_array_equal(found.position, plain.position)
    assert "recording" not in caplog.text


def test_seconds_that_go_on_beyond_a_minute_are_the_time(tmp_path, plain):
    rows = [(int(59.5 + t) // 60, 59.5 + t, *row) for t, *row in WALK]
    found = tracks(write(tmp_path, ["minute,second,id,x,y"], rows))
    np.testing.assert_allclose(found.time_s, 59.5 + plain.time_s)


@given(st.integers(0, 1438), st.sampled_from([0, 30, 57, 59]))
def test_hours_minutes_and_seconds_in_one_number_are_refused(folder, plain, minute, second):
    """Where a minute ends; before it, differences are right."""
    start_s = 60 * minute + second

    def written(t):
        minutes, seconds = divmod(start_s + t, 60)
        return f"{int(minutes) // 60:02}{int(minutes) % 60:02}{seconds:06.3f}"

    path = write(folder, ["time,id,x,y"], [(written(t), *row) for t, *row in WALK])
    if (start_s + WALK[-1][0]) // 60 != minute:
        with pytest.raises(SourceError, match=r"times leap from \d*5\d.*in one number.*14:02:07.5"):
            tracks(path)
    else:
        np.testing.assert_allclose(np.diff(tracks(path).time_s), np.diff(plain.time_s))
    seconds = write(folder, ["time,id,x,y"], [(start_s + t, *row) for t, *row in WALK])
    np.testing.assert_allclose(tracks(seconds).time_s, start_s + plain.time_s)


def test_messages_that_rostopic_writes_are_people(tmp_path, plain):
    start_ns = 1_700_000_000_250_000_000
    stamps = [start_ns + round(t * 1e9) for t, *_ in WALK]
    rows = [
        (ns, k, ns - 40, "map", who, x, y, 0.0)
        for k, (ns, (_, who, x, y)) in enumerate(zip(stamps, WALK, strict=True))
    ]
    fields = ["header.seq", "header.stamp", "header.frame_id", "id", *(f"pose.position.{a}" for a in "xyz")]
    path = write(tmp_path, [",".join(["%time", *(f"field.{field}" for field in fields)])], rows)
    found = tracks(path)
    np.testing.assert_allclose(found.time_s, plain.time_s + start_ns / 1e9, atol=1e-6)
    np.testing.assert_array_equal(found.track_id, plain.track_id)
    np.testing.assert_array_equal(found.position, plain.position)


@pytest.mark.parametrize("sign", ["%", "#", ""])
def test_messages_about_several_people_are_named(tmp_path, sign):
    people = [f"field.people{k}.{field}" for k in range(2) for field in ("name", "position.x", "position.y")]
    rows = [(round(t * 1e9), "map", 1, x, y, 2, x, y) for t, _, x, y in WALK]
    path = write(tmp_path, [",".join([f"{sign}time", "field.header.frame_id", *people])], rows)
    with pytest.raises(SourceError, match=r"people0.position.x.*of several people.*a line per person"):
        tracks(path)


def test_the_same_times_in_two_units_are_not_added(tmp_path, plain):
    rows = [(t, round(1000 * t), *row) for t, *row in WALK]
    assert_same(tracks(write(tmp_path, ["time,time_ms,id,x,y"], rows)), plain)
    seconds = [row for row in WALK if row[0] == int(row[0])]
    whole = [(int(t), round(1000 * t), *row) for t, *row in seconds]
    assert_same(
        tracks(write(tmp_path, ["time,time_ms,id,x,y"], whole)),
        tracks(write(tmp_path, ["time,id,x,y"], seconds)),
    )


@given(st.sampled_from([0, 1_700_000_000]), st.sampled_from([3, 6, 9]), st.booleans(), st.data())
def test_fractions_without_their_first_zeros_are_refused(folder, start_s, digits, titled, data):
    """With them, times are right, however many digits each has, and whatever the order of rows."""
    walk = [(round(t / STEP_S) * 0.05 + 0.01, *row) for t, *row in WALK * 5]
    walk = [(round(0.6 * (k // len(WALK)) + t, 3), *row) for k, (t, *row) in enumerate(walk)]
    times = [divmod(round(t * 10**digits), 10**digits) for t, *_ in walk]
    header = ["time,id,x,y"] if titled else []

    def written(form):
        stamps = [form.format(start_s + second, part, width=digits) for second, part in times]
        rows = [(stamp, *row[1:]) for stamp, row in zip(stamps, walk, strict=True)]
        return rows, write(folder, header, rows)

    joined = "{}.{}"
    with pytest.raises(
        SourceError, match=r"goes back from \d+\.\d+ to .*zeros were left out.*Write all digits"
    ):
        tracks(written(joined)[1])
    rows, path = written("{}.{:0{width}}")
    assert len(tracks(path)) == len(walk)
    shuffled = [(stamp.rstrip("0"), *row) for stamp, *row in data.draw(st.permutations(rows))]
    np.testing.assert_array_equal(tracks(write(folder, header, shuffled)).time_s, tracks(path).time_s)


@pytest.mark.parametrize("of", [math.floor, round])
def test_whole_times_beside_their_seconds_are_taken(tmp_path, plain, of):
    start_s = 1_700_000_000
    rows = [(start_s + of(t), round(1000 * (start_s + t)), *row) for t, *row in WALK]
    found = tracks(write(tmp_path, ["time,timestamp_ms,id,x,y"], rows))
    np.testing.assert_allclose(found.time_s, plain.time_s + start_s, atol=1e-6)


@pytest.mark.parametrize("used", [True, False])
def test_the_rest_of_a_stamp_is_called_used_only_where_it_is(tmp_path, used, caplog):
    rows = [(int(t) if used else t, round(1e9 * (t % 1)), *row) for t, *row in WALK]
    with caplog.at_level(logging.INFO):
        tracks(write(tmp_path, ["sec,nanosec,id,x,y"], rows))
    assert ("rest_of_time = nanosec" in caplog.text, "not used: nanosec" in caplog.text) == (used, not used)


@pytest.mark.parametrize(
    ("comments", "rate_hz", "remedy"),
    [
        (["# framerate: 16"], 25.0, "Correct the comment, or leave --rate out"),
        (["# framerate: 16", "# fps: 4"], None, "Correct the comment, or say which: --rate"),
        (["# framerate: 0"], None, "Correct the comment"),
    ],
)
def test_a_remedy_for_rates_that_differ_works(tmp_path, comments, rate_hz, remedy):
    rows = [(round(t / STEP_S), *row) for t, *row in WALK]
    path = write(tmp_path, [*comments, "frame,id,x,y"], rows)
    with pytest.raises(SourceError, match=rf"{remedy}$"):
        tracks(path, rate_hz=rate_hz)
    if rate_hz or len(comments) > 1:
        assert len(tracks(path, rate_hz=None if rate_hz else 4.0)) == len(WALK)


@pytest.mark.parametrize(
    "comments", [["# framerate: 30000/1001"], ["# fps: 29.97", "# framerate: 30000/1001"]]
)
def test_a_rate_with_fewer_digits_is_the_same(tmp_path, comments):
    rows = [(round(7 * t / STEP_S), *row) for t, *row in WALK]
    path = write(tmp_path, [*comments, "frame,id,x,y"], rows)
    assert_same(tracks(path, rate_hz=29.97), tracks(path))


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("quote", ["", '"'])
@pytest.mark.parametrize("sign", [" ", ";", "\t"])
def test_numbers_of_rows_may_have_no_title(first, quote, sign, tmp_path, plain):
    path = tmp_path / "walk.txt"
    rows = [sign.join([f"{quote}{first + n}{quote}", *map(str, row)]) for n, row in enumerate(WALK)]
    path.write_text(
        "\n".join([sign.join(f"{quote}{title}{quote}" for title in ("time", "id", "x", "y")), *rows])
    )
    assert_same(tracks(path), plain)
    path.write_text("\n".join([sign.join(["time", "id", "x", "y"]), *rows[:5], *rows[6:]]))
    with pytest.raises(SourceError, match="line 7: 5 columns, expected 4"):
        tracks(path)


ABOVE = st.lists(
    st.sampled_from(["Tracker 3.1 export", "Recorded 2024-03-01", "Room: B 12", "", "units;metres"])
)


@given(ABOVE, st.sampled_from([[], ["s,-,m,m"], ["[s],,[m],[m]"], ["(s),none,(m),(m)"]]))
def test_lines_around_a_header_change_nothing(folder, plain, above, units):
    assert_same(tracks(write(folder, [*above, "time,id,x,y", *units], WALK)), plain)


@given(ABOVE, st.booleans(), st.sampled_from([[], ["s,-,m,m"], ["[s],,[m],[m]"]]), st.booleans())
def test_columns_may_be_named_whatever_stands_above_them(folder, plain, above, titled, units, dated):
    """In place of titles that nobody knows, or of none."""
    rows = [(f"00:00:{row[0]:06.3f}" if dated else row[0], "Ab"[row[1] - 1], *row[2:]) for row in WALK]
    header = [*above, *(["when,who,sideways,along", *units] if titled else [])]
    path = write(folder, header, rows)
    found = tracks(path, columns=("time", "id", "x", "y"))
    np.testing.assert_array_equal(found.time_s, plain.time_s)
    np.testing.assert_array_equal(found.position, plain.position)


LEVELS = [
    [("walk", "time"), ("walk", "id"), ("position", "x"), ("position", "y")],
    [("time", ""), ("id", ""), ("position", "x [m]"), ("position", "y [m]")],
    [("track", "time", ""), ("", "track", "id"), ("position", "world", "x"), ("position", "world", "y")],
]


@pytest.mark.parametrize("levels", LEVELS)
@pytest.mark.parametrize("numbered", [True, False])
@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_a_header_may_have_several_rows_as_pandas_writes_levels(tmp_path, plain, levels, numbered, separator):
    table = pd.DataFrame(WALK, columns=pd.MultiIndex.from_tuples(levels))
    path = tmp_path / "walk.csv"
    table.to_csv(path, index=numbered, sep=separator)
    assert_same(tracks(path), plain)
    if len(levels[0]) == 2:
        again = pd.read_csv(path, header=[0, 1], sep=separator)
        again.to_csv(path, index=False, sep=separator)
        assert_same(tracks(path), plain)


def test_levels_of_rows_name_columns_too(tmp_path, plain):
    table = pd.DataFrame(WALK, columns=["time", "id", "x", "y"]).set_index(["time", "id"])
    path = tmp_path / "walk.csv"
    pd.concat({"position": table}, axis="columns").to_csv(path)
    assert_same(tracks(path), plain)
    table.reset_index().pivot(index="time", columns="id").to_csv(path)
    with pytest.raises(SourceError, match=r"x and y, which are there several times.*a line per person"):
        tracks(path)


def test_a_wrong_row_is_not_above_named_columns(tmp_path):
    path = write(tmp_path, ["Export", "when,who,sideways,along", "0.0,Ab,here,there"], WALK)
    with pytest.raises(SourceError, match="line 3: x = 'here'"):
        tracks(path, columns=("time", "id", "x", "y"))


def test_units_below_a_header_count_for_named_columns(tmp_path, plain):
    rows = [(round(1000 * t), who, round(100 * x, 1), round(100 * y, 1)) for t, who, x, y in WALK]
    for above in (["Export of 2024", "when,who,sideways,along"], ["Export of 2024"], ["# of 2024"], []):
        path = write(tmp_path, [*above, "ms,,cm,cm"], rows)
        found = tracks(path, columns=("time", "id", "x", "y"))
        np.testing.assert_allclose(found.position, plain.position, atol=1e-9)
        np.testing.assert_array_equal(found.time_s, plain.time_s)


def test_units_below_a_header_count(tmp_path, plain):
    rows = [(round(1000 * t), who, round(100 * x, 1), round(100 * y, 1)) for t, who, x, y in WALK]
    found = tracks(write(tmp_path, ["Export of 2024", "time,id,x,y", "ms,,cm,cm"], rows))
    np.testing.assert_allclose(found.position, plain.position, atol=1e-9)
    np.testing.assert_allclose(found.time_s, plain.time_s)
    other = write(
        tmp_path, ["time,id,x,y,heading,a", "ms,1,cm,cm,Degrees,m/s²"], [(*row, 90, 0.1) for row in rows]
    )
    assert_same(tracks(other), found)


def test_heights_called_y_are_noticed(tmp_path, plain):
    rows = [(t, who, x, 1.7, y) for t, who, x, y in WALK]
    path = write(tmp_path, ["time,id,x,y,z"], rows)
    with pytest.raises(
        SourceError, match=r"y is 1.7 in all lines, and z changes: .*--columns time,id,x,height,y"
    ):
        tracks(path)
    assert_same(tracks(path, columns=("time", "id", "x", "height", "y")), plain)
    corridor = [(t, who, x, 2.0, 1.7) for t, who, x, _ in WALK if who == 1]
    assert len(tracks(write(tmp_path, ["time,id,x,y,z"], corridor))) == COUNT


@pytest.mark.parametrize("text", ['{"time": [0, 1]}', '[\n {"time": 0}]', "[[0, 1, 2]]", "\ufeff{}"])
def test_json_is_named(text, tmp_path):
    (tmp_path / "walk.json").write_text(text)
    with pytest.raises(SourceError, match="this is JSON of a kind that is not read"):
        read_file(tmp_path / "walk.json")
