"""Maps are read as nav2_map_server reads them: modes, thresholds, pixels, paths and dialects of YAML."""

import math

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from pedpred.command.maps import map_at
from pedpred.errors import InputError
from pedpred.geometry import rotate
from pedpred.storage.maps import read_map, read_map_file
from pedpred.storage.pixels import blocked_cells, blocked_greys

ABOUT = {
    "image": "plain.png",
    "resolution": 0.1,
    "origin": [-5.0, 2.0, 0.0],
    "negate": 0,
    "occupied_thresh": 0.65,
    "free_thresh": 0.196,
}
GREY = np.array([[0, 100, 255], [205, 60, 254]], np.uint8)
"""Of a small map: the dark cells 0 and 60 are blocked, as is 100 for nobody (its p is 0.61)."""


def blocked(grey):
    """Cells [X, Y] of a picture whose dark pixels are blocked."""
    return (grey < 80)[::-1].T


def write(folder, picture=None, name="plain.png", **changed):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    (picture or Image.fromarray(GREY)).save(folder / name)
    (folder / "map.yaml").write_text(yaml.safe_dump(ABOUT | changed))
    return folder / "map.yaml"


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


@pytest.mark.parametrize("mode", ["trinary", "scale"])
@pytest.mark.parametrize(
    ("negate", "tenths"),
    [(False, 6), (False, 8), (False, 10), *((True, tenths) for tenths in (2, 4, 6, 8, 10))],
)
def test_a_grey_at_the_threshold_is_occupied(mode, negate, tenths):
    """Such thresholds are greys in single precision too."""
    at = 51 * tenths // 2 if negate else 255 - 51 * tenths // 2
    found = blocked_greys(mode, negate, tenths / 10, 0.0)
    assert found[at]
    if mode == "trinary":
        assert found.sum() == (256 - at if negate else at + 1)


def test_what_is_free_and_occupied_at_once_is_free():
    assert not blocked_greys("trinary", False, 0.3, 1.0).any()


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
        (lambda: Image.fromarray(GREYS), "x.png"),
        (lambda: Image.fromarray(GREYS), "x.pgm"),
        (lambda: Image.fromarray(GREYS), "x.bmp"),
        (lambda: Image.fromarray(GREYS.astype(np.uint16) * 257), "x.png"),
        (lambda: Image.fromarray(GREYS.astype(np.int32) * 257), "x.pgm"),
        (lambda: Image.fromarray(GREYS).convert("RGB"), "x.ppm"),
        (lambda: Image.fromarray(GREYS).convert("RGB"), "x.bmp"),
        (lambda: Image.fromarray(GREYS).convert("RGBA"), "x.png"),
        (lambda: Image.fromarray(GREYS).convert("LA"), "x.png"),
        (lambda: Image.fromarray(DARK ^ True), "x.png"),
        (lambda: Image.fromarray(DARK ^ True), "x.pbm"),
        (palette, "x.png"),
        (palette, "x.bmp"),
        (lambda: Image.fromarray(GREYS), "x.tif"),
        (lambda: Image.fromarray(GREYS.astype(np.uint16) * 257), "x.tiff"),
        (lambda: Image.fromarray(DARK ^ True), "x.tiff"),
        (lambda: Image.fromarray(GREYS).convert("RGBA"), "x.tiff"),
        (palette, "x.tif"),
    ],
)
def test_any_depth_and_any_kind_of_pixels_is_the_same_map(image, name, tmp_path):
    path = write(tmp_path, image(), name, image=name, occupied_thresh=1 - 79 / 255 - 1e-4)
    np.testing.assert_array_equal(read_map_file(path).occupied, DARK[::-1].T)


def test_a_colour_counts_by_the_mean_of_its_channels(tmp_path):
    colours = np.array([[[240, 0, 0], [0, 240, 0], [0, 0, 240], [240, 240, 0]]], np.uint8)
    path = write(tmp_path, Image.fromarray(colours), occupied_thresh=0.65)
    assert read_map_file(path).occupied[:, 0].tolist() == [True, True, True, False]


@pytest.mark.parametrize(
    ("mode", "expected"), [("trinary", [1, 0, 0]), ("scale", [1, 0, 0]), ("raw", [0, 0, 0])]
)
def test_what_is_transparent_is_unknown(mode, expected, tmp_path):
    """Black that is opaque, nearly opaque and transparent, in every form that PNG has."""
    alpha = np.array([[255, 254, 0]], np.uint8)
    black = np.zeros_like(alpha)
    layers = {"LA": [black, alpha], "RGBA": [black, black, black, alpha]}
    for name, channels in layers.items():
        image = Image.merge(name, list(map(Image.fromarray, channels)))
        assert read_map_file(write(tmp_path, image, mode=mode)).occupied[:, 0].tolist() == expected


def test_a_transparent_grey_and_palette_entry_are_unknown(tmp_path):
    for kind in (np.uint8, np.uint16):
        Image.fromarray(np.array([[0, 7]], kind)).save(tmp_path / "plain.png", transparency=7)
        (tmp_path / "map.yaml").write_text(yaml.safe_dump(ABOUT))
        assert read_map(tmp_path).occupied[:, 0].tolist() == [True, False]
    image = Image.fromarray(np.array([[0, 7]], np.uint8)).convert("P")
    image.save(tmp_path / "plain.png", transparency=7)
    assert read_map(tmp_path).occupied[:, 0].tolist() == [True, False]


def test_raw_reads_percentages_and_looks_at_no_transparency(tmp_path):
    greys = np.array([[0, 50, 51, 100, 101, 255]], np.uint8)
    image = Image.merge("LA", [Image.fromarray(greys), Image.fromarray(greys)])
    (tmp_path / "map.yaml").write_text("image: plain.png\nmode: RAW\nresolution: 1\norigin: [0, 0, 0]\n")
    image.save(tmp_path / "plain.png")
    assert read_map(tmp_path).occupied[:, 0].tolist() == [False, False, True, True, False, False]


def test_a_large_picture_is_read_in_blocks_of_rows():
    rng = np.random.default_rng(0)
    grey = rng.integers(0, 256, (1500, 1500), dtype=np.uint8)
    greys = np.arange(256) < 80
    np.testing.assert_array_equal(blocked_cells(Image.fromarray(grey), greys, "trinary"), grey < 80)


@pytest.mark.parametrize("kind", [np.int32, np.float32])
def test_a_tiff_whose_range_is_unknown_is_refused(kind, tmp_path):
    path = write(tmp_path, Image.fromarray(GREYS.astype(kind)), "x.tif", image="x.tif")
    with pytest.raises(InputError, match=r"x\.tif.*save the picture with 8 bits per channel"):
        read_map_file(path)


def test_fractions_are_refused(tmp_path):
    Image.fromarray(np.zeros((2, 2), np.float32)).save(tmp_path / "plain.pfm")
    (tmp_path / "map.yaml").write_text(yaml.safe_dump(ABOUT | {"image": "plain.pfm"}))
    with pytest.raises(InputError, match=r"plain\.pfm.*8 bits per channel"):
        read_map(tmp_path)


@pytest.mark.parametrize(
    ("image", "lies"),
    [
        ("plain.png", "plain.png"),
        ("./plain.png", "plain.png"),
        (".//sub/../plain.png", "plain.png"),
        ("sub/plain.png", "sub/plain.png"),
        ("./sub/deep/plain.png", "sub/deep/plain.png"),
        ("sub\\plain.png", "sub/plain.png"),
        ("/opt/maps/plain.png", "plain.png"),
        ("~/maps/plain.png", "plain.png"),
        ("C:\\Users\\me\\plain.png", "plain.png"),
        ("C:/maps/plain.png", "plain.png"),
        ("package://hall/maps/plain.png", "plain.png"),
        ("{here}/sub/plain.png", "sub/plain.png"),
        ("{here}/plain.png", "plain.png"),
        ("../{name}/plain.png", "plain.png"),
        ("a map: of, ours.png", "a map: of, ours.png"),
    ],
)
def test_a_picture_is_found_by_the_path_that_people_write(image, lies, tmp_path):
    folder = tmp_path / "maps"
    (folder / "sub").mkdir(parents=True)
    named = image.replace("{here}", str(folder)).replace("{name}", folder.name)
    path = write(folder, name=lies, image=named)
    np.testing.assert_array_equal(read_map_file(path).occupied, blocked(GREY))
    if lies == "plain.png":
        np.testing.assert_array_equal(map_at(folder / "plain.png").occupied, blocked(GREY))


def outside(folder):
    """A picture outside, and links that lead there."""
    path = write(folder / "maps", name="../plain.png", image="plain.png")
    for name in ("link.png", "round.png"):
        (path.parent / name).symlink_to("round.png" if name == "round.png" else "../plain.png")
    (path.parent / "linked").symlink_to("..")
    return path


OUTSIDE = [
    "../plain.png",
    "sub/../../plain.png",
    "link.png",
    "./link.png",
    "linked/plain.png",
    "round.png",
    "..",
    ".",
    "..\\plain.png",
    "{outside}/plain.png",
    "/etc/hostname",
    "/dev/zero",
    "missing.png",
    "x" * 5000,
    "a\0b",
    "",
    None,
    ["plain.png"],
]


@pytest.mark.parametrize("image", OUTSIDE)
def test_no_file_outside_the_folder_is_read_and_the_remedy_works(image, tmp_path):
    path = outside(tmp_path)
    if isinstance(image, str):
        image = image.replace("{outside}", str(tmp_path))
    path.write_text(yaml.safe_dump(ABOUT | {"image": image}))
    with pytest.raises(InputError, match=r"map\.yaml, image: .*image: \S+$") as error:
        read_map_file(path)
    name = str(error.value).rsplit("image: ", 1)[1]
    (path.parent / name).unlink(missing_ok=True)
    Image.fromarray(GREY).save(path.parent / name, "PNG")
    path.write_text(yaml.safe_dump(ABOUT | {"image": name}))
    np.testing.assert_array_equal(read_map_file(path).occupied, blocked(GREY))


def test_a_linked_description_brings_its_own_folder(tmp_path):
    """Build tools link both files of a map into another folder."""
    path = write(tmp_path / "source")
    installed = tmp_path / "installed"
    installed.mkdir()
    for name in ("map.yaml", "plain.png"):
        (installed / name).symlink_to(path.with_name(name))
    np.testing.assert_array_equal(read_map(installed).occupied, blocked(GREY))


PLAIN = yaml.safe_dump(ABOUT)
DIALECTS = {
    "flow": "{image: plain.png, resolution: 0.1, origin: [-5, 2, 0], negate: 0, occupied_thresh: 0.65}",
    "quoted": 'image: "plain.png"\nresolution: "0.1"\norigin: ["-5", \'2.0\', "0"]\nnegate: "0"\n'
    "occupied_thresh: '0.65'\nfree_thresh: '.196'\n",
    "exponents": PLAIN.replace("0.1\n", "1e-1\n").replace("0.65", "65e-2"),
    "whole numbers": PLAIN.replace("-5.0", "-5").replace("2.0", "2"),
    "no": PLAIN.replace("negate: 0", "negate: no"),
    "false": PLAIN.replace("negate: 0", "negate: false"),
    "mode": f"mode: Trinary\n{PLAIN}",
    "windows": f"\ufeff---\n{PLAIN}".replace("\n", "\r\n"),
    "comments": f"# made by a mapper\n{PLAIN}# unknown_thresh: 1\ncost_translation_table: [1, 2]\n",
}


@pytest.mark.parametrize("name", DIALECTS)
def test_a_dialect_of_yaml_says_the_same(name, tmp_path):
    write(tmp_path).write_text(DIALECTS[name], encoding="utf-8", newline="")
    found = read_map(tmp_path)
    np.testing.assert_array_equal(found.occupied, blocked(GREY))
    assert found.origin.tolist() == [-5, 2]
    assert found.resolution_m == 0.1


@pytest.mark.parametrize("yes", [1, True, "1", "yes", "True", "on"])
def test_negate_turns_bright_and_dark(yes, tmp_path):
    path = write(tmp_path, Image.fromarray(255 - GREY), negate=yes)
    np.testing.assert_array_equal(read_map_file(path).occupied, blocked(GREY))


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"mode": "binary"}, "mode = 'binary', expected one of trinary, scale, raw"),
        ({"mode": None}, "mode = None, expected one of trinary"),
        ({"negate": 2}, "negate = 2, but it must be 0 or 1"),
        ({"negate": 0.5}, "negate = 0.5, but"),
        ({"occupied_thresh": "65%"}, "occupied_thresh = '65%' is not a number"),
        ({"free_thresh": 19.6}, "free_thresh = 19.6, but .*percentages by 100"),
        ({"origin": [0, 0]}, "expected three numbers. Write x, y and yaw"),
        ({"origin": "0 0 0"}, "expected three numbers"),
        ({"origin": [0, "left", 0]}, "origin = 'left' is not a number"),
        ({"origin": [0, 0, 0.1]}, "only maps with yaw 0"),
        ({"resolution": True}, "resolution = True is not a number"),
        ({"resolution": 0}, "resolution_m = 0.0"),
    ],
)
def test_what_has_another_meaning_is_refused_with_what_to_write(changed, message, tmp_path):
    with pytest.raises(InputError, match=f"(?i){message}"):
        read_map_file(write(tmp_path, **changed))


@pytest.mark.parametrize("key", [*ABOUT])
def test_what_is_missing_is_named_with_what_is_usual(key, tmp_path):
    path = write(tmp_path, mode="scale")
    path.write_text(
        yaml.safe_dump({name: value for name, value in ABOUT.items() if name != key} | {"mode": "scale"})
    )
    with pytest.raises(InputError, match=f"'{key}' is missing. Add it, such as {key}: ") as error:
        read_map_file(path)
    Image.fromarray(GREY).save(tmp_path / "map.pgm")
    path.write_text(path.read_text() + str(error.value).split("such as ")[1] + "\n")
    read_map_file(path)


@pytest.mark.parametrize("name", ["map.gif", "map.webp"])
def test_a_picture_of_another_kind_is_to_be_converted(tmp_path, name):
    write(tmp_path, name=name, image=name)
    with pytest.raises(InputError, match=rf"{name}.*of another kind than PNG, .*convert it to PNG"):
        read_map(tmp_path)


@given(st.floats(-7.0, 7.0), st.sampled_from([["1"], ["L"], ["RGB"], ["RGBA"]]))
@settings(max_examples=30, deadline=None)
def test_a_yaw_turns_a_map_about_its_lower_left_corner(tmp_path_factory, yaw_rad, kind):
    """As the pose of the origin in the nav_msgs/OccupancyGrid that map_server publishes."""
    grey = np.where(np.random.default_rng(0).random((9, 14)) < 0.3, 0, 255).astype(np.uint8)
    path = write(
        tmp_path_factory.mktemp("turned"), Image.fromarray(grey).convert(*kind), origin=[3, -2, yaw_rad]
    )
    found = map_at(path)
    centres = np.argwhere(blocked(grey)) * 0.1 + 0.05
    there = np.array([3.0, -2.0]) + rotate(centres, np.full(len(centres), yaw_rad))
    assert found.occupied[tuple(found.cell_of(there).T)].all()
    drawn = found.origin + (np.argwhere(found.occupied) + 0.5) * found.resolution_m
    apart = np.linalg.norm(drawn[:, None] - there, axis=-1)
    assert apart.min(axis=1).max() < 0.15


def test_a_quarter_turn_keeps_the_cells_of_a_map(tmp_path):
    for turns in range(-3, 4):
        path = write(tmp_path / str(turns), origin=[0, 0, turns * math.pi / 2])
        np.testing.assert_array_equal(map_at(path).occupied, np.rot90(blocked(GREY), turns))
        assert map_at(path.parent).occupied.sum() == map_at(path.with_name("plain.png")).occupied.sum()


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"origin": [0, 0, math.inf]}, "yaw = inf, but it must be finite"),
        ({"resolution": True}, "resolution = True is not a number"),
        ({"image": "elsewhere.png"}, "is no file in the folder"),
    ],
)
def test_what_is_wrong_with_a_turned_map_is_said(changed, message, tmp_path):
    with pytest.raises(InputError, match=message):
        map_at(write(tmp_path, **{"origin": [0, 0, 0.3]} | changed))


def test_a_yaw_in_degrees_is_noticed(tmp_path):
    with pytest.raises(InputError, match=r"yaw = 90 rad is more than two turns: is it in degrees\?.*radians"):
        map_at(write(tmp_path, origin=[0.0, 0.0, 90]))
    assert map_at(write(tmp_path, origin=[0.0, 0.0, -2.0 * math.pi])).occupied.any()


def test_thresholds_that_look_exchanged_are_warned_about(tmp_path, caplog):
    map_at(write(tmp_path, occupied_thresh=0.2, free_thresh=0.65))
    assert "free_thresh 0.65 is above occupied_thresh 0.2: cells between are free" in caplog.text


def test_a_folder_without_map_yaml_says_which_maps_it_has(tmp_path):
    write(tmp_path).rename(tmp_path / "floor.yaml")
    with pytest.raises(
        InputError, match=r"no map.yaml in the folder, only \['floor.yaml'\].*--map .*floor.yaml"
    ):
        map_at(tmp_path)
