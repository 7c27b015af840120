"""Laboratory recordings: text files and geometries read to the value, and what can be wrong with them."""

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from pedpred.command import main
from pedpred.reading.geometry import Geometry, occupancy_of
from pedpred.sources.jupedsim import read_laboratory
from pedpred.storage.scenes import read_scene
from tests.raw_files import LABORATORY, write_laboratory
from tests.refused import unread
from tests.scenes import assert_same

COMMAND = LABORATORY | {"resolution_m": 0.05, "thickness_m": 3.0, "open_end_m": 6.0}


@pytest.fixture
def folder(tmp_path):
    return write_laboratory(tmp_path)


def change(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def test_tracks_and_their_interval(folder):
    scene = read_laboratory(folder, "mine", LABORATORY)
    assert (scene.name, scene.detection_dt_s) == ("mine", 0.25)
    assert scene.trajectories.time_s.tolist() == [0.0, 0.25, 0.25]
    assert scene.trajectories.track_id.tolist() == [1, 1, 2]
    assert scene.trajectories.position.tolist() == [[0.5, 1.0], [1.0, 1.0], [3.5, 1.5]]


def test_walls_the_table_and_the_open_end(folder):
    occupancy = read_laboratory(folder, "mine", LABORATORY).occupancy
    assert occupancy.origin.tolist() == [-2.0, -1.0]
    assert occupancy.extent_m.tolist() == [9.0, 4.0]
    free = occupancy.center_of(np.argwhere(~occupancy.occupied))
    assert len(free) * 0.25**2 == pytest.approx((6 + 2) * 2 - 1 * 0.5)
    assert free.min(axis=0).tolist() == [-1.875, 0.125]
    assert free.max(axis=0).tolist() == [5.875, 1.875]
    assert occupancy.is_occupied(np.array([[4.5, 0.75], [6.1, 1.0], [-1.0, 2.1]])).all()
    assert not occupancy.is_occupied(np.array([[-1.9, 1.0], [4.5, 1.25]])).any()


def test_a_missing_frame_rate_may_be_given(folder):
    change(folder / "hall.txt", "framerate: 16", "nothing")
    with unread(folder / "hall.txt", remedy="frame_rate_hz"):
        read_laboratory(folder, "mine", LABORATORY)
    assert read_laboratory(folder, "mine", LABORATORY | {"frame_rate_hz": 8}).detection_dt_s == 0.5


@pytest.mark.parametrize(
    ("file", "old", "new", "line"),
    [
        ("hall.txt", "3.5", "three", 5),
        ("hall.txt", "# id", "# framerate: 25, id", None),
        ("hall.txt", "y/m", "x/cm", None),
        ("hall.xml", "polygon", "line", None),
    ],
)
def test_damage_is_named_by_file_and_line(folder, file, old, new, line):
    change(folder / file, old, new)
    with unread(folder / file, line):
        read_laboratory(folder, "mine", LABORATORY)


@given(
    st.lists(st.floats(0.5, 5.0), min_size=3, max_size=9),
    st.floats(0, 6.3),
    st.tuples(st.floats(-9, 9), st.floats(-9, 9)),
)
def test_map_of_any_star_has_its_corners_and_its_area(radii, turn_rad, centre):
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


def test_the_command_reads_what_the_source_does(folder, tmp_path):
    given = [str(folder / "hall.txt"), "--map", str(folder / "hall.xml"), "--open-end", *"0002"]
    main(["convert", *given, "-o", str(tmp_path / "mine")])
    assert_same(read_scene(tmp_path / "mine"), read_laboratory(folder, "mine", COMMAND))
