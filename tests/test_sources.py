"""EWAP: a tiny hand-made sequence, and everything that can be wrong with one."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pedpred.errors import InputError, ValueRuleError
from pedpred.geometry import Homography
from pedpred.sources import SOURCES
from pedpred.sources.ewap import merge_groups, occupancy_from_image, read_sequence

SETTINGS = {"frame_rate_hz": 10.0, "annotation_frames": 4, "resolution_m": 0.5, "margin_m": 1.0}
ROWS = ["4 1 2.0 0 3.0 9 0 9", "4 2 4.0 0 6.0 9 0 9", "8 1 2.5 0 3.0 9 0 9"]


def write_sequence(folder):
    """A picture of 8 rows and 10 columns, 1 m per row (x) and 2 m per column (y), wall in row 7."""
    (folder / "obsmat.txt").write_text("\r\n".join(ROWS) + "\r\n")
    (folder / "H.txt").write_text(" 1 0 -1\n 0 2 -2\n 0 0 1\n")  # pixel (1, 1) of MATLAB is (0, 0) m
    (folder / "groups.txt").write_text(" 1 2 \n \n")
    blocked = np.zeros((8, 10), dtype=np.uint8)
    blocked[7] = 255
    Image.fromarray(blocked).save(folder / "map.png")
    return folder


@pytest.fixture
def folder(tmp_path):
    return write_sequence(tmp_path)


def change_row(row):
    return lambda folder: (folder / "obsmat.txt").write_text("\n".join([*ROWS, row]))


def change(name, text):
    return lambda folder: (folder / name).write_text(text)


def change_picture(name, shape):
    return lambda folder: Image.fromarray(np.zeros(shape, dtype=np.uint8)).save(folder / name)


def test_tiny_sequence(folder):
    scene = read_sequence(folder, "tiny", SETTINGS)
    assert scene.name == "tiny"
    assert scene.detection_dt_s == 0.4
    assert scene.trajectories.time_s.tolist() == [0.4, 0.4, 0.8]
    assert scene.trajectories.track_id.tolist() == [1, 2, 1]
    assert scene.trajectories.position.tolist() == [[2, 3], [4, 6], [2.5, 3]]
    assert scene.trajectories.group_id.tolist() == [0, 0, 0]
    assert scene.trajectories.velocity is None
    assert scene.camera is None


def test_velocity_columns_are_never_used(folder):
    """They contain the next annotation."""
    before = read_sequence(folder, "tiny", SETTINGS)
    change("obsmat.txt", "\n".join(ROWS).replace("9 0 9", "-5 0 7"))(folder)
    after = read_sequence(folder, "tiny", SETTINGS)
    assert (before.trajectories.position == after.trajectories.position).all()
    assert after.trajectories.velocity is None


def test_tiny_map_has_the_wall_across_large_x(folder):
    """Row 7 is x = 6.5 ... 7.5 m, columns 0 ... 9 are y = -1 ... 19 m; the map keeps its margin."""
    occupancy = read_sequence(folder, "tiny", SETTINGS).occupancy
    assert occupancy.origin.tolist() == [1.0, -1.0]
    assert occupancy.extent_m.tolist() == [7.0, 20.0]
    x, y = occupancy.center_of(np.argwhere(occupancy.occupied)).T
    assert (x.min(), x.max()) == (6.75, 7.25)
    assert (y.min(), y.max()) == (-0.75, 18.75)
    assert occupancy.occupied.sum() == 2 * 40


def test_reference_picture_becomes_the_camera(folder):
    change_picture("reference.png", (8, 10, 3))(folder)
    camera = read_sequence(folder, "tiny", SETTINGS).camera
    assert camera.picture.shape == (8, 10, 3)
    assert camera.homography.to_world(np.zeros(2)).tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    ("damage", "file", "line"),
    [
        (change_row("8 2 4.0 0 6.0 9 0"), "obsmat.txt", 4),
        (change_row("8 2 4.0 0 6.0 9 0 9 9"), "obsmat.txt", 4),
        (change_row("8 2 4.0 0 six 9 0 9"), "obsmat.txt", 4),
        (change_row("8 2.5 4.0 0 6.0 9 0 9"), "obsmat.txt", None),
        (change_row("4 2 4.0 0 6.1 9 0 9"), "obsmat.txt", 4),
        (change_row("8 2 4.0 0 666 9 0 9"), "obsmat.txt", None),
        (change_row(f"{10**15} 2 4.0 0 6.0 9 0 9"), "obsmat.txt", None),
        (change("obsmat.txt", "\r\n"), "obsmat.txt", None),
        (lambda f: (f / "obsmat.txt").unlink(), "obsmat.txt", None),
        (change("H.txt", "1 0 -1\n0 2 -2\n"), "H.txt", None),
        (change("H.txt", "1 0\n0 2\n0 0\n"), "H.txt", None),
        (change("H.txt", "1 0 -1\n0 inf -2\n0 0 1\n"), "H.txt", None),
        (change("H.txt", "1 2 3\n2 4 6\n0 0 1\n"), "H.txt", None),
        (change("H.txt", "1 0 -1\n0 2 -2\n-0.124999999 0 1\n"), "map.png", None),  # walls up to the horizon
        (change("groups.txt", "1 2\n\n2 77\n"), "groups.txt", 3),
        (change("groups.txt", "1 two\n"), "groups.txt", 1),
        (change("map.png", "no picture"), "map.png", None),
        (lambda f: (f / "map.png").unlink(), "map.png", None),
        (lambda f: (f / "map.png").write_bytes((f / "map.png").read_bytes()[:50]), "map.png", None),
        (change_picture("reference.png", (10, 8, 3)), "map.png", None),
        (change_picture("map.png", (3, 3)), "obsmat.txt", None),
    ],
)
def test_bad_input_is_named(folder, damage, file, line):
    damage(folder)
    with pytest.raises(InputError) as error:
        read_sequence(folder, "tiny", SETTINGS)
    assert (error.value.path, error.value.where) == (folder / file, line)


def test_groups_with_a_common_member_are_one():
    groups = [{5, 4}, {1, 2}, {3, 7}, {2, 3}, {9}]
    assert merge_groups(groups) == merge_groups(groups[::-1]) == [{1, 2, 3, 7}, {4, 5}, {9}]


def test_no_obstacle_no_cell():
    homography, points = Homography(np.eye(3)), np.array([[2.0, 3.0]])
    occupancy = occupancy_from_image(np.zeros((8, 10), dtype=bool), homography, points, 0.5, 0.9)
    assert not occupancy.occupied.any()
    assert occupancy.origin.tolist() == [1.0, 2.0]


def test_a_scene_folder_is_read_under_the_name_of_its_place():
    example = Path(__file__).parents[1] / "examples" / "crossing"
    scene = SOURCES["scene_folder"](example, "mine", {})
    assert scene.name == "mine"
    assert len(scene.trajectories.time_s) == 1340
    with pytest.raises(ValueRuleError) as error:
        SOURCES["scene_folder"](example, "mine", {"margin_m": 1.0})
    assert error.value.field == "margin_m"
