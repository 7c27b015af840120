"""Layouts from dictionaries, and the rooms of the clutter generator."""

import numpy as np
import pytest

from pedpred.errors import ConfigError
from pedpred.simulation.arrangements import arrangements
from pedpred.simulation.clutter import clutter_settings, cluttered_room
from pedpred.simulation.ground import ground_of, signed_distance
from pedpred.simulation.layouts import Layout, layout_from
from pedpred.simulation.places import connected_parts, drawn_targets
from tests.simulated import CLUTTER, DRAWN, SETTINGS, drawn, read, short


def room_maps(seeds):
    settings = clutter_settings(CLUTTER)
    return [cluttered_room(settings, np.random.default_rng(seed)).occupancy() for seed in seeds]


@pytest.mark.parametrize(
    ("shape", "area_m2"),
    [
        ({"rectangle": {"center": [5, 4], "size_m": [3, 2], "angle_deg": 30}}, 6.0),
        ({"circle": {"center": [5, 4], "radius_m": 1.5}}, np.pi * 1.5**2),
        ({"polygon": {"corners": [[2, 2], [8, 2], [5, 6]]}}, 12.0),
        ({"wall": {"start": [2, 2], "end": [6, 2], "thickness_m": 0.4}}, 4 * 0.4 + np.pi * 0.2**2),
    ],
)
def test_a_shape_covers_its_area(shape, area_m2):
    empty, filled = (Layout((10, 8), shapes).occupancy() for shapes in ((), (shape,)))
    assert 0.01 * (filled.occupied.sum() - empty.occupied.sum()) == pytest.approx(area_m2, rel=0.04)


@pytest.mark.parametrize("name", sorted(DRAWN))
def test_shipped_layouts_are_closed_and_connected(name):
    occupancy = drawn(name).occupancy()
    for edge in (
        occupancy.occupied[0],
        occupancy.occupied[-1],
        occupancy.occupied[:, 0],
        occupancy.occupied[:, -1],
    ):
        assert edge.all()
    assert connected_parts(signed_distance(occupancy.occupied, 0.1), SETTINGS.crowd.clearance_m) == 1


def test_the_world_origin_is_the_lower_left_corner_of_the_free_room():
    occupancy = Layout((10.0, 8.0)).occupancy()
    assert not occupancy.is_occupied([[0.05, 0.05], [9.95, 7.95]]).any()
    assert occupancy.is_occupied([[-0.05, 0.05], [10.05, 4.0], [5.0, 8.05]]).all()


def test_corridor_targets_lie_at_its_two_ends():
    layout = drawn("corridor")
    pool = drawn_targets(layout, ground_of(layout.occupancy()), SETTINGS.crowd, np.random.default_rng(0))
    assert set(pool.region) == {0, 1}
    assert np.abs(pool.position[:, 0] - 10.0).min() > 7.5


def test_generated_rooms_are_connected_and_differ():
    maps = room_maps(range(6))
    for occupancy in maps:
        distance = signed_distance(occupancy.occupied, occupancy.resolution_m)
        assert connected_parts(distance, CLUTTER["clearance_m"] - 1e-9) == 1
    assert len({occupancy.occupied.tobytes() for occupancy in maps}) == len(maps)


def test_a_room_depends_on_its_generator_state_only():
    first, again = room_maps([3]), room_maps([3])
    np.testing.assert_array_equal(first[0].occupied, again[0].occupied)


def test_no_test_room_is_a_training_room():
    settings, rooms = clutter_settings(CLUTTER), {}
    for key in ("main", "sim_test"):
        scene = {**read(f"scenes/{key}"), "generated": 6}
        todo = arrangements(scene, DRAWN, CLUTTER)
        layouts = [a.layout or cluttered_room(settings, a.rng()) for a in todo]
        rooms[key] = {layout.occupancy().occupied.tobytes() for layout in layouts}
    assert not rooms["main"] & rooms["sim_test"]


def test_arrangements_share_the_hours():
    todo = short(60.0, generated=3)
    assert [a.name for a in todo] == ["columns", "room000", "room001", "room002"]
    assert {round(a.duration_s, 6) for a in todo} == {60.0}


@pytest.mark.parametrize(
    ("plain", "message"),
    [
        ({"size_m": [10, 8], "shape": []}, "layouts.den.shape"),
        ({"shapes": []}, "layouts.den.size_m"),
        ({"size_m": [10, -8]}, "size_m"),
        ({"size_m": [10, 8], "shapes": [{"hexagon": {}}]}, r"shapes\[0\].*hexagon"),
        ({"size_m": [10, 8], "shapes": [{"circle": {"center": [1, 1]}}]}, r"shapes\[0\].circle.*radius_m"),
        ({"size_m": [10, 8], "shapes": [{"circle": {"center": [5, 4], "radius_m": 50}}]}, "no free ground"),
    ],
)
def test_a_bad_layout_is_named(plain, message):
    with pytest.raises(ConfigError, match=message):
        layout_from(plain, "layouts.den")


def test_an_unknown_layout_and_source_are_named():
    with pytest.raises(ConfigError, match="drawn' = 'den'"):
        short(3.0, drawn=["den"])
    with pytest.raises(ConfigError, match="source' = 'ewap'"):
        short(3.0, source="ewap")
