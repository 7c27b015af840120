"""Laboratory text files and their geometry: how they may look, and everything that can be wrong with them."""

import re

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from pedpred.command import main
from pedpred.errors import InputError, ValueRuleError
from pedpred.reading.geometry import Geometry, occupancy_of, read_walls
from pedpred.sources.jupedsim import read_laboratory, read_tracks
from pedpred.storage.scenes import read_scene
from tests.scenes import assert_same

SETTINGS = {"recording": "hall", "resolution_m": 0.25, "thickness_m": 1.0, "open_end_m": 2.0}
SETTINGS |= {"open_ends": [[[0, 0], [0, 2]]]}
COMMAND = SETTINGS | {"resolution_m": 0.05, "thickness_m": 3.0, "open_end_m": 6.0}
TEXT = "# framerate: 16\n# id frame x/m y/m z/m\n1\t0\t0.5\t1\t1.7\n1\t4\t1.0\t1\t1.7\n2\t4\t3.5\t1.5\t1.8\n"
XML = """<?xml version="1.0" encoding="UTF-8"?>
<geometry version="0.8" unit="m">
 <rooms><room id="0"><subroom id="0">
  <polygon caption="wall">
   <vertex px="0" py="0"/><vertex px="6" py="0"/><vertex px="6" py="2"/><vertex px="0" py="2"/>
   <vertex px="0" py="0"/>
  </polygon>
  <obstacle id="1"><polygon>
   <vertex px="4" py="0.5"/><vertex px="5" py="0.5"/><vertex px="5" py="1"/><vertex px="4" py="1"/>
  </polygon></obstacle>
 </subroom></room></rooms>
</geometry>
"""


def write_recording(folder):
    """Two people in a hall of 6 m x 2 m with a table, open on the left."""
    (folder / "hall.txt").write_text(TEXT)
    (folder / "hall.xml").write_text(XML)
    return folder


@pytest.fixture
def folder(tmp_path):
    return write_recording(tmp_path)


def change(name, old, new):
    def apply(folder):
        text = (folder / name).read_text()
        assert old in text
        (folder / name).write_text(text.replace(old, new))

    return apply


def test_tracks_and_their_interval(folder):
    scene = read_laboratory(folder, "mine", SETTINGS)
    assert scene.name == "mine"
    assert scene.detection_dt_s == 0.25
    assert scene.trajectories.time_s.tolist() == [0.0, 0.25, 0.25]
    assert scene.trajectories.track_id.tolist() == [1, 1, 2]
    assert scene.trajectories.position.tolist() == [[0.5, 1.0], [1.0, 1.0], [3.5, 1.5]]


def test_walls_the_table_and_the_open_end(folder):
    occupancy = read_laboratory(folder, "mine", SETTINGS).occupancy
    assert occupancy.origin.tolist() == [-2.0, -1.0]
    assert occupancy.extent_m.tolist() == [9.0, 4.0]
    free = occupancy.center_of(np.argwhere(~occupancy.occupied))
    assert len(free) * 0.25**2 == pytest.approx((6 + 2) * 2 - 1 * 0.5)
    assert free.min(axis=0).tolist() == [-1.875, 0.125]
    assert free.max(axis=0).tolist() == [5.875, 1.875]
    assert occupancy.is_occupied(np.array([[4.5, 0.75], [6.1, 1.0], [-1.0, 2.1]])).all()
    assert not occupancy.is_occupied(np.array([[-1.9, 1.0], [4.5, 1.25]])).any()


@pytest.mark.parametrize(
    "header",
    [
        "#framerate: 16",
        "# framerate: 16.00 fps",
        "# Frame rate 16",
        "#description: run 2, 16:02\n#fps=16",
    ],
)
def test_ways_to_say_the_frame_rate(folder, header):
    change("hall.txt", "# framerate: 16", header)(folder)
    assert read_tracks(folder / "hall.txt").time_s.max() == 0.25


@pytest.mark.parametrize(
    ("comment", "unit_m"),
    [
        ("x/m y/m", 1.0),
        ("ID FR X Y Z", 1.0),
        ("x/cm y/cm", 0.01),
        ("x [cm] y [cm] z [cm]", 0.01),
        ("coordinates given in mm", 0.001),
        ("z in cm of the head", 1.0),
    ],
)
def test_ways_to_say_the_unit(folder, comment, unit_m):
    change("hall.txt", "id frame x/m y/m z/m", comment)(folder)
    assert read_tracks(folder / "hall.txt").position[0].tolist() == [0.5 * unit_m, unit_m]


def test_a_missing_frame_rate_may_be_given(folder):
    change("hall.txt", "framerate: 16", "nothing")(folder)
    with pytest.raises(InputError, match=r"hall\.txt: .*frame_rate_hz"):
        read_laboratory(folder, "mine", SETTINGS)
    scene = read_laboratory(folder, "mine", SETTINGS | {"frame_rate_hz": 8})
    assert scene.detection_dt_s == 0.5


def test_four_columns_other_languages_and_windows(folder):
    lines = [line.rsplit("\t", 1)[0] for line in TEXT.splitlines()]
    text = "\r\n".join(["\ufeff# Jülich", *lines, ""])
    (folder / "hall.txt").write_bytes(text.encode("utf-8"))
    assert len(read_tracks(folder / "hall.txt")) == 3


TRACKS = [
    (("1\t4\t", "1\t"), 4, "4 columns, expected 5"),
    (("3.5", "three"), 5, "x = 'three' is not a number"),
    (("3.5", "inf"), 5, "x = 'inf', must be finite"),
    (("2\t4", "2\t4.5"), 5, "frame = 4.5, must be a whole number"),
    (("2\t4", "1\t4"), 5, "id 1 is at another place at 0.25 s in line 4"),
    (("# id", "# framerate: 25, id"), None, "frame rates 16.0 and 25.0"),
    (("16", "0"), None, "0 is not a frame rate, which is from 0.001"),
    (("y/m", "x/cm"), None, "units of lengths cm and m"),
    ((TEXT[TEXT.index("1\t0") :], ""), None, "no detections, the file is empty"),
    (("1\t4", "3\t4"), None, "no pedestrian was detected twice"),
]
GEOMETRY = [
    (('px="6"', ""), 5, "px = '' is not a number"),
    (('px="6"', 'px="inf"'), 5, "vertex .*, farther than"),
    (('px="6"', 'px="-2e8"'), 5, "vertex .*, farther than 1e.08 from the origin"),
    (('unit="m"', 'unit="km"'), 2, "unit = 'km', expected one of m, cm"),
    (("<obstacle", "<obstacle><polygon/></obstacle><obstacle"), 8, "a polygon with fewer than 2"),
    (
        ("</obstacle>", '</obstacle><crossing><vertex px="0" py="0"/></crossing>'),
        10,
        "a crossing with fewer than 2",
    ),
    (("geometry", "svg"), 2, "the outermost element is <svg>"),
    (("</rooms>", ""), None, "mismatched tag"),
    (("polygon", "line"), None, "no polygon outlines the ground"),
]


def refused(folder, file, line, named):
    where = re.escape(str(folder / file) + ("" if line is None else f", line {line}"))
    return pytest.raises(InputError, match=f"^{where}: .*{named}")


@pytest.mark.parametrize(
    ("file", "changed", "line", "named"),
    [("hall.txt", *row) for row in TRACKS] + [("hall.xml", *row) for row in GEOMETRY],
)
def test_bad_input_is_named(folder, file, changed, line, named):
    change(file, *changed)(folder)
    with refused(folder, file, line, named):
        read_laboratory(folder, "mine", SETTINGS)


@pytest.mark.parametrize("file", ["hall.txt", "hall.xml"])
def test_missing_and_unreadable_files_are_named(folder, file):
    (folder / file).write_bytes(b"\xff\xfe1 2")
    with refused(folder, file, None, "(the text is not|not well-formed)"):
        read_laboratory(folder, "mine", SETTINGS)
    (folder / file).unlink()
    with refused(folder, file, None, "(the file is missing|there is no such file)"):
        read_laboratory(folder, "mine", SETTINGS)


def test_entities_are_refused_before_they_grow(folder):
    bomb = '<!DOCTYPE geometry [<!ENTITY a "ha"><!ENTITY b "&a;&a;">]><geometry unit="&b;"/>'
    (folder / "hall.xml").write_text(bomb)
    with pytest.raises(InputError, match="line 1: a document type, which could define entities"):
        read_walls(folder / "hall.xml")


def test_lengths_in_centimetres(folder):
    metres = read_walls(folder / "hall.xml")
    change("hall.xml", 'unit="m"', 'unit="cm"')(folder)
    assert read_walls(folder / "hall.xml").ground[0].area == pytest.approx(1e-4 * metres.ground[0].area)


@pytest.mark.parametrize("key", ["resolution_m", "thickness_m", "open_end_m", "frame_rate_hz"])
def test_settings_out_of_range(folder, key):
    with pytest.raises(ValueRuleError, match=f"{key} = -1"):
        read_laboratory(folder, "mine", SETTINGS | {key: -1})


@pytest.mark.parametrize("edge", [[[3, 0.5], [3, 1.5]], [[9, 0], [9, 2]], [[0, 0], [0, 0]]])
def test_an_open_end_away_from_the_outline_is_refused(folder, edge):
    with refused(folder, "hall.xml", None, "open_ends = .*it must lie on the outline"):
        read_laboratory(folder, "mine", SETTINGS | {"open_ends": [edge]})


@given(
    st.lists(st.floats(0.5, 5.0), min_size=3, max_size=9),
    st.floats(0, 6.3),
    st.tuples(st.floats(-9, 9), st.floats(-9, 9)),
)
def test_the_map_of_any_star_has_its_corners_inside_and_its_area(radii, turn_rad, centre):
    """Corners go once round the centre: points on the way to a corner are inside, those beyond are not."""
    angles = turn_rad + 2 * np.pi * np.arange(len(radii)) / len(radii)
    arms = np.array(radii)[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    occupancy = occupancy_of(Geometry((shapely.Polygon(centre + arms),)), 0.02, 0.5)
    assert not occupancy.is_occupied(centre + 0.6 * arms).any()
    assert occupancy.is_occupied(centre + arms * (1 + 0.1 / np.array(radii)[:, None])).all()
    x, y = arms.T
    area = 0.5 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1))
    perimeter = np.linalg.norm(arms - np.roll(arms, -1, axis=0), axis=1).sum()
    assert (~occupancy.occupied).sum() * 0.02**2 == pytest.approx(area, abs=0.02 * perimeter)


def arguments(folder, *more):
    return [
        str(folder / "hall.txt"),
        "--map",
        str(folder / "hall.xml"),
        "--open-end",
        "0",
        "0",
        "0",
        "2",
        *more,
    ]


def test_the_command_reads_text_and_geometry(folder, tmp_path, capsys):
    main(["convert", *arguments(folder, "-o", str(tmp_path / "mine"))])
    scene, expected = read_scene(tmp_path / "mine"), read_laboratory(folder, "mine", COMMAND)
    assert_same(scene, expected)
    main(["info", *arguments(folder)])
    said = capsys.readouterr().out
    assert "3 of 2 tracks" in said
    assert "0.0 % of the detections in obstacles, 0.0 % outside the map" in said


def test_the_command_takes_a_frame_rate_and_wants_a_geometry_for_open_ends(folder, tmp_path, capsys):
    change("hall.txt", "framerate: 16", "nothing")(folder)
    with pytest.raises(SystemExit, match="--rate"):
        main(["info", *arguments(folder)])
    main(["info", *arguments(folder, "--frame-rate", "8")])
    assert "usually 0.5 s" in capsys.readouterr().out
    with pytest.raises(SystemExit, match=r"it needs a geometry: --map walls\.xml or \.wkt"):
        main(["info", str(folder / "hall.txt"), "--frame-rate", "8", "--open-end", "0", "0", "0", "2"])
