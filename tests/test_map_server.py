"""Maps are read as nav2_map_server reads them, by whatever file users name."""

import math

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from pedpred.errors import InputError
from pedpred.geometry import rotate
from pedpred.scenes import OccupancyMap
from pedpred.scenes.turned_maps import turned_map
from pedpred.storage.maps import read_map, write_map
from pedpred.storage.pixels import blocked_cells, blocked_greys
from tests.refused import unread

ABOUT = {
    "image": "plain.png",
    "resolution": 0.1,
    "origin": [-5.0, 2.0, 0.0],
    "negate": 0,
    "occupied_thresh": 0.65,
    "free_thresh": 0.196,
}
GREY = np.array([[0, 100, 255], [205, 60, 254]], np.uint8)
"""Of a small map: the dark cells 0 and 60 are blocked; that of 100 has p = 0.61, which is unknown."""
BLOCKED = (GREY < 80)[::-1].T
"""Its cells, [X, Y]."""


def write(folder, picture=None, name="plain.png", **changed):
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    (picture or Image.fromarray(GREY)).save(folder / name)
    (folder / "map.yaml").write_text(yaml.safe_dump(ABOUT | changed))
    return folder / "map.yaml"


# Pixels


def percentage(grey, mode, negate, occupied, free):
    """The value of one cell as the comments of map_mode.hpp define it, in exact arithmetic."""
    if mode == "raw":
        return grey if grey <= 100 else -1
    p = grey / 255 if negate else 1 - grey / 255
    if p <= free:
        return 0
    if p >= occupied:
        return 100
    return -1 if mode == "trinary" else math.floor(100 * (p - free) / (occupied - free) + 0.5)


thresholds = st.tuples(st.floats(0, 1), st.floats(0, 1)).filter(lambda pair: pair[0] > pair[1] + 1e-3)


@given(st.sampled_from(["trinary", "scale", "raw"]), st.booleans(), thresholds)
def test_every_grey_in_every_mode(mode, negate, pair):
    found = blocked_greys(mode, negate, *pair)
    for grey in range(256):
        p = grey / 255 if negate else 1 - grey / 255
        scaled = 100 * (p - pair[1]) / (pair[0] - pair[1])
        near = min(abs(p - pair[0]), abs(p - pair[1])) < 1e-5 or abs(scaled - 50.5) < 1e-2
        assert near or found[grey] == (percentage(grey, mode, negate, *pair) > 50), grey


def test_a_grey_at_the_threshold_is_occupied():
    """Such thresholds are greys in single precision, too."""
    assert blocked_greys("trinary", False, 0.6, 0.0)[102]


GREYS = np.arange(256, dtype=np.uint8).reshape(8, 32)
DARK = GREYS < 80


def palette():
    """Greys behind a shuffled palette."""
    order = np.random.default_rng(0).permutation(256)
    image = Image.fromarray(np.argsort(order).astype(np.uint8)[GREYS]).convert("P")
    image.putpalette(np.repeat(order[:, None], 3, axis=1).astype(np.uint8).tobytes())
    return image


@pytest.mark.parametrize(
    ("image", "name"),
    [
        (lambda: Image.fromarray(GREYS.astype(np.uint16) * 257), "x.png"),
        (lambda: Image.fromarray(GREYS.astype(np.int32) * 257), "x.pgm"),
        (lambda: Image.fromarray(GREYS).convert("RGBA"), "x.tif"),
        (lambda: Image.fromarray(GREYS).convert("LA"), "x.png"),
        (lambda: Image.fromarray(DARK ^ True), "x.pbm"),
        (palette, "x.bmp"),
    ],
)
def test_any_depth_and_kind_of_pixels_is_the_same_map(image, name, tmp_path):
    path = write(tmp_path, image(), name, image=name, occupied_thresh=1 - 79 / 255 - 1e-4)
    np.testing.assert_array_equal(read_map(path).occupied, DARK[::-1].T)


def test_colours_count_by_their_mean_and_floats_are_refused(tmp_path):
    colours = Image.fromarray(np.array([[[240, 0, 0], [0, 240, 0], [0, 0, 240], [240, 240, 0]]], np.uint8))
    assert read_map(write(tmp_path, colours)).occupied[:, 0].tolist() == [True, True, True, False]
    path = write(tmp_path, Image.fromarray(GREYS.astype(np.float32)), "x.tif", image="x.tif")
    with unread(tmp_path / "x.tif"):
        read_map(path)


def test_transparent_pixels_are_unknown(tmp_path):
    alpha = np.array([[255, 0]], np.uint8)
    image = Image.merge("LA", [Image.fromarray(np.zeros_like(alpha)), Image.fromarray(alpha)])
    for mode, expected in (("trinary", [1, 0]), ("scale", [1, 0]), ("raw", [0, 0])):
        assert read_map(write(tmp_path, image, mode=mode)).occupied[:, 0].tolist() == expected


def test_a_large_picture_is_read_in_blocks_of_rows():
    grey = np.random.default_rng(0).integers(0, 256, (1500, 1500), dtype=np.uint8)
    greys = np.arange(256) < 80
    np.testing.assert_array_equal(blocked_cells(Image.fromarray(grey), greys, "trinary"), grey < 80)


# Files


def test_a_map_is_read_as_it_was_written(tmp_path):
    wall = OccupancyMap(BLOCKED, np.array([-3.5, 2.25]), 0.05)
    write_map(wall, tmp_path)
    found = read_map(tmp_path)
    np.testing.assert_array_equal(found.occupied, wall.occupied)
    assert (found.origin.tolist(), found.resolution_m) == (wall.origin.tolist(), wall.resolution_m)


@pytest.mark.parametrize("name", [".", "map.yaml", "map.pgm", "hall.png", "hall.yml"])
def test_a_map_is_named_by_folder_description_or_picture(name, tmp_path):
    picture = "hall.png" if name.startswith("hall") else "map.pgm"
    about = write(tmp_path, name=picture, image=picture)
    if name.startswith("hall"):
        about.rename(tmp_path / (name if name.endswith("ml") else "hall.yaml"))
    np.testing.assert_array_equal(read_map(tmp_path / name).occupied, BLOCKED)


def test_a_picture_is_found_by_the_path_that_people_write(tmp_path):
    """Also by the one that it had on the machine of which the map is."""
    for name in ("plain.png", "sub/plain.png"):
        path = write(tmp_path, name=name)
    below = "sub/plain.png", str(tmp_path / "sub/plain.png")
    for image in (*below, "/opt/maps/plain.png", "C:\\Users\\me\\plain.png"):
        path.write_text(yaml.safe_dump(ABOUT | {"image": image}))
        np.testing.assert_array_equal(read_map(path).occupied, BLOCKED)


def test_no_picture_outside_the_folder_is_read(tmp_path):
    path = write(tmp_path / "maps", name="../plain.png")
    for name, place in {"link.png": "../plain.png", "round.png": "round.png", "linked": ".."}.items():
        (path.parent / name).symlink_to(place)
    outside = ["../plain.png", "link.png", "linked/plain.png", "round.png", "..", str(tmp_path / "plain.png")]
    for image in (*outside, "/dev/zero", "missing.png", "", None):
        path.write_text(yaml.safe_dump(ABOUT | {"image": image}))
        with unread(path, "image"):
            read_map(path)


def test_a_linked_description_brings_its_own_folder(tmp_path):
    """Build tools link both files of a map into another folder."""
    path = write(tmp_path / "source")
    installed = tmp_path / "installed"
    installed.mkdir()
    for name in ("map.yaml", "plain.png"):
        (installed / name).symlink_to(path.with_name(name))
    np.testing.assert_array_equal(read_map(installed).occupied, BLOCKED)


def test_numbers_may_be_quoted_or_have_exponents(tmp_path):
    """As yaml-cpp reads them."""
    numbers = {"resolution": "1e-1", "origin": ["-5", "2.0", "0"], "free_thresh": ".196"}
    found = read_map(write(tmp_path, Image.fromarray(255 - GREY), negate=True, **numbers))
    np.testing.assert_array_equal(found.occupied, BLOCKED)
    assert (found.origin.tolist(), found.resolution_m) == ([-5, 2], 0.1)


def test_a_field_that_is_missing_or_means_another_is_named(tmp_path):
    wrong = [("mode", "binary"), ("negate", 2), ("occupied_thresh", "65%"), ("free_thresh", 19.6)]
    for field, value in (*wrong, ("origin", [0, 0, 90]), *((field, None) for field in ABOUT)):
        path = write(tmp_path)
        about = {name: text for name, text in ABOUT.items() if name != field}
        path.write_text(yaml.safe_dump(about | ({} if value is None else {field: value})))
        with unread(path, field):
            read_map(path)


def test_a_file_that_is_no_map_is_refused(tmp_path):
    (tmp_path / "x.dxf").write_text("0")
    Image.fromarray(GREY).save(tmp_path / "alone.png")
    for name in ("nowhere", "x.dxf", "alone.png"):
        with pytest.raises(InputError) as error:
            read_map(tmp_path / name)
        assert tmp_path in error.value.path.parents


# Turned maps


@given(st.floats(-7.0, 7.0), st.integers(0, 2**32))
@settings(max_examples=50)
def test_a_turned_map_has_its_walls_where_they_are(yaw_rad, seed):
    """The middle of each blocked cell stays blocked, and nothing else than what it touches is."""
    straight = OccupancyMap(np.random.default_rng(seed).random((9, 14)) < 0.3, np.array([3.0, -2.0]), 0.1)
    found = turned_map(straight, yaw_rad)
    middles = straight.center_of(np.argwhere(straight.occupied)) - straight.origin
    there = straight.origin + rotate(middles, np.full(len(middles), yaw_rad))
    assert found.is_occupied(there).all()
    apart = np.linalg.norm(found.center_of(np.argwhere(found.occupied))[:, None] - there, axis=-1)
    assert not apart.size or apart.min(axis=1).max() < 0.15


def test_a_quarter_turn_keeps_the_cells_of_a_map(tmp_path):
    for turns in range(-1, 3):
        path = write(tmp_path, origin=[0, 0, turns * math.pi / 2])
        np.testing.assert_array_equal(read_map(path).occupied, np.rot90(BLOCKED, turns))
