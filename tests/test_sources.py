"""EWAP: a tiny hand-made sequence, and everything that can be wrong with one."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pedpred.errors import InputError, ValueRuleError
from pedpred.geometry import Homography
from pedpred.sources import SOURCES
from pedpred.sources.ewap import merged, occupancy_from_image, read_sequence

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
    ("damage", "file", "line", "named"),
    [
        (change_row("8 2 4.0 0 6.0 9 0"), "obsmat.txt", 4, "7 columns, expected 8: frame id pos_x"),
        (change_row("8 2 4.0 0 6.0 9 0 9 9"), "obsmat.txt", 4, "9 columns"),
        (change_row("8 2 4.0 0 six 9 0 9"), "obsmat.txt", 4, "pos_y = 'six' is not a number"),
        (change_row("8 2 nan 0 6.0 9 0 9"), "obsmat.txt", 4, "pos_x = nan, must be finite"),
        (change_row("8 2.5 4.0 0 6.0 9 0 9"), "obsmat.txt", 4, "id = 2.5"),
        (change_row("4 2 4.0 0 6.0 9 0 9"), "obsmat.txt", 4, "frame 4 and id 2 again, first in line 2"),
        (change_row("8 2 4.0 0 666 9 0 9"), "obsmat.txt", 4, r"\[4.0, 666.0\] is pixel \[4.0, 333.0\]"),
        (change_row(f"{10**15} 2 4.0 0 6.0 9 0 9"), "obsmat.txt", None, r"time_s\[3\] = 1000+\.0"),
        (change_row("8 2 4.0 0 6.0 \u00e9"), "obsmat.txt", 4, "6 columns, expected 8: frame id"),
        (change("obsmat.txt", "\r\n"), "obsmat.txt", None, "no annotations, the file is empty"),
        (change("obsmat.txt", "\n".join(ROWS)[:-12]), "obsmat.txt", 3, "3 columns"),
        (lambda f: (f / "obsmat.txt").unlink(), "obsmat.txt", None, "there is no such file"),
        (change("H.txt", "1 0 -1\n0 2 -2\n"), "H.txt", None, "2 rows, expected a 3 x 3 matrix"),
        (change("H.txt", "1 0\n0 2\n0 0\n"), "H.txt", 1, "2 columns, expected 3"),
        (change("H.txt", "1 0 -1\n0 inf -2\n0 0 1\n"), "H.txt", 2, "h_2 = 'inf'"),
        (change("H.txt", "1 2 3\n2 4 6\n0 0 1\n"), "H.txt", None, "must be invertible"),
        (change("groups.txt", "1 2\n\n2 77\n"), "groups.txt", 3, "id 77 has no row in obsmat.txt"),
        (change("groups.txt", "1 two\n"), "groups.txt", 1, "'two'"),
        (change("map.png", "no picture"), "map.png", None, "not a readable image"),
        (lambda f: (f / "map.png").unlink(), "map.png", None, "not a readable image"),
        (lambda f: (f / "map.png").write_bytes((f / "map.png").read_bytes()[:50]), "map.png", None, "image"),
        (change_picture("reference.png", (10, 8, 3)), "map.png", None, r"\(8, 10\) .* \(10, 8\)"),
        (change_picture("map.png", (3, 3)), "obsmat.txt", 2, r"map.png with its \(3, 3\) pixels"),
    ],
)
def test_bad_input_is_named(folder, damage, file, line, named):
    damage(folder)
    with pytest.raises(InputError, match=named) as error:
        read_sequence(folder, "tiny", SETTINGS)
    where = str(folder / file) + ("" if line is None else f", line {line}:")
    assert str(error.value).startswith(where)
    assert "Correct the " in str(error.value)


def test_the_cause_is_chained(folder):
    change("H.txt", "1 2 3\n2 4 6\n0 0 1\n")(folder)
    with pytest.raises(InputError) as error:
        read_sequence(folder, "tiny", SETTINGS)
    assert isinstance(error.value.__cause__, ValueRuleError)


def test_a_map_up_to_the_horizon_is_refused(folder):
    change("H.txt", "1 0 -1\n0 2 -2\n-0.124999999 0 1\n")(folder)
    with pytest.raises(InputError, match=r"map\.png: map size \[m\].*horizon"):
        read_sequence(folder, "tiny", SETTINGS)


def test_groups_with_a_common_member_are_one():
    groups = [{5, 4}, {1, 2}, {3, 7}, {2, 3}, {9}]
    assert merged(groups) == merged(groups[::-1]) == [{1, 2, 3, 7}, {4, 5}, {9}]


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
    with pytest.raises(ValueRuleError, match=r"margin_m.*there is no such field"):
        SOURCES["scene_folder"](example, "mine", {"margin_m": 1.0})
