"""Layouts: shapes, doors, drawn and generated rooms; rooms in which nobody can walk are refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from pedpred.errors import ValueRuleError
from pedpred.settings import load
from pedpred.simulation.arrangements import find_sealed_part
from pedpred.simulation.clutter import ClutterSettings, draw_cluttered_room
from pedpred.simulation.ground import ground_of, signed_distance
from pedpred.simulation.layouts import Layout
from pedpred.simulation.routing import routes_to
from pedpred.simulation.shapes import Door, Polygon, Wall, shape_from
from tests.simulated import CLUTTER, DRAWN, SETTINGS, asked, drawn

CIRCLE = {"center": [5, 4], "radius_m": 1.0}
RECTANGLE = {"center": [5, 4], "size_m": [3.0, 2.0]}
WALL = {"start": [2, 4], "end": [8, 4], "thickness_m": 0.3}
ACROSS = WALL | {"start": [0, 4], "end": [10, 4]}
PILLAR, FLOOR = {"circle": CIRCLE}, {"rectangle": RECTANGLE}
CORNER = {"circle": {"center": [1, 1], "radius_m": 0.7}}
WIDE = {"at_m": 2.0, "width_m": 1.6}
BOW_TIE = [[2, 2], [6, 6], [6, 2], [2, 6]]
CLOSET = [  # 3 m x 2 m in the corner, closed by two walls
    {"wall": {"start": [0, 2], "end": [3, 2], "thickness_m": 0.2}},
    {"wall": {"start": [3, 0], "end": [3, 2], "thickness_m": 0.2}},
]


def connected_parts(distance, clearance_m):
    """How many separate parts the cells with some clearance form."""
    return ndimage.label(distance >= clearance_m)[1]


# Shapes


@pytest.mark.parametrize(
    ("shape", "area_m2"),
    [
        ({"rectangle": RECTANGLE | {"angle_deg": 30}}, 6.0),
        ({"circle": CIRCLE | {"radius_m": 1.5}}, np.pi * 1.5**2),
        ({"polygon": {"corners": [[2, 2], [8, 2], [5, 6]]}}, 12.0),
        ({"wall": WALL | {"doors": [{"at_m": 2, "width_m": 1}]}}, (6 - 1) * 0.3 + np.pi * 0.15**2),
    ],
)
def test_a_shape_covers_its_area(shape, area_m2):
    empty, filled = (Layout((10, 8), shapes).occupancy() for shapes in ((), (shape_from(shape, "shape"),)))
    assert 0.01 * (filled.occupied.sum() - empty.occupied.sum()) == pytest.approx(area_m2, rel=0.07)


def test_polygons_may_have_inner_corners():
    comb = [[0, 0], [5, 0], [5, 3], [4, 3], [4, 1], [3, 1], [3, 3], [2, 3], [2, 1], [1, 1], [1, 3], [0, 3]]
    covered = Polygon(comb).covers(np.array([[0.5, 2.0], [1.5, 2.0], [2.5, 2.0]]))
    assert covered.tolist() == [True, False, True]


@given(st.floats(0.0, 360.0), st.floats(0.5, 5.5), st.floats(0.3, 1.0))
def test_a_door_opens_its_width_and_leaves_the_rest(angle_deg, at_m, width_m):
    along = np.array([np.cos(np.deg2rad(angle_deg)), np.sin(np.deg2rad(angle_deg))])
    start = np.array([1.0, -2.0])
    wall = Wall(start, start + 6.0 * along, 0.3, [Door(at_m, width_m)])
    places = np.linspace(0.0, 6.0, 241)
    opened = ~wall.covers(start + places[:, None] * along)
    expected = np.abs(places - at_m) < 0.5 * width_m
    undecided = np.abs(np.abs(places - at_m) - 0.5 * width_m) < 1e-6
    np.testing.assert_array_equal(opened[~undecided], expected[~undecided])


def test_the_world_origin_is_the_lower_left_free_corner():
    occupancy = Layout((10.0, 8.0)).occupancy()
    assert not occupancy.is_occupied([[0.05, 0.05], [9.95, 7.95]]).any()
    assert occupancy.is_occupied([[-0.05, 0.05], [10.05, 4.0], [5.0, 8.05]]).all()


# Rooms


@pytest.mark.parametrize("name", sorted(DRAWN))
def test_shipped_layouts_are_closed_and_connected(name):
    occupied = drawn(name).occupancy().occupied
    assert all(edge.all() for edge in (occupied[0], occupied[-1], occupied[:, 0], occupied[:, -1]))
    assert connected_parts(signed_distance(occupied, 0.1), SETTINGS.crowd.clearance_m) == 1


def test_generated_rooms_are_connected_and_differ():
    how = load(ClutterSettings, CLUTTER)
    maps = [draw_cluttered_room(how, np.random.default_rng(seed)).occupancy() for seed in range(4)]
    for occupancy in maps:
        distance = signed_distance(occupancy.occupied, occupancy.resolution_m)
        assert connected_parts(distance, CLUTTER["clearance_m"] - 1e-9) == 1
    assert len({occupancy.occupied.tobytes() for occupancy in maps}) == len(maps)


# Refused


def den(*shapes, **changes):
    """A configuration with a room of 10 m x 8 m."""
    return {"size_m": [10, 8], "shapes": list(shapes), **changes}


def refused(plain, **scene):
    """The error for a data set with two rooms, in the second of which these people should walk."""
    usual = {"drawn": ["columns", "den"], "generated": 0, "seed": 1, "pedestrians": 20, "hours": 0.01}
    with pytest.raises(ValueRuleError) as caught:
        asked(usual | scene, {**DRAWN, "den": plain})
    return caught.value


@pytest.mark.parametrize(
    ("plain", "field"),
    [
        (den({"circle": CIRCLE | {"radius_m": -1.0}}), "shapes[0].circle.radius_m"),
        (den({"wall": WALL | {"end": [2, 4]}}), "shapes[0].wall.end"),
        (den({"polygon": {"corners": BOW_TIE}}), "shapes[0].polygon.corners"),
        (den({"circle": CIRCLE | {"radius_m": 50}}), "shapes"),
        (den(PILLAR, *CLOSET), "shapes[1].wall"),
        (den({"wall": ACROSS}), "shapes[0].wall"),
        (den(*CLOSET, target_regions=[PILLAR, CORNER]), "target_regions[1].circle"),
        (den({"wall": WALL | {"doors": [{"at_m": 6.5, "width_m": 1.6}]}}), "shapes[0].wall.doors[0]"),
        (den({"wall": WALL | {"doors": [WIDE, WIDE]}}), "shapes[0].wall.doors[1]"),
    ],
)
def test_a_room_nobody_can_walk_in_is_refused_by_field(plain, field):
    assert refused(plain).field.endswith(f"den.{field}")


def test_a_set_that_cannot_be_simulated_is_refused():
    assert refused(den(), drawn=["attic"]).field == "drawn"
    assert refused(den(), drawn=[], generated=2, pedestrians=900).field == "pedestrians"


@settings(max_examples=25)
@given(st.floats(0.2, 2.5))
def test_what_is_admitted_is_reached_by_routes(width_m):
    room = Layout((8.0, 6.0), [Wall([4.0, 0.0], [4.0, 6.0], 0.3, [Door(3.03, width_m)])])
    ground = ground_of(room.occupancy())
    reached = (routes_to([[7.0, 1.0]], ground, SETTINGS.routing).direction[0] != 0).any(axis=-1)
    start = np.floor((np.array([1.0, 1.0]) - ground.origin) / SETTINGS.routing.resolution_m).astype(int)
    area_m2, _ = find_sealed_part(ground, SETTINGS.routing)
    assert (area_m2 == 0.0) == reached[tuple(start)]
    assert area_m2 == 0.0 or area_m2 == pytest.approx(3.85 * 6.0, rel=0.15)  # but for corners
