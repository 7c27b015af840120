"""Files that do not say what their columns and lengths are, read by how people move."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pedpred.errors import SourceError, ValueRuleError
from pedpred.scenes import Trajectories
from pedpred.sources.plausibility import check_speeds, ids_come_first
from pedpred.sources.single_file import read_file
from pedpred.tables.options import TableOptions
from pedpred.tables.units import UNITS

RATE_HZ = 25.0


def crowd(seed, people, steps, every=1, noise_m=0.01, apart_m=3.0):
    """Rows (id, frame, x, y) of people who walk their own ways, in order of frames."""
    rng = np.random.default_rng(seed)
    heading, speed = rng.uniform(-np.pi, np.pi, people), rng.uniform(0.6, 1.6, people)
    velocity = speed[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    start = rng.uniform(-apart_m, apart_m, (people, 2)) * np.sqrt(people)
    born = rng.integers(0, steps // 2 + 1, people)
    rows = []
    for k in range(steps):
        for one in np.flatnonzero((born <= k) & (k < born + max(steps // 2, 3))):
            at = start[one] + velocity[one] * (k - born[one]) * every / RATE_HZ
            rows.append([one + 1, k * every, *(at + rng.normal(0, noise_m, 2))])
    return np.array(rows)


def write(path, rows, order=(0, 1, 2, 3), head="", scale=1.0):
    scaled = rows * [1, 1, scale, scale]
    lines = [
        " ".join(f"{value:.6g}" if k > 1 else f"{value:.1f}" for k, value in enumerate(row))
        for row in scaled[:, order]
    ]
    path.write_text(head + "\n".join(lines) + "\n")
    return path


def positions(scene):
    people = scene.trajectories
    return people.position[np.lexsort((people.time_s, people.track_id))]


@given(st.integers(0, 10_000), st.integers(3, 30), st.integers(8, 40), st.sampled_from([1, 5, 10]))
@settings(max_examples=40, deadline=None)
def test_the_order_of_id_and_frame_is_found_in_any_order_of_lines(seed, people, steps, every):
    rows = crowd(seed, people, steps, every)
    rows = np.random.default_rng(seed).permutation(rows)
    track, frame, position = rows[:, 0].astype(int), rows[:, 1].astype(int), rows[:, 2:]
    assert ids_come_first(track, frame, position) is True
    assert ids_come_first(frame, track, position) is False
    assert ids_come_first(track, frame, 100.0 * position) is True, "in any unit"


@pytest.mark.parametrize("people", [1, 2, 12])
def test_both_orders_of_a_file_are_the_same_scene(tmp_path, people):
    rows = crowd(3, people, 40, 10)
    options = TableOptions(rate_hz=RATE_HZ)
    first = read_file(write(tmp_path / "id_first.txt", rows), options)
    second = read_file(write(tmp_path / "frame_first.txt", rows, (1, 0, 2, 3)), options)
    np.testing.assert_array_equal(first.trajectories.track_id.max(), people)
    np.testing.assert_array_equal(positions(first), positions(second))
    assert first.detection_dt_s == second.detection_dt_s == pytest.approx(0.4)


def test_where_the_order_stays_open_it_is_asked_for(tmp_path):
    """Two people side by side, seen twice: it could also be the other way round."""
    path = tmp_path / "pair.txt"
    path.write_text("1 1 0 0 1.7\n1 2 0.5 0 1.7\n2 1 0 0.5 1.7\n2 2 0.5 0.5 1.7\n")
    with pytest.raises(SourceError, match="--columns id,frame,x,y,z, or --columns frame,id,x,y,z"):
        read_file(path, TableOptions(rate_hz=2.0))
    for columns in ("id,frame,x,y,z", "frame,id,x,y,z"):
        assert len(read_file(path, TableOptions(tuple(columns.split(",")), 2.0)).trajectories) == 4


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize(
    "words", ["# x/{} y/{}", "# id frame x [{}] y [{}]", "# all lengths in {}", "# x_{} y_{}"]
)
def test_a_comment_says_the_unit_of_a_text(tmp_path, unit, words):
    rows = crowd(1, 5, 30)
    head = f"# framerate: {RATE_HZ}\n{words.format(unit, unit)}\n"
    scene = read_file(write(tmp_path / "hall.txt", rows, head=head, scale=1 / UNITS[unit]))
    metres = read_file(write(tmp_path / "metres.txt", rows), TableOptions(rate_hz=RATE_HZ))
    np.testing.assert_allclose(positions(scene), positions(metres), rtol=1e-4, atol=1e-3)
    other = next(name for name in UNITS if name != unit)
    with pytest.raises(SourceError, match="lengths are said to be"):
        read_file(tmp_path / "hall.txt", TableOptions(unit=other))


@pytest.mark.parametrize(("unit", "other"), [("cm", "m"), ("mm", "m"), ("mm", "cm")])
def test_lengths_in_another_unit_are_doubted_and_read_when_it_is_said(tmp_path, unit, other):
    rows = crowd(2, 6, 60)
    path = write(tmp_path / "hall.txt", rows, scale=UNITS[other] / UNITS[unit])
    if other == "m":
        with pytest.raises(SourceError, match=f"--unit {unit} if lengths are {unit}"):
            read_file(path, TableOptions(rate_hz=RATE_HZ))
    scene = read_file(path, TableOptions(rate_hz=RATE_HZ, unit=unit))
    wanted = UNITS[other] * rows[np.lexsort((rows[:, 1], rows[:, 0]))][:, 2:]
    np.testing.assert_allclose(positions(scene), wanted, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize(("said", "meant"), [("m", "cm"), ("cm", "mm"), ("m", "mm")])
@pytest.mark.parametrize(
    "head", ["frame,id,x_{0},y_{0}", "frame,id,x,y\n,,{0},{0}", "# in {0}\nframe,id,x,y", ""]
)
def test_titles_with_a_wrong_unit_are_to_be_corrected(tmp_path, said, meant, head):
    """An option for another unit would be refused, since two are said; that for the same one insists."""
    rows = [(int(frame), int(who), x, y) for who, frame, x, y in crowd(2, 6, 60)]
    path, head = tmp_path / "hall.csv", head.format(said) or f"# x/{said} y/{said}"
    text = [",".join(map(str, (*row[:2], *(value / UNITS[meant] for value in row[2:])))) for row in rows]
    path.write_text("\n".join([head, *text]))
    remedy = rf"lengths are {said}: correct them if lengths are {meant}, say --unit {said} if they are right"
    with pytest.raises(SourceError, match=remedy):
        read_file(path, TableOptions(rate_hz=RATE_HZ))
    assert len(read_file(path, TableOptions(rate_hz=RATE_HZ, unit=said)).trajectories) == len(rows)


def test_a_unit_that_is_said_is_believed(tmp_path, caplog):
    rows = crowd(2, 6, 60)
    path = write(tmp_path / "cars.txt", rows, scale=12.0)
    assert len(read_file(path, TableOptions(rate_hz=RATE_HZ, unit="m")).trajectories) == len(rows)
    assert "faster than people walk" in caplog.text
    with pytest.raises(ValueRuleError, match="unit = 'km'"):
        TableOptions(unit="km")


@pytest.mark.parametrize("noise_m", [0.0, 0.02, 0.05])
@pytest.mark.parametrize("rate_hz", [2.0, 10.0, 50.0, 200.0])
def test_noise_at_any_rate_is_no_speed(tmp_path, noise_m, rate_hz):
    rng, time_s = np.random.default_rng(0), np.arange(0, 8, 1 / rate_hz)
    walk = np.stack([1.3 * time_s, 0 * time_s], axis=-1) + rng.normal(0, noise_m, (len(time_s), 2))
    check_speeds(tmp_path, Trajectories(time_s, np.ones(len(time_s), int), walk))


def test_people_who_stand_are_people_and_nobody_is_none(tmp_path, caplog):
    time_s = np.arange(40) / 4
    check_speeds(tmp_path, Trajectories(time_s, np.ones(40, int), np.zeros((40, 2))))
    assert "nobody moves faster" in caplog.text
    check_speeds(tmp_path, Trajectories(np.zeros(0), np.zeros(0, int), np.zeros((0, 2))))


def test_ids_that_are_words_are_numbered_in_the_order_of_appearance(tmp_path, caplog):
    caplog.set_level("INFO")
    path = tmp_path / "helmets.csv"
    path.write_text("time,id,x,y\n0,Helmet_2,0,0\n0,12,5,5\n0.5,Helmet_2,0.5,0\n0.5,12,5,5.5\n")
    people = read_file(path).trajectories
    np.testing.assert_array_equal(np.sort(people.track_id), [0, 0, 1, 1])
    assert "Helmet_2 is 0, 12 is 1" in caplog.text


def test_rows_about_something_else_are_passed_over(tmp_path):
    """SUMO writes people and vehicles into one table."""
    path = tmp_path / "fcd.csv"
    path.write_text("time;id;x;y;vehicle\n0;ped0;0;0;\n0;;;;car\n1;ped0;1;0;\n1;;;;car\n")
    assert len(read_file(path).trajectories) == 2
    path.write_text("time;id;x;y;vehicle\n0;ped0;0;0;\n0;;3;;car\n1;ped0;1;0;\n")
    with pytest.raises(SourceError, match="line 3"):
        read_file(path)


@given(
    wide=st.integers(3, 12),
    deep=st.integers(2, 8),
    apart_m=st.sampled_from([0.5, 1.0, 2.0]),
    seen=st.integers(2, 6),
    dt_s=st.sampled_from([0.1, 0.4, 1.0]),
    speed_mps=st.sampled_from([0.0, 0.3, 1.2]),
    clock=st.sampled_from(["time", "frame"]),
)
@settings(max_examples=60, deadline=None)
def test_people_in_ranks_and_files_are_who_their_titles_say(
    tmp_path_factory, wide, deep, apart_m, seen, dt_s, speed_mps, clock
):
    """Neighbours on a lattice stand nearer than a step, and whole numbers count its rows."""
    rows = [
        f"{k if clock == 'frame' else k * dt_s:g},{one},"
        f"{one % wide * apart_m + speed_mps * dt_s * k:g},{one // wide * apart_m:g}"
        for k in range(seen)
        for one in range(wide * deep)
    ]
    path = tmp_path_factory.mktemp("parade") / "parade.csv"
    path.write_text("\n".join([f"{clock},id,x,y", *rows]) + "\n")
    people = read_file(path, TableOptions(rate_hz=1 / dt_s)).trajectories
    assert len(np.unique(people.track_id)) == wide * deep
    assert len(np.unique(people.time_s)) == seen


@given(
    seed=st.integers(0, 10_000),
    people=st.integers(3, 12),
    time_first=st.booleans(),
    separator=st.sampled_from([" ", "\t", ",", ";", " | "]),
    comma=st.booleans(),
    suffix=st.sampled_from([".txt", ".csv", ".dat"]),
    rate_hz=st.sampled_from([2.5, 10.0, 29.97]),
)
@settings(max_examples=40, deadline=None)
def test_numbers_with_fractions_are_the_times_of_a_text_without_titles(
    tmp_path_factory, seed, people, time_first, separator, comma, suffix, rate_hz
):
    rows = crowd(seed, people, 20)
    written = []
    for who, frame, *place in rows:
        fields = [f"{who:.0f}", f"{frame / rate_hz:.4f}", *(f"{value:.4f}" for value in place)]
        fields[:2] = fields[1::-1] if time_first else fields[:2]
        text = separator.join(fields)
        written.append(text.replace(".", ",") if comma and separator != "," else text)
    path = tmp_path_factory.mktemp("untitled") / f"walk{suffix}"
    path.write_text("\n".join(written) + "\n")
    scene = read_file(path, TableOptions(unit="m"))
    order = np.lexsort((rows[:, 1], rows[:, 0]))
    np.testing.assert_allclose(positions(scene), rows[order][:, 2:], atol=1e-4)
    np.testing.assert_allclose(
        np.unique(scene.trajectories.time_s), np.unique(rows[:, 1]) / rate_hz, atol=1e-4
    )


def test_a_fourth_column_that_never_changes_is_asked_for(tmp_path):
    """Annotations of BIWI hold frame, id, x, z, y and velocities; a height after x and y may be constant."""
    rows = crowd(3, 6, 40)
    lines = [f"{frame:.7e} {who:.7e} {x:.7e} 0.0 {y:.7e} 0.0 0.0 0.0" for who, frame, x, y in rows]
    path = tmp_path / "obsmat.txt"
    path.write_text("\n".join(lines))
    with pytest.raises(SourceError, match=r"column 4 should be y, but it is 0.0 in all lines.*--columns"):
        read_file(path, TableOptions(rate_hz=RATE_HZ))
    named = TableOptions(("frame", "id", "x", "z", "y", "a", "b", "c"), RATE_HZ)
    order = np.lexsort((rows[:, 1], rows[:, 0]))
    np.testing.assert_allclose(positions(read_file(path, named)), rows[order][:, 2:], atol=1e-5)
    path.write_text("\n".join(f"{frame:.0f} {who:.0f} {x} 2.0 1.7" for who, frame, x, _ in rows))
    assert len(read_file(path, TableOptions(rate_hz=RATE_HZ)).trajectories) == len(rows), "a narrow corridor"


@pytest.mark.parametrize(
    ("titles", "unit"), [("feet_x,feet_y", "ft"), ("CM.x,CM.y", "cm"), ("x_mm,y_mm", "mm")]
)
def test_metres_that_a_title_seems_to_call_otherwise_are_doubted(tmp_path, caplog, titles, unit):
    """Such as those of feet, or of centres of mass."""
    rows = crowd(2, 6, 60)
    path = tmp_path / "hall.csv"
    text = [f"{frame / RATE_HZ:.3f},{who:.0f},{x},{y}" for who, frame, x, y in rows]
    path.write_text("\n".join([f"time,id,{titles}", *text]))
    read_file(path)
    assert re.search(rf"if lengths are {unit}, as titles.* in metres, that is [12]\.?\d* m/s", caplog.text)
    caplog.clear()
    path.write_text("\n".join(["time,id,x_m,y_m", *text]))
    read_file(path)
    assert "in metres" not in caplog.text


@pytest.mark.parametrize("counted", ["from the first of all", "from the first of each"])
def test_times_that_are_counted_for_each_person_are_doubted(tmp_path, caplog, counted):
    """People enter by one door, one after the other."""
    walk = [(k / 10, who, 0.12 * k, 0.02 * who) for who in range(5) for k in range(60)]
    after_s = 3.0 if counted == "from the first of all" else 0.0
    path = tmp_path / "hall.csv"
    rows = [f"{t + after_s * who:.2f},{who},{x},{y}" for t, who, x, y in walk]
    path.write_text("\n".join(["time,id,x,y", *rows]))
    read_file(path)
    doubted = "all 5 tracks begin at 0 s, and people are" in caplog.text
    assert doubted is (after_s == 0.0)


@pytest.mark.parametrize(
    ("lost", "named"),
    [
        (lambda x, y: (x, np.float32(y + 5_412_345)), "all y are multiples of 0.5 m"),
        (lambda x, y: (np.round(4 * x) / 4, y), "all x are multiples of 0.25 m"),
        (lambda x, y: (x, 2.0), "multiples"),
        (lambda x, y: (round(x, 2), round(y, 1)), "multiples"),
    ],
)
def test_positions_that_have_lost_their_digits_are_doubted(tmp_path, caplog, lost, named):
    rows = crowd(2, 8, 100, noise_m=0.0)
    path = tmp_path / "hall.csv"
    lines = []
    for who, frame, x, y in rows:
        places = ",".join(f"{float(value):.4f}" for value in lost(x, y))
        lines.append(f"{frame / RATE_HZ:.3f},{who:.0f},{places}")
    path.write_text("\n".join(["time,id,x,y", *lines]))
    read_file(path)
    assert (named in caplog.text) is named.startswith("all")
    caplog.clear()
    read_file(path, TableOptions(unit="m"))
    assert "multiples" not in caplog.text


def test_positions_relative_to_the_first_of_each_person_are_doubted(tmp_path, caplog):
    rows = crowd(2, 6, 60)
    first = {who: np.array([x, y]) for who, _, x, y in rows[::-1]}
    path = tmp_path / "hall.csv"
    for start, doubted in ((first, True), (dict.fromkeys(first, np.zeros(2)), False)):
        text = [
            f"{frame / RATE_HZ},{who},{x - start[who][0]},{y - start[who][1]}" for who, frame, x, y in rows
        ]
        path.write_text("\n".join(["time,id,x,y", *text]))
        caplog.clear()
        read_file(path)
        assert ("all 6 tracks begin at (0, 0)" in caplog.text) is doubted


def test_people_who_all_creep_are_doubted(tmp_path, caplog):
    """As with times in tenths of seconds, or a rate that is too low."""
    rows = crowd(2, 6, 60, 10)
    path = write(tmp_path / "hall.txt", rows)
    read_file(path, TableOptions(rate_hz=RATE_HZ))
    assert "nobody moves" not in caplog.text
    read_file(path, TableOptions(rate_hz=RATE_HZ / 9))
    assert "nobody moves faster than 0.1" in caplog.text


def test_ids_that_jump_are_told_from_other_units(tmp_path):
    """Where ids are places in a list, people walk half of the time."""
    walk = [(k / 10, who, 5.0 * who + 0.13 * k, 3.0 * who) for k in range(60) for who in range(8)]
    path = tmp_path / "hall.csv"
    lists = [(t, (who + (k // 8) // 9) % 8, x, y) for k, (t, who, x, y) in enumerate(walk)]
    path.write_text("\n".join(["time,id,x,y", *(",".join(map(str, row)) for row in lists)]))
    with pytest.raises(
        SourceError, match=r"at 1.3 m/s half of the time, as where ids jump.*correct these, ids"
    ):
        read_file(path)


def test_jumps_and_running_are_warned_about(tmp_path, caplog):
    time_s = np.arange(0, 60, 0.1)
    walk = np.stack([400.0 + 1.3 * time_s, 300.0 + 0 * time_s], axis=-1)
    check_speeds(tmp_path, Trajectories(time_s, np.ones(600, int), walk))
    assert not caplog.text
    check_speeds(tmp_path, Trajectories(time_s, np.ones(600, int), walk / 0.3048))
    assert "4.27 m/s half of the time, which is running: say --unit ft if lengths are ft" in caplog.text
    caplog.clear()
    check_speeds(tmp_path, Trajectories(time_s, np.ones(600, int), walk / 0.3048), sure=True)
    assert "which is running" in caplog.text
    assert "--unit" not in caplog.text
    check_speeds(tmp_path, Trajectories(time_s, np.ones(600, int), walk / 0.3048), sure=True, fixed="m")
    assert "are lengths ft in place of metres?" in caplog.text
    caplog.clear()
    for away_m in (1.5, 12.0):  # a step of one of two people in each second
        jumps = walk + away_m * (np.arange(600) % 20 < 2)[:, None]
        check_speeds(tmp_path, Trajectories(time_s, np.ones(600, int), jumps), sure=True, fixed="m")
        assert "most of them walk: are ids exchanged, does the frame" in caplog.text
        assert "in place of metres" not in caplog.text
        caplog.clear()
    walk[300] = 0.0
    check_speeds(tmp_path, Trajectories(time_s, np.ones(600, int), walk))
    assert "people jump" in caplog.text


@pytest.mark.parametrize("every", [1, 10])
def test_positions_that_are_repeated_under_new_times_are_told(tmp_path, caplog, every):
    """And are no running; who stops and goes, to the last bit, is nobody whose positions are repeated."""
    time_s = np.arange(600) / 10
    walk = np.stack([1.3 * time_s, 0 * time_s], axis=-1)[np.arange(600) // every * every]
    check_speeds(tmp_path, Trajectories(time_s, np.ones(600, int), walk), sure=True, fixed="m")
    assert ("old positions are repeated under new times" in caplog.text) == (every > 1)
    assert "running" not in caplog.text
    caplog.clear()
    stops = np.repeat(1.3 * time_s[:300].reshape(-1, 20), 2, axis=0)
    stops[1::2] = stops[::2, -1:]
    walk = np.stack([stops.ravel(), 0 * time_s], axis=-1)
    check_speeds(tmp_path, Trajectories(time_s, np.ones(600, int), walk), sure=True, fixed="m")
    assert not caplog.text


@pytest.mark.parametrize("clock", ["time", "frame"])
@pytest.mark.parametrize("order", [(0, 1, 2, 3), (1, 0, 2, 3)])
def test_words_are_the_ids_of_a_text_without_titles(tmp_path, clock, order):
    rows = crowd(3, 6, 30)
    written = [
        [f"ped{who:.0f}", f"{frame / RATE_HZ if clock == 'time' else frame:g}", str(x), str(y)]
        for who, frame, x, y in rows
    ]
    path = tmp_path / "walk.txt"
    path.write_text("\n".join(" ".join(fields[k] for k in order) for fields in written))
    options = TableOptions(rate_hz=RATE_HZ)
    scene = read_file(path, options)
    assert set(options.names.of_number.values()) == {fields[0] for fields in written}
    assert scene.detection_dt_s == pytest.approx(1 / RATE_HZ)


@pytest.mark.parametrize(
    ("seconds", "named"), [(60.0, "minutes"), (3600.0, "hours"), (86400.0, "days, as of spreadsheets")]
)
def test_times_of_a_moment_are_doubted(seconds, named, tmp_path):
    rows = [(45_000 + 0.1 * k / seconds, 1, 0.13 * k, 1.0) for k in range(100)]
    path = tmp_path / "walk.csv"
    path.write_text("time,id,x,y\n" + "\n".join(f"{t:.12f},{who},{x},{y}" for t, who, x, y in rows))
    with pytest.raises(SourceError, match=f"m/s: times look like {named}. Times are seconds"):
        read_file(path)


def test_a_few_detections_within_a_moment_are_read(tmp_path):
    rng = np.random.default_rng(0)
    path = tmp_path / "walk.csv"
    rows = [f"{0.01 * k},1,{0.013 * k + rng.normal(0, 0.02)},1" for k in range(20)]
    path.write_text("\n".join(["time,id,x,y", *rows]))
    assert len(read_file(path).trajectories) == 20


def test_frame_numbers_called_times_are_doubted(tmp_path, caplog):
    path = tmp_path / "walk.csv"
    path.write_text("time,id,x,y\n" + "\n".join(f"{k},1,{0.05 * k},1" for k in range(90)))
    assert len(read_file(path).trajectories) == 90
    assert "are they frames? Then call the column frame, and give --rate" in caplog.text
    caplog.clear()
    path.write_text("time,id,x,y\n" + "\n".join(f"{k},1,{1.3 * k},1" for k in range(90)))
    read_file(path)
    assert not caplog.text


@pytest.mark.parametrize("titles", ["frame,id,x,y,w,h\n", ""])
@pytest.mark.parametrize(("least", "warned"), [(0.3, True), (0.9, False), (-0.1, False)])
def test_parts_of_a_picture_are_no_metres_without_a_word(tmp_path, caplog, titles, least, warned):
    rows = [
        f"{k},{who},{least + k * 0.002 * who:.4f},{0.3 * who},0.03,0.1" for k in range(40) for who in (1, 2)
    ]
    path = tmp_path / "boxes.csv"
    path.write_text(titles + "\n".join(rows))
    read_file(path, TableOptions(rate_hz=10.0))
    assert ("parts of a picture's width and height" in caplog.text) is warned
    caplog.clear()
    for said in (
        "# lengths in m\n",
        titles and f"{titles},,m,m,,\n",
        titles and titles.replace("x,y", "x_m,y_m"),
    ):
        if said:
            path.write_text((said if "," in said else said + titles) + "\n".join(rows))
            read_file(path, TableOptions(rate_hz=10.0))
    assert "parts of a picture" not in caplog.text, "where the unit is said"


@pytest.mark.parametrize("titles", ["frame,id,x,y,z\n", ""])
def test_people_who_are_always_at_one_place_have_none(tmp_path, titles):
    """As where a tracker writes -1 for places that it does not know; one person may stand."""
    path = tmp_path / "walk.csv"
    for people in ((1, 2), (1,)):
        rows = [f"{k},{who},-1,-1,-1" for k in range(40) for who in people]
        path.write_text(titles + "\n".join(rows))
        if len(people) > 1:
            with pytest.raises(
                SourceError, match=r"always at \(-1, -1\): x and y hold no positions.*--columns"
            ):
                read_file(path, TableOptions(rate_hz=10.0))
        elif titles:
            assert len(read_file(path, TableOptions(rate_hz=10.0)).trajectories) == 40
