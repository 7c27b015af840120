"""Sources of recordings: EWAP and ETH/UCY read to the value, and what can be wrong with their files."""

import numpy as np
import pytest
from PIL import Image

from pedpred.geometry import Homography
from pedpred.sources import SOURCES
from pedpred.sources.eth_ucy import read_text
from pedpred.sources.ewap import merge_groups, occupancy_from_image, read_sequence
from tests.conftest import ROOT
from tests.raw_files import EWAP, EWAP_ROWS, STREET, STREET_ROWS, write_sequence, write_street
from tests.refused import unread
from tests.worlds import EXCERPT, recorded

RECORDINGS = {  # people, detections, last frame: counted in the files with numpy.loadtxt
    EXCERPT: (17, 381, 1740),
    "zara01": (148, 5153, 9010),
    "zara02": (204, 9722, 10520),
    "zara03": (137, 5005, 7530),
    "students001": (415, 21813, 4430),
    "students003": (434, 17953, 5400),
}


@pytest.fixture
def folder(tmp_path):
    return write_sequence(tmp_path)


def row(text):
    return lambda folder: (folder / "obsmat.txt").write_text("\n".join([*EWAP_ROWS, text]))


def text(name, content):
    return lambda folder: (folder / name).write_text(content)


def picture(name, shape):
    return lambda folder: Image.fromarray(np.zeros(shape, dtype=np.uint8)).save(folder / name)


# EWAP


def test_ewap_detections_and_groups_are_those_of_the_file(folder):
    scene = read_sequence(folder, "tiny", EWAP)
    assert (scene.name, scene.detection_dt_s, scene.camera) == ("tiny", 0.4, None)
    assert scene.trajectories.time_s.tolist() == [0.4, 0.4, 0.8]
    assert scene.trajectories.track_id.tolist() == [1, 2, 1]
    assert scene.trajectories.position.tolist() == [[2, 3], [4, 6], [2.5, 3]]
    assert scene.trajectories.group_id.tolist() == [0, 0, 0]
    assert scene.trajectories.velocity is None, "the columns contain the next annotation"


def test_ewap_map_has_the_wall_across_large_x(folder):
    """Row 7 is x = 6.5 ... 7.5 m, columns 0 ... 9 are y = -1 ... 19 m; the map keeps its margin."""
    occupancy = read_sequence(folder, "tiny", EWAP).occupancy
    assert occupancy.origin.tolist() == [1.0, -1.0]
    assert occupancy.extent_m.tolist() == [7.0, 20.0]
    x, y = occupancy.center_of(np.argwhere(occupancy.occupied)).T
    assert (x.min(), x.max(), y.min(), y.max()) == (6.75, 7.25, -0.75, 18.75)
    assert occupancy.occupied.sum() == 2 * 40


def test_reference_picture_becomes_the_camera(folder):
    picture("reference.png", (8, 10, 3))(folder)
    camera = read_sequence(folder, "tiny", EWAP).camera
    assert camera.picture.shape == (8, 10, 3)
    assert camera.homography.to_world(np.zeros(2)).tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    ("damage", "file", "line"),
    [
        (row("8 2 4.0 0 6.0 9 0"), "obsmat.txt", 4),
        (text("H.txt", "1 2 3\n2 4 6\n0 0 1\n"), "H.txt", None),
        (text("H.txt", "1 0 -1\n0 2 -2\n-0.124999999 0 1\n"), "map.png", None),  # walls up to the horizon
        (text("groups.txt", "1 2\n\n2 77\n"), "groups.txt", 3),
        (picture("reference.png", (10, 8, 3)), "map.png", None),
    ],
)
def test_ewap_damage_is_named_by_file_and_line(folder, damage, file, line):
    damage(folder)
    with unread(folder / file, line):
        read_sequence(folder, "tiny", EWAP)


def test_groups_with_a_common_member_are_one():
    groups = [{5, 4}, {1, 2}, {3, 7}, {2, 3}, {9}]
    assert merge_groups(groups) == merge_groups(groups[::-1]) == [{1, 2, 3, 7}, {4, 5}, {9}]


def test_a_picture_without_obstacles_is_free_ground():
    homography, points = Homography(np.eye(3)), np.array([[2.0, 3.0]])
    occupancy = occupancy_from_image(np.zeros((8, 10), dtype=bool), homography, points, 0.5, 0.9)
    assert not occupancy.occupied.any()
    assert occupancy.origin.tolist() == [1.0, 2.0]


# ETH/UCY


def test_eth_ucy_frames_become_seconds_on_free_ground(tmp_path):
    scene = read_text(write_street(tmp_path), "street", STREET)
    seen = scene.trajectories
    rows = sorted(zip(seen.time_s.tolist(), seen.track_id.tolist(), seen.position.tolist(), strict=True))
    assert rows == [(0.0, 1, [2, 3]), (0.0, 2, [-4, 6]), (0.4, 1, [2.5, 3])]
    assert scene.detection_dt_s == 0.4
    assert not scene.occupancy.occupied.any()
    assert scene.occupancy.origin.tolist() == [-5, 2]
    assert scene.occupancy.extent_m.tolist() == [8.5, 5]


@pytest.mark.parametrize(("more", "line"), [("10 1 9 9", 4), ("20 1 2.5", 4)])
def test_eth_ucy_damage_is_named_by_line(tmp_path, more, line):
    write_street(tmp_path, [*STREET_ROWS, more])
    with unread(tmp_path / "street.txt", line):
        read_text(tmp_path, "street", STREET)


@pytest.mark.parametrize("name", RECORDINGS)
def test_eth_ucy_recordings_have_the_known_people(name):
    scene = recorded(name)
    seen, (people, detections, last) = scene.trajectories, RECORDINGS[name]
    assert (len(np.unique(seen.track_id)), len(seen)) == (people, detections)
    assert seen.time_s.max() == last / 25
    assert scene.detection_dt_s == pytest.approx(seen.usual_interval_s()) == 0.4
    cells = scene.occupancy.cell_of(seen.position)
    assert ((cells >= 0) & (cells < scene.occupancy.occupied.shape)).all()


# Scene folders


def test_a_scene_folder_is_read_under_the_name_of_its_place():
    scene = SOURCES["scene_folder"](ROOT / "examples/crossing", "mine", {})
    assert (scene.name, len(scene.trajectories)) == ("mine", 1340)
