"""Rooms in which people cannot walk are refused before simulation, by errors that name the field."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pedpred.errors import ValueRuleError
from pedpred.simulation.arrangements import find_sealed_part
from pedpred.simulation.ground import ground_of
from pedpred.simulation.layouts import Layout
from pedpred.simulation.routing import routes_to
from pedpred.simulation.settings import social_force_settings
from pedpred.simulation.shapes import Door, Polygon, Wall
from tests.simulated import DRAWN, SETTINGS, asked, scene_of, short, with_field

NAN = float("nan")
CIRCLE = {"center": [5, 4], "radius_m": 1.0}
RECTANGLE = {"center": [5, 4], "size_m": [3.0, 2.0]}
WALL = {"start": [2, 4], "end": [8, 4], "thickness_m": 0.3}
ACROSS, NARROW = WALL | {"start": [0, 4], "end": [10, 4]}, {"at_m": 5, "width_m": 0.9}
PILLAR, FLOOR = {"circle": CIRCLE}, {"rectangle": RECTANGLE}
CORNER = {"circle": {"center": [1, 1], "radius_m": 0.7}}
INVERTED, WIDE = {"circle": CIRCLE | {"radius_m": -1}}, {"at_m": 2.0, "width_m": 1.6}
BOW_TIE = [[2, 2], [6, 6], [6, 2], [2, 6]]
CLOSET = [  # 3 m x 2 m in the corner, closed by two walls
    {"wall": {"start": [0, 2], "end": [3, 2], "thickness_m": 0.2}},
    {"wall": {"start": [3, 0], "end": [3, 2], "thickness_m": 0.2}},
]


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
        (den({"circle": CIRCLE | {"radius_m": "1 m"}}), "shapes[0].circle.radius_m"),
        (den({"circle": CIRCLE | {"center": [NAN, 4]}}), "shapes[0].circle.center"),
        (den({"circle": CIRCLE | {"center": [5]}}), "shapes[0].circle.center"),
        (den({"circle": {"center": [1, 1]}}), "shapes[0].circle.radius_m"),
        (den({"circle": CIRCLE | {"radius": 1}}), "shapes[0].circle.radius"),
        (den({"circle": None}), "shapes[0].circle"),
        (den({"rectangle": RECTANGLE | {"size_m": [3, 0]}}), "shapes[0].rectangle.size_m"),
        (den(FLOOR, {"wall": WALL | {"thickness_m": 0}}), "shapes[1].wall.thickness_m"),
        (den({"wall": WALL | {"end": [2, 4]}}), "shapes[0].wall.end"),
        (den({"polygon": {"corners": [[1, 1], [2, 2]]}}), "shapes[0].polygon.corners"),
        (den({"polygon": {"corners": BOW_TIE}}), "shapes[0].polygon.corners"),
        (den({"hexagon": {}}), "shapes[0]"),
        (den({"circle": CIRCLE | {"center": [15, 4]}}), "shapes[0].circle"),
        (den(target_regions=[INVERTED]), "target_regions[0].circle.radius_m"),
        (den(size_m=[10, -8]), "size_m"),
        (den(size_m=[10, 800]), "size_m"),
        (den(shape=[]), "shape"),
        ({"shapes": []}, "size_m"),
        (den(shapes=None), "shapes"),
        (den({"circle": CIRCLE | {"radius_m": 50}}), "shapes"),
        (den(size_m=[1, 1]), "size_m"),
        (den(PILLAR, *CLOSET), "shapes[1].wall"),
        (den({"wall": ACROSS}), "shapes[0].wall"),
        (den({"wall": ACROSS | {"doors": [NARROW]}}), "shapes[0].wall"),
        (den(*CLOSET, target_regions=[PILLAR, CORNER]), "target_regions[1].circle"),
        (den(PILLAR, target_regions=[FLOOR, PILLAR]), "target_regions[1].circle"),
        (den(target_regions=[PILLAR]), "target_regions"),
        (den({"wall": WALL | {"doors": [{"at_m": 6.5, "width_m": 1.6}]}}), "shapes[0].wall.doors[0]"),
        (den({"wall": WALL | {"doors": [WIDE, WIDE]}}), "shapes[0].wall.doors[1]"),
        (den({"wall": WALL | {"doors": [{"at_m": 2.0}]}}), "shapes[0].wall.doors[0].width_m"),
        (den({"wall": WALL | {"doors": WIDE}}), "shapes[0].wall.doors"),
    ],
)
def test_a_room_that_cannot_be_walked_in_is_refused_by_its_field(plain, field):
    assert refused(plain).field.endswith(f"den.{field}")


@pytest.mark.parametrize(
    ("scene", "field"),
    [
        ({"drawn": ["attic"]}, "drawn"),
        ({"drawn": ["columns", "columns"]}, "drawn"),
        ({"drawn": []}, "drawn"),
        ({"pedestrians": 900}, "pedestrians"),
        ({"drawn": [], "generated": 2, "pedestrians": 900}, "pedestrians"),
    ],
)
def test_a_data_set_that_cannot_be_simulated_is_refused(scene, field):
    assert refused(den(), **scene).field == field


@settings(max_examples=40)
@given(st.floats(0.2, 2.5))
def test_what_is_admitted_is_reached_by_routes(width_m):
    room = Layout((8.0, 6.0), [Wall([4.0, 0.0], [4.0, 6.0], 0.3, [Door(3.03, width_m)])])
    ground = ground_of(room.occupancy())
    reached = (routes_to([[7.0, 1.0]], ground, SETTINGS.routing).direction[0] != 0).any(axis=-1)
    start = np.floor((np.array([1.0, 1.0]) - ground.origin) / SETTINGS.routing.resolution_m).astype(int)
    area_m2, _ = find_sealed_part(ground, SETTINGS.routing)
    assert (area_m2 == 0.0) == reached[tuple(start)]
    assert area_m2 == 0.0 or area_m2 == pytest.approx(3.85 * 6.0, rel=0.15)  # but for corners


def test_polygons_may_have_inner_corners():
    comb = [[0, 0], [5, 0], [5, 3], [4, 3], [4, 1], [3, 1], [3, 3], [2, 3], [2, 1], [1, 1], [1, 3], [0, 3]]
    covered = Polygon(comb).covers(np.array([[0.5, 2.0], [1.5, 2.0], [2.5, 2.0]]))
    assert covered.tolist() == [True, False, True]


def test_as_many_people_as_find_room_are_admitted_and_start():
    most = int(str(refused(den(), drawn=["columns"], pedestrians=900)).split("only ")[1].split()[0])
    at_once = social_force_settings(with_field("clock.warm_up_s", 0.0))
    scene = scene_of(short(0.3, pedestrians=most, seed=1)[0], at_once)
    assert len(np.unique(scene.trajectories.track_id)) == most
