"""Tables and texts that could be read in two ways: what is taken, refused or warned about."""

import logging
import math
import re

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pedpred
from pedpred.errors import SourceError
from pedpred.tables.classes import is_person
from pedpred.tables.titles import sides_of_boxes, titles_of_tracks
from tests.scenes import assert_same
from tests.test_table_traits import COUNT, FIXTURE, STEP_S, TITLES, WALK, tracks, write


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    return tracks(write(tmp_path_factory.mktemp("plain"), WALK))


# Places


@given(
    st.sampled_from(["ped", "human", "person", "pedestrian", "agent", "Fußgänger"]),
    st.sampled_from(["{}_x,{}_y", "{}_x_m,{}_y_m", "x_{},y_{}", "{} pos x,{} pos y"]),
    st.sampled_from(["x,y", "pos_x,pos_y", "x_m,y_m"]),
    st.permutations(range(6)),
)
@settings(deadline=None, suppress_health_check=FIXTURE)
def test_people_are_where_the_titles_with_a_word_for_them_say(tmp_path, plain, word, theirs, other, order):
    """Not where the robot is that has seen them."""
    titles = [*other.split(","), "time", f"{word}_id", *theirs.format(word, word).split(",")]
    rows = [[(0.6 * t, 2 + math.sin(t), t, who, x, y)[k] for k in order] for t, who, x, y in WALK]
    assert_same(tracks(write(tmp_path, rows, [titles[k] for k in order])), plain)


def test_words_for_things_do_not_say_that_a_place_is_that_of_people():
    wanted = titles_of_tracks(("time", "person_id", "x", "y", "object_x", "object_y"))
    assert set(wanted) == {"time", "person_id", "x", "y"}
    assert "ped_x" not in titles_of_tracks(("time", "id", "x", "y", "ped_x")), "without its y"


@pytest.mark.parametrize(
    ("titles", "named"),
    [
        ("time,id,x,y,x_world_m,y_world_m", "x and y .*, and x_world_m and y_world_m are not"),
        ("time,id,X,Y,easting,northing", "X and Y .*, and easting and northing are not"),
        ("time,id,x,y,object_x,object_y", "x and y .*, and object_x and object_y are not"),
        ("time,ped,x,y,ped_x,ped_y", "ped_x and ped_y .*, and x and y are not"),
        ("time,id,x,y,x_filtered,y_filtered", None),
        ("time,id,x_px,y_px,x,y", None),
        ("time,id,x,y,image_x,image_y", None),
    ],
)
def test_other_columns_that_may_hold_the_places_are_named(tmp_path, caplog, titles, named):
    rows = [(*row, 9 + row[2], 9 + row[3]) for row in WALK]
    with caplog.at_level(logging.WARNING):
        tracks(write(tmp_path, rows, titles.split(",")))
    if named:
        assert "--columns if these are meant" in caplog.text
        assert [record for record in caplog.records if re.search(named, record.getMessage())]
    else:
        assert not caplog.text


@pytest.mark.parametrize("header", [TITLES, None])
@pytest.mark.parametrize("apart", [0, 3])
def test_people_are_not_all_at_one_place(tmp_path, header, apart):
    """Here x and y are those of what has seen them; a few instants may be so."""
    rows = [
        (t, who, 0.6 * t, round(math.sin(t), 3) + (who if k < 2 * apart else 0))
        for k, (t, who, *_) in enumerate(WALK)
    ]
    with pytest.raises(SourceError, match=rf"in {COUNT - apart} of {COUNT} instants .*exactly one place"):
        tracks(write(tmp_path, rows, header))
    few = [(t, who, x, y if k > 8 else 5.0) for k, (t, who, x, y) in enumerate(WALK)]
    few = [(t, who, x - 3 * who if k <= 8 else x, y) for k, (t, who, x, y) in enumerate(few)]
    assert len(tracks(write(tmp_path, few, header), unit="m")) == len(WALK)


# Classes


WORDS = st.sampled_from(["pedestrian", "Person", "human", "ped"])
THINGS = st.sampled_from(["car", "Cyclist", "robot", "vehicle.bus", "BIKE"])


def with_others(rows, others, column):
    """Rows with a further value, and those of others with theirs."""
    further = [
        (t, 50 + k, x + 9, y, other) for k, other in enumerate(others) for t, who, x, y in WALK if who == 1
    ]
    return [(*row, column) for row in rows] + further


@given(
    st.sampled_from(["vehicle_type", "cls", "semantic_class", "detected_class", "mode", "what", "is"]),
    WORDS,
    st.lists(THINGS, min_size=1, max_size=3),
)
@settings(deadline=None, suppress_health_check=FIXTURE)
def test_a_column_of_classes_is_found_by_what_it_holds(tmp_path, plain, title, person, others):
    rows = sorted(with_others(WALK, others, person))
    assert_same(tracks(write(tmp_path, rows, (*TITLES, title))), plain)


def test_words_that_change_are_no_classes(tmp_path, plain, caplog):
    """Such as those for what somebody looks at; and what only has words for others says nothing."""
    looks = [(*row, ("person", "car", "door")[k % 3]) for k, row in enumerate(WALK)]
    with caplog.at_level(logging.WARNING):
        assert_same(tracks(write(tmp_path, looks, (*TITLES, "looks_at"))), plain)
    assert "column looks_at holds words for people and for others (car, door, person), which" in caplog.text
    caplog.clear()
    for note in ("car", "person", "in a hurry", ""):
        assert_same(tracks(write(tmp_path, [(*row, note) for row in WALK], (*TITLES, "note"))), plain)
    assert not caplog.text


def test_any_column_of_words_may_be_chosen_from(tmp_path, plain):
    rows = with_others(WALK, ["robot"], "adult")
    found = tracks(write(tmp_path, rows, (*TITLES, "kind_of_agent")), classes=("robot",))
    assert set(found.track_id) == {50}


@given(WORDS, st.lists(THINGS, min_size=1, max_size=3, unique=True), st.sampled_from(["_", "-", "", " "]))
@settings(deadline=None, suppress_health_check=FIXTURE)
def test_ids_may_say_who_is_no_person(tmp_path, plain, person, others, sign):
    rows = [(t, f"{person}{sign}{who}", x, y) for t, who, x, y in WALK]
    rows += [
        (t, f"{other}{sign}{7 + k}", x + 9, y) for k, other in enumerate(others) for t, _, x, y in WALK[::2]
    ]
    found = tracks(write(tmp_path, sorted(rows)))
    np.testing.assert_array_equal(found.position, plain.position)


def test_ids_without_a_word_for_people_are_asked_about(tmp_path, plain, caplog):
    named = [(t, ("robot", "A7")[who - 1], x, y) for t, who, x, y in WALK]
    with caplog.at_level(logging.WARNING):
        assert len(tracks(write(tmp_path, named))) == len(plain)
    assert "column id: ids begin with words for no people (robot), and all rows are read" in caplog.text
    caplog.clear()
    people = [(t, ("Carla", "Busch")[who - 1], x, y) for t, who, x, y in WALK]
    with caplog.at_level(logging.WARNING):
        assert len(tracks(write(tmp_path, people))) == len(plain)
    assert not caplog.text


@pytest.mark.parametrize("change", [{"vehicle_type": ["car", "person"]}, {"id": ["car_1", "ped_2"]}])
def test_classes_in_data_frames_are_found_by_what_they_hold(change, caplog):
    walks = pd.DataFrame(sorted(WALK, key=lambda row: row[1]), columns=TITLES)
    both = walks.assign(**{title: np.repeat(values, COUNT) for title, values in change.items()})
    found = pedpred.predict(both)
    assert len(found.track.unique()) == 1
    alone = pedpred.predict(walks[walks.id == 2])
    np.testing.assert_allclose(found[["time", "x", "y"]], alone[["time", "x", "y"]])


@pytest.mark.parametrize(
    "label",
    [
        *("pedestrian", "Person", "human.pedestrian.adult", "pedestrian with bike", "person_on_phone"),
        *("human.pedestrian.personal_mobility", "person walking dog", "pedestrian without bike", ""),
        *("pedestrian/bicycle", "agents/human/pedestrian", "Pedestrian/Cyclist"),
    ],
)
def test_labels_of_people(label):
    assert is_person(label)


@pytest.mark.parametrize(
    "label",
    [
        *("non-pedestrian", "not a person", "NOT_PEDESTRIAN", "person_on_bike", "people mover", "no person"),
        *("pedestrian crossing", "human-driven car", "vehicle.person_carrier", "person statue", "dog"),
        *("bicycle/person", "vehicle/person_carrier"),
    ],
)
def test_labels_of_others_may_have_a_word_for_people(label, tmp_path, plain):
    assert not is_person(label)
    assert is_person(label, (label,)), "it may be chosen"
    rows = sorted(with_others(WALK, [label], "pedestrian"))
    assert_same(tracks(write(tmp_path, rows, (*TITLES, "type"))), plain)


def test_a_class_that_is_wanted_may_be_any_word():
    assert is_person("person_on_bike", ("bike",))
    assert is_person("vehicle.car", ("car",))
    assert not is_person("vehicle.car", ("bus",))


# Comments


FRAMES = [(round(t / STEP_S), *row) for t, *row in WALK]


@pytest.mark.parametrize("header", ["frame,id,x,y", None])
@pytest.mark.parametrize(
    ("comment", "proposed"),
    [
        ("# low-pass filtered, cutoff 2 Hz", False),
        ("# Butterworth filter, 4th order, cutoff frequency 6 Hz", False),
        ("# smoothed with a 0.5 Hz filter", False),
        ("# gait frequency 2 Hz", False),
        ("# camera: GoPro, 20 Hz", True),
        ("# synchronised with IMU (20 Hz)", True),
        ("# downsampled from 20 Hz", True),
    ],
)
def test_hertz_of_something_else_are_no_rate(tmp_path, plain, header, comment, proposed, caplog):
    path = write(tmp_path, FRAMES, (f"{comment}\n{header}" if header else comment,))
    with pytest.raises(SourceError, match=r"no comment says the frame rate.*--rate"):
        tracks(path)
    assert ("speaks of 20 Hz" in caplog.text and "say --rate 20" in caplog.text) == proposed
    caplog.clear()
    assert_same(tracks(path, rate_hz=1 / STEP_S), plain)
    assert not caplog.text


@given(
    st.sampled_from(
        ["sampled at", "Recorded with", "sampling rate:", "data at", "low-pass filtered, sampled at"]
    ),
    st.sampled_from(["", " (filter: cutoff 2 Hz)", ", smoothed at 1 Hz"]),
)
@settings(deadline=None, suppress_health_check=FIXTURE)
def test_hertz_of_samples_are_the_rate_unless_another_is_said(tmp_path, plain, words, rest):
    path = write(tmp_path, FRAMES, (f"# {words} 4 Hz{rest}\nframe,id,x,y",))
    assert_same(tracks(path), plain)
    path = write(tmp_path, FRAMES, (f"# {words} 100 Hz{rest}\nframe,id,x,y",))
    assert_same(tracks(path, rate_hz=4.0), plain)


def test_a_rate_that_is_said_in_place_of_hertz_is_named(tmp_path, caplog):
    tracks(write(tmp_path, FRAMES, ("# sampled at 100 Hz\nframe,id,x,y",)), rate_hz=4.0)
    assert "a comment says 100 Hz, and --rate 4 is used" in caplog.text


@pytest.mark.parametrize(
    "comment",
    [
        *("# distance sensor in mm mode", "# calibrated in cm", "# lengths of steps in cm below"),
        *("# distances between walls in cm", "# all checked in a grid in cm steps"),
    ],
)
def test_units_of_something_else_are_not_those_of_positions(tmp_path, plain, comment):
    path = write(tmp_path, WALK, (f"{comment}\ntime,id,x,y",))
    assert_same(tracks(path), plain)
    assert_same(tracks(path, unit="m"), plain)


@pytest.mark.parametrize("comment", ["# all in cm", "# in cm", "# data in cm", "# values are cm", "# cm"])
def test_units_in_vague_words_count_unless_another_is_said(tmp_path, plain, comment, caplog):
    path = write(tmp_path, WALK, (f"{comment}\ntime,id,x,y",))
    assert_same(tracks(path, unit="m"), plain)
    assert "a comment speaks of cm, and lengths are read as m, as was said" in caplog.text
    rows = [(t, who, 100 * x, 100 * y) for t, who, x, y in WALK]
    found = tracks(write(tmp_path, rows, (f"{comment}\ntime,id,x,y",)))
    np.testing.assert_allclose(found.position, plain.position)


# Axes


def crowd_rows(seed, corridor=False, rate_hz=10.0, seconds=15, noise_m=0.02):
    """Time, id, x, y of people who walk everywhere, or along a corridor."""
    rng = np.random.default_rng(seed)
    rows = []
    for who in range(1, 9):
        t = np.arange(rng.integers(0, 40), rng.integers(80, 10 * seconds)) / rate_hz
        sway = rng.uniform(0, 6)
        way = rng.choice([0.0, np.pi]) if corridor else rng.uniform(-3, 3)
        way = way + 0 * t if corridor else way + np.cumsum(rng.normal(0, 0.03, len(t)))
        steps = rng.uniform(0.7, 1.7) * np.stack([np.cos(way), np.sin(way)], axis=-1) / rate_hz
        place = rng.uniform(0, 12, 2) * [1, 0.02 if corridor else 1] + np.cumsum(steps, axis=0)
        if corridor:
            place[:, 1] += 0.03 * np.sin(6 * t + sway)
        rows += [
            (*row,) for row in np.column_stack([t, 0 * t + who, place + rng.normal(0, noise_m, place.shape)])
        ]
    return np.array(sorted(rows))


def write_columns(folder, *columns):
    lines = [
        " ".join(f"{value:.4f}" if k != 1 else f"{value:.0f}" for k, value in enumerate(row))
        for row in zip(*columns, strict=True)
    ]
    path = folder / "untitled.txt"
    path.write_text("\n".join(lines))
    return path


@given(
    st.integers(0, 10_000),
    st.sampled_from(["height", "confidence", "head"]),
    st.sampled_from([2, 3]),
    st.booleans(),
)
@settings(max_examples=30, deadline=None, suppress_health_check=FIXTURE)
def test_a_column_along_which_nobody_walks_is_no_axis(tmp_path, seed, kind, at, more):
    """A height before y or a confidence before x, if the right axis comes later."""
    rng, (t, who, x, y) = np.random.default_rng(seed), crowd_rows(seed).T
    other = {
        "height": 1.7 + 0.1 * (who % 3) + rng.normal(0, 0.03, len(t)),
        "confidence": rng.uniform(0.5, 1.0, len(t)),
        "head": 1.6 + 0.04 * np.sin(12 * t + who),
    }[kind]
    columns = [t, who, x, y]
    columns.insert(at, other)
    path = write_columns(tmp_path, *columns, *([0 * t] if more else []))
    with pytest.raises(
        SourceError, match=rf"column {at + 1} should be {'xy'[at - 2]}, .*column 5.*--columns"
    ):
        tracks(path)
    names = ["time", "id", "x", "y", *(["more"] if more else [])]
    names.insert(at, "other")
    np.testing.assert_allclose(
        tracks(path, columns=tuple(names)).position, np.stack([x, y], axis=-1), atol=1e-4
    )


@given(
    st.integers(0, 10_000),
    st.sampled_from([False, True, True]),
    st.sampled_from(
        [
            "age",
            "heading",
            "degrees",
            "vx",
            "speed",
            "way",
            "pixel",
            "height",
            "slope",
            "door",
            "count",
            "next",
        ]
    ),
)
@settings(max_examples=80, deadline=None, suppress_health_check=FIXTURE)
def test_columns_behind_the_ground_change_nothing(tmp_path, seed, corridor, kind):
    """Also where people walk along one axis: the others are computed from it or from times, or no places."""
    rng, (t, who, x, y) = np.random.default_rng(seed), crowd_rows(seed, corridor).T
    vx, heading, way, age = (np.zeros(len(t)) for _ in range(4))
    for one in np.unique(who):
        mine = who == one
        steps = np.diff(np.stack([x, y])[:, mine], axis=1, prepend=np.nan)
        steps[:, 0] = steps[:, 1]
        vx[mine], heading[mine] = 10 * steps[0], np.arctan2(steps[1], steps[0])
        way[mine] = np.cumsum(np.linalg.norm(steps, axis=0))
        age[mine] = t[mine] - t[mine].min()
    column = {
        "age": age,
        "heading": heading,
        "degrees": np.degrees(heading),
        "vx": vx,
        "speed": abs(vx),
        "way": way,
        "pixel": 320 + 45 * x,
        "height": 1.7 + rng.normal(0, 0.03, len(t)),
        "slope": 0.3 * x + 1.7,
        "door": np.hypot(x - 30, y - 1),
        "count": np.arange(len(t)),
        "next": x + 0.4 * vx,
    }[kind]
    path = write_columns(tmp_path, t, who, x, y, column)
    np.testing.assert_allclose(tracks(path).position, np.stack([x, y], axis=-1), atol=1e-4)


def test_a_depth_is_noticed_as_z_is(tmp_path):
    rows = [(t, who, x, round(1.7 + 0.02 * math.sin(9 * t), 3), y) for t, who, x, y in WALK]
    with pytest.raises(SourceError, match=r"y looks like a height"):
        tracks(write(tmp_path, rows, (*TITLES, "depth")))


def test_degrees_beside_an_altitude_are_called_degrees(tmp_path):
    rows = [(t, who, 8.5 + 1e-5 * x, 47.3 + 1e-5 * y, 440 + 3 * math.sin(t)) for t, who, x, y in WALK]
    with pytest.raises(SourceError, match="look like degrees"):
        tracks(write(tmp_path, rows, (*TITLES, "z")))


# Frames


@pytest.mark.parametrize("header", [("frame", *TITLES[1:]), None])
@pytest.mark.parametrize("every", [2, 6, 10])
def test_the_rate_of_annotations_is_not_that_of_frame_numbers(tmp_path, plain, header, every, caplog):
    """Where each tenth frame of 25 Hz was annotated, 2.5 frames per second is often said of these."""
    rows = [(every * frame, *row) for frame, *row in FRAMES]
    path = write(tmp_path, rows, header, " ")
    assert_same(tracks(path, rate_hz=4.0 * every), plain)
    assert not caplog.text
    tracks(path, rate_hz=4.0)
    right = f"say --rate {4 * every}: 1.4 m/s"
    assert (f"multiples of {every}: at 4 frames per second" in caplog.text and right in caplog.text) == (
        every > 2
    )
    if header is None:
        path.write_text(f"# 4 fps\n{path.read_text()}")
        caplog.clear()
        tracks(path)
        assert (f"correct it to {4 * every}: 1.4 m/s" in caplog.text) == (every > 2)


# Columns beside


def warned(caplog, path, **options):
    """What is said about a file."""
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        tracks(path, **options)
    return caplog.text


@pytest.mark.parametrize(
    "title", ["visible", "is_valid", "isVisible", "detected", "tracked", "in_frame", "is person"]
)
def test_flags_of_who_was_seen(tmp_path, title, caplog):
    rows = [(*row, int(row[0] > 2)) for row in WALK]
    said = warned(caplog, write(tmp_path, rows, (*TITLES, title)))
    assert f"column {title} is False in 18 rows, which are read like others" in said


@pytest.mark.parametrize("title", ["occluded", "is_occluded", "Lost", "is_robot", "out_of_frame"])
def test_flags_of_nobody(tmp_path, title, caplog):
    rows = [(*row, row[0] > 2) for row in WALK]
    said = warned(caplog, write(tmp_path, rows, (*TITLES, title)))
    assert f"column {title} is True in {len(WALK) - 18} rows, which are read like others" in said


@pytest.mark.parametrize("title", ["person_visible_share", "robot", "is", "vehicle", "detected_by"])
def test_no_flags(tmp_path, title, caplog):
    assert not warned(caplog, write(tmp_path, [(*row, int(row[0] > 2)) for row in WALK], (*TITLES, title)))


@pytest.mark.parametrize(
    "title",
    [
        "filename",
        "file_name",
        "source",
        "src_file",
        "part",
        "level",
        "Stockwerk",
        "\u00e9tage",
        "Etage",
        "Ebene",
    ],
)
def test_files_and_floors_in_one_table_are_warned_about(tmp_path, title, caplog):
    rows = [(*row, "ab"[row[1] - 1]) for row in WALK]
    said = warned(caplog, write(tmp_path, rows, (*TITLES, title)))
    assert f"column {title} holds a, b: all are read as one recording on one ground" in said


@given(
    st.floats(-5, 5),
    st.floats(2.2, 20),
    st.sampled_from(["m", "cm", "mm"]),
    st.sampled_from(["z [{}]", "z_{}", "pos z in {}"]),
)
@settings(deadline=None, suppress_health_check=FIXTURE)
def test_heights_of_two_floors_are_warned_about(tmp_path, low_m, apart_m, unit, title):
    one = {"m": 1, "cm": 100, "mm": 1000}[unit]
    messages = []
    for apart in (apart_m, 0.3):
        rows = [
            (*row, round(one * (low_m + apart * (row[1] - 1) + 0.04 * math.sin(k)), 3))
            for k, row in enumerate(WALK)
        ]
        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(
                "pedpred.tables.reading._log.warning", lambda *args: messages.append(args[0] % args[1:])
            )
            tracks(write(tmp_path, rows, (*TITLES, title.format(unit))))
    assert len(messages) == 1
    assert "all are read as on one ground" in messages[0]


@pytest.mark.parametrize(
    ("titles", "doubted"),
    [
        ("frame,id,x,y,w,h", True),
        ("frame,id,x,y,width,height", True),
        ("frame,id,x_px,y_px,bbox_w,bbox_h", True),
        ("frame,id,x_m,y_m,w,h", False),
        ("frame,id,x,y,width,note", False),
    ],
)
def test_corners_of_boxes_are_no_places(tmp_path, titles, doubted, caplog):
    rows = [(frame, who, 40 * x, 40 * y, 20, 50) for frame, who, x, y in FRAMES]
    if "_m" in titles:
        rows = [(*row, 20, 50) for row in FRAMES]
    path = write(tmp_path, rows, titles.split(","))
    said = warned(caplog, path, rate_hz=4.0, **({} if "_m" in titles else {"pixel_m": 0.025}))
    assert ("the middle of the lower edge" in said) == doubted


def test_x_and_y_beside_corners_are_no_corners():
    beside = ("frame", "id", "left", "top", "width", "height", "x", "y")
    assert not sides_of_boxes(beside, {"frame": "frame", "id": "track_id", "x": "x_m", "y": "y_m"})


def test_boxes_of_visdrone_have_no_places_behind_them(tmp_path):
    rows = [
        (frame, who, round(400 + 40 * x), round(40 * y), 20, 50, 1, who, 0, 1) for frame, who, x, y in FRAMES
    ]
    with pytest.raises(SourceError, match=r"boxes of MOTChallenge.*frame,id,x_px,y_px"):
        tracks(write(tmp_path, rows, None), rate_hz=4.0)


def test_boxes_on_the_ground_and_doubts_about_a_data_frame(caplog):
    frame = pd.DataFrame(WALK, columns=TITLES).assign(w=0.5, h=1.7)
    pedpred.predict(frame)
    assert "if w and h are the sides of boxes" in caplog.text
    caplog.clear()
    pedpred.predict(frame.assign(l=0.4))
    assert not caplog.text
    pedpred.predict(frame.assign(l=0.4, object_x=2.0, object_y=frame.y))
    assert "x and y are read as the places of people, and object_x and object_y are not" in caplog.text


# Nobody


@given(
    st.lists(st.sampled_from(["", "NaN", "null", "-1", "None", "<NA>"]), min_size=1, max_size=4),
    st.booleans(),
    st.data(),
)
@settings(deadline=None, suppress_health_check=FIXTURE)
def test_detections_of_nobody_change_nothing_however_they_are_written(tmp_path, plain, nobody, named, data):
    rows = [(t, f"P{who}" if named else who, x, y) for t, who, x, y in WALK]
    for k, name in enumerate(nobody):
        rows.insert(data.draw(st.integers(0, len(rows))), (0.25 * k, name, 90.0 + k, 9.0))
    found = tracks(write(tmp_path, rows))
    np.testing.assert_array_equal(found.position, plain.position)
    np.testing.assert_array_equal(found.time_s, plain.time_s)


def test_rows_without_an_id_and_a_place_are_something_else(tmp_path):
    """Such as a second row of units, which must not be passed over."""
    with pytest.raises(SourceError, match="line 2: id = '', but everybody needs an id"):
        tracks(write(tmp_path, [("", "", "(furlong)", "(furlong)"), *WALK], ("time", "id", "x", "y")))


def test_detections_of_nobody_are_counted(tmp_path, caplog):
    rows = [*WALK, (0, "", 9, 9), (0.25, "nan", 9, 9)]
    said = warned(caplog, write(tmp_path, rows))
    assert (
        "rows without an id are about nobody who was tracked, and left out: 2, the first in line 50" in said
    )
    with pytest.raises(SourceError, match="line 2: id = '', but everybody needs an id"):
        tracks(write(tmp_path, [(t, "", x, y) for t, _, x, y in WALK]))


# Names of rows


@given(
    st.sampled_from([" ", ",", ";", "\t"]),
    st.lists(st.integers(0, 10**6), unique=True, min_size=48, max_size=48),
)
@settings(deadline=None, suppress_health_check=FIXTURE)
def test_names_of_rows_may_be_any_as_r_writes_them(tmp_path, plain, separator, numbers):
    """Of a table from which rows were taken, or whose rows are in another order."""
    rows = [(f'"{number}"', *row) for number, row in zip(numbers, WALK, strict=True)]
    header = [f'"{title}"' for title in TITLES]
    assert_same(tracks(write(tmp_path, rows, header, separator)), plain)


def test_a_value_too_many_is_no_name_of_a_row(tmp_path):
    header = [f'"{title}"' for title in TITLES]
    named = [(f'"{k}"', *row) for k, row in enumerate(WALK)]
    with pytest.raises(SourceError, match="line 4: 4 columns, expected 5: name of the row time"):
        tracks(write(tmp_path, [*named[:2], WALK[2], *named[3:]], header))
    commas = [(f'"{who}"', t, x, 5, y) for t, who, x, y in WALK]
    with pytest.raises(SourceError, match="line 4: 5 columns, expected 4: id time x y"):
        tracks(write(tmp_path, commas, [f'"{title}"' for title in ("id", "time", "x", "y")]))
    with pytest.raises(SourceError, match="line 2: 5 columns, expected 4"):
        tracks(write(tmp_path, [(k, *row) for k, row in enumerate(WALK, 7)], header))


# Spellings


@pytest.mark.parametrize("titles", ["x (in),y (in)", "x [in],y [in]", "X(IN),Y(IN)"])
def test_in_between_brackets_means_inches(tmp_path, plain, titles):
    rows = [(t, who, x / 0.0254, y / 0.0254) for t, who, x, y in WALK]
    found = tracks(write(tmp_path, rows, ("time", "id", *titles.split(","))))
    np.testing.assert_allclose(found.position, plain.position)


@pytest.mark.parametrize("title", ["tag", "tagId", "tag_id", "tracker_id", "mac", "Tag No", "badge"])
def test_what_people_wear_is_their_id_where_no_title_says_more(tmp_path, plain, title):
    assert_same(tracks(write(tmp_path, WALK, ("time", title, "x", "y"))), plain)
    rows = [(*row, 7) for row in WALK]
    for who in ("id", "person", "person_id"):
        assert_same(tracks(write(tmp_path, rows, ("time", who, "x", "y", title))), plain)


@pytest.mark.parametrize(("header", "at"), [(TITLES, 0), (TITLES, 2), (TITLES, 3), (None, 2), (None, 3)])
def test_underscores_are_no_digits(tmp_path, header, at):
    rows = [list(row) for row in WALK]
    rows[9][at] = "1_50"
    with pytest.raises(SourceError, match=r"line \d+: \w+ = '1_50' is not a number"):
        tracks(write(tmp_path, rows, header))


def test_marks_of_files_that_were_joined_say_nothing(tmp_path, plain):
    path = write(tmp_path, WALK[:24])
    other = write(tmp_path, WALK[24:], name="other.csv")
    joined = "\ufeff" + path.read_text() + "\n\ufeff" + other.read_text()
    for text in (joined, joined.replace("\ufefftime", "\ufeff\n\ufefftime")):
        path.write_text(text, encoding="utf-8")
        assert_same(tracks(path), plain)
