"""Rooms in which people cannot walk are refused before simulation, by errors that name the field."""

import re

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
INVERTED, NO_WAY = {"circle": CIRCLE | {"radius_m": -1}}, "people cannot get there"
BOW_TIE = [[2, 2], [6, 6], [6, 2], [2, 6]]
CLOSET = [  # 3 m x 2 m in the corner, closed by two walls
    {"wall": {"start": [0, 2], "end": [3, 2], "thickness_m": 0.2}},
    {"wall": {"start": [3, 0], "end": [3, 2], "thickness_m": 0.2}},
]


def den(*shapes, **changes):
    """A configuration with a room of 10 m x 8 m."""
    return {"size_m": [10, 8], "shapes": list(shapes), **changes}


def asked_for(plain, **scene):
    """What a data set is refused for in whose second room these people should walk."""
    usual = {"drawn": ["columns", "den"], "generated": 0, "seed": 1}
    scene = {**usual, "pedestrians": 20, "hours": 0.01, **scene}
    with pytest.raises(ValueRuleError) as caught:
        asked(scene, {**DRAWN, "den": plain})
    return str(caught.value)


@pytest.mark.parametrize(
    ("plain", "key", "rule"),
    [
        (den({"circle": {**CIRCLE, "radius_m": -1.0}}), "shapes[0].circle.radius_m = -1.0", "positive"),
        (den({"circle": {**CIRCLE, "radius_m": 0}}), "shapes[0].circle.radius_m = 0", "positive"),
        (den({"circle": {**CIRCLE, "radius_m": "1 m"}}), "circle.radius_m = '1 m", "a finite number"),
        (den({"circle": {**CIRCLE, "center": [NAN, 4]}}), "circle.center = [nan, 4]", "finite numbers"),
        (den({"circle": {**CIRCLE, "center": [5]}}), "circle.center = [5]", "of shape (2,)"),
        (den({"circle": {"center": [1, 1]}}), "circle.radius_m = None", "it is missing"),
        (den({"circle": {**CIRCLE, "radius": 1}}), "circle.radius = 1", "are center, radius_m"),
        (den({"circle": None}), "shapes[0].circle = None", "are center, radius_m"),
        (den({"rectangle": {**RECTANGLE, "size_m": [3, 0]}}), "rectangle.size_m = [3, 0]", "positive"),
        (den({"rectangle": {**RECTANGLE, "angle_deg": NAN}}), "rectangle.angle_deg = nan", "finite"),
        (den(FLOOR, {"wall": WALL | {"thickness_m": 0}}), "shapes[1].wall.thickness_m", "positive"),
        (den({"wall": {**WALL, "end": [2, 4]}}), "wall.end = [2, 4]", "the start of the wall"),
        (den({"polygon": {"corners": [[1, 1], [2, 2]]}}), "polygon.corners", "at least three"),
        (den({"polygon": {"corners": BOW_TIE}}), "polygon.corners", "cross"),
        (den({"polygon": {"corners": [[1, 1], [2], [3, 1]]}}), "polygon.corners", "of shape"),
        (den({"hexagon": {}}), "shapes[0] = {'hexagon': {}}", "one of rectangle, circle, polygon, wall"),
        (den("circle"), "shapes[0] = 'circle", "write one of"),
        (den({"circle": CIRCLE | {"center": [15, 4]}}), "shapes[0].circle", "between (0, 0) and (10, 8)"),
        (den(target_regions=[INVERTED]), "target_regions[0].circle.radius_m", "positive"),
        (den(size_m=[10, -8]), "size_m = [10, -8]", "positive"),
        (den(size_m=[10, 800]), "size_m = [10, 800]", "200.0 m"),
        (den(size_m=10), "size_m = 10", "of shape (2,)"),
        (den(shape=[]), "den.shape = []", "are size_m, shapes, target_regions"),
        ({"shapes": []}, "den.size_m = None", "it is missing"),
        (den(shapes=None), "den.shapes = None", "a list is needed"),
        (None, "den = None", "are size_m, shapes"),
    ],
)
def test_a_drawing_that_is_not_understood_is_named(plain, key, rule):
    message = asked_for(plain)
    assert "den" in message
    assert key in message
    assert rule in message.split(", but ", 1)[1]


@pytest.mark.parametrize(
    ("doors", "key", "rule"),
    [
        ([{"at_m": 6.5, "width_m": 1.6}], "doors[0]", "within the wall's 6.00 m"),
        ([{"at_m": 0.5, "width_m": 1.6}], "doors[0]", "within the wall's 6.00 m"),
        ([{"at_m": 2.0, "width_m": 1.6}, {"at_m": 3.0, "width_m": 1.6}], "doors[1]", "overlap"),
        ([{"at_m": 2.0, "width_m": 0.0}], "doors[0].width_m = 0.0", "positive"),
        ([{"at_m": 2.0}], "doors[0].width_m = None", "missing"),
        ([{"at_m": NAN, "width_m": 1.0}], "doors[0].at_m = nan", "finite"),
        ({"at_m": 2.0, "width_m": 1.6}, "doors = {'at_m", "a list is needed"),
    ],
)
def test_a_door_that_does_not_fit_its_wall_is_named(doors, key, rule):
    message = asked_for(den({"wall": {**WALL, "doors": doors}}))
    assert f"den.shapes[0].wall.{key}" in message
    assert rule in message


@pytest.mark.parametrize(
    ("plain", "key", "rule"),
    [
        (den({"circle": {**CIRCLE, "radius_m": 50}}), "shapes", "no free ground"),
        (den(size_m=[1, 1]), "size_m", "no free ground"),
        (den(PILLAR, *CLOSET), "shapes[1].wall", "it closes off"),
        (den({"wall": ACROSS}), "shapes[0].wall", "it closes off"),
        (den({"wall": ACROSS | {"doors": [NARROW]}}), "shapes[0].wall", "an opening wider than 1.2 m"),
        (den(*CLOSET, target_regions=[PILLAR, CORNER]), "target_regions[1].circle", NO_WAY),
        (den(PILLAR, target_regions=[FLOOR, PILLAR]), "target_regions[1].circle", NO_WAY),
        (den(target_regions=[PILLAR]), "target_regions", "draw a second one"),
    ],
)
def test_a_room_in_which_people_cannot_walk_everywhere_is_named(plain, key, rule):
    message = asked_for(plain)
    assert f"den.{key} = " in message
    assert rule in message


def test_the_wall_that_seals_a_room_is_named_among_the_furniture():
    rooms = den(PILLAR, {"circle": {"center": [0.4, 0.4], "radius_m": 0.4}}, *CLOSET)
    assert "shapes[2].wall" in asked_for(rooms)
    double = den(*CLOSET, *({"wall": {**wall["wall"], "thickness_m": 0.3}} for wall in CLOSET))
    assert "den.shapes =" in asked_for(double)  # no wall alone is to blame


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


def test_polygons_may_have_edges_along_one_line_and_inner_corners():
    comb = [[0, 0], [5, 0], [5, 3], [4, 3], [4, 1], [3, 1], [3, 3], [2, 3], [2, 1], [1, 1], [1, 3], [0, 3]]
    covered = Polygon(comb).covers(np.array([[0.5, 2.0], [1.5, 2.0], [2.5, 2.0]]))
    assert covered.tolist() == [True, False, True]


@pytest.mark.parametrize("name", ["columns", "room001"])
def test_more_people_than_fit_are_refused_before_any_room_is_simulated(name):
    scene = {"drawn": ["columns"] if name == "columns" else [], "generated": 2}
    message = asked_for(den(), **scene, pedestrians=900)
    assert re.search(r"pedestrians = 900, but only \d+ fit", message)


def test_a_room_with_one_place_to_walk_to_is_refused():
    message = asked_for(den(size_m=[1.6, 1.6]), pedestrians=1)
    assert "rooms.den.size_m = [1.6, 1.6], but it is too small" in message


def test_as_many_people_as_find_room_are_admitted_and_start():
    most = int(asked_for(den(), drawn=["columns"], pedestrians=900).split("only ")[1].split()[0])
    at_once = social_force_settings(with_field("clock.warm_up_s", 0.0))
    scene = scene_of(short(0.3, pedestrians=most, seed=1)[0], at_once)
    assert len(np.unique(scene.trajectories.track_id)) == most


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        ({"drawn": ["attic"]}, "drawn = 'attic', but there is no such layout"),
        ({"drawn": ["columns", "columns"]}, "the names of rooms must differ"),
        ({"drawn": []}, "name a layout"),
    ],
)
def test_a_data_set_that_cannot_be_simulated_is_named(scene, message):
    assert message in asked_for(den(), **scene)
