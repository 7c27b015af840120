"""Geometries of JuPedSim as lines with doors, and as WKT: walls where they are drawn, doors open."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pedpred.errors import InputError
from pedpred.reading.geometry import Geometry, occupancy_of, read_walls
from pedpred.reading.geometry.raster import cut_doors
from tests.refused import refused

CELL_M = 0.1
ROOM = [[0, 0], [10, 0], [10, 4], [0, 4], [0, 0]]
DOOR = [[10, 1.5], [10, 2.5]]
WALLS = [[[0, 0], [10, 0]], [[0, 4], [10, 4]], [[0, 0], [0, 4]], [[10, 0], [10, 1.5]], [[10, 2.5], [10, 4]]]
SQUARE = [[4, 1], [5, 1], [5, 2], [4, 2], [4, 1]]
HALL = "POLYGON ((0 0, 10 0, 10 4, 0 4, 0 0), (4 1, 5 1, 5 2, 4 2, 4 1))"


def drawn(polygons, element="polygon"):
    rows = ("".join(f'<vertex px="{x}" py="{y}"/>' for x, y in polygon) for polygon in polygons)
    return "".join(f"<{element}>{row}</{element}>" for row in rows)


def xml(subrooms, obstacles=(), crossings=(), transitions=()):
    rooms = "".join(f'<subroom id="{number}">{drawn(room)}</subroom>' for number, room in enumerate(subrooms))
    tables = "".join(f"<obstacle>{drawn(table)}</obstacle>" for table in obstacles)
    inner = f"<crossings>{drawn(crossings, 'crossing')}</crossings>"
    outer = f"<transitions>{drawn(transitions, 'transition')}</transitions>"
    rooms = rooms.replace("</subroom>", f"{tables}</subroom>", 1)
    return f'<geometry unit="m"><rooms><room id="0">{rooms}{inner}</room></rooms>{outer}</geometry>'


def map_of(folder, text, ends=()):
    path = folder / ("hall.xml" if text.lstrip().startswith("<") else "hall.wkt")
    path.write_text(text)
    return occupancy_of(read_walls(path), CELL_M, 1.0, ends, 2.0)


def along(polygons, step=0.02):
    """Points on the edges of polygons. [M, 2]."""
    edges = [(np.array(a), np.array(b)) for polygon in polygons for a, b in pairwise(polygon)]
    return np.concatenate(
        [a + np.linspace(0, 1, 2 + int(np.hypot(*(b - a)) / step))[:, None] * (b - a) for a, b in edges]
    )


def assert_room_with_a_door(occupancy):
    assert occupancy.is_occupied(along(WALLS) + 1e-6).all()
    assert occupancy.is_occupied(along(WALLS) - 1e-6).all()
    x, y = np.meshgrid(np.linspace(0.2, 9.8, 50), np.linspace(0.2, 3.8, 20))
    assert not occupancy.is_occupied(np.stack([x, y], axis=-1)).any()
    assert not occupancy.is_occupied(along([[[9, 2], [10.9, 2]], [[10, 1.7], [10, 2.3]]])).any()
    assert (occupancy.extent_m > [11.9, 5.9]).all()


# Lines and doors


@pytest.mark.parametrize(
    "text",
    [
        xml([WALLS]),
        xml([[[DOOR[1], *ROOM[2:4], [0, 0], [10, 0], DOOR[0]]]], transitions=[DOOR]),
        xml([[ROOM]], transitions=[DOOR]),
        "GEOMETRYCOLLECTION (LINESTRING (10 2.5, 10 4, 0 4, 0 0), MULTILINESTRING ((0 0, 10 0, 10 1.5)))",
    ],
)
def test_walls_that_are_lines_stand_and_their_doors_are_open(text, tmp_path):
    assert_room_with_a_door(map_of(tmp_path, text))


def test_an_open_end_opens_a_line(tmp_path):
    closed = xml([[ROOM[:3], ROOM[2:]]])
    assert_room_with_a_door(map_of(tmp_path, closed, [DOOR]))
    with refused("open_ends"):
        map_of(tmp_path, closed, [[[5, 1], [5, 2]]])


def test_two_rooms_share_a_wall_that_a_crossing_opens(tmp_path):
    other = [[10, 0], [20, 0], [20, 4], [10, 4], [10, 0]]
    occupancy = map_of(tmp_path, xml([[ROOM], [other]], crossings=[DOOR]))
    assert_room_with_a_door(occupancy)
    assert occupancy.is_occupied(along([other[:3], other[2:4]])).all()


@given(st.permutations(range(4)), st.lists(st.booleans(), min_size=4, max_size=4))
def test_an_obstacle_drawn_by_its_edges_is_filled(tmp_path_factory, order, turned):
    folder = tmp_path_factory.getbasetemp()
    edges = [SQUARE[number : number + 2][:: -1 if turned[number] else 1] for number in order]
    plain = map_of(folder, xml([[ROOM]], obstacles=[[SQUARE]]))
    assert plain.is_occupied(np.array([4.5, 1.5]))
    for pieces in (edges, [SQUARE[:3], SQUARE[2:]], [SQUARE[:-1]]):
        found = map_of(folder, xml([[ROOM]], obstacles=[pieces]))
        np.testing.assert_array_equal(found.occupied, plain.occupied)


coordinates = st.floats(-3, 3).map(lambda value: round(value, 3))
points = st.tuples(coordinates, coordinates)


@given(st.lists(st.tuples(points, points), min_size=1, max_size=4), st.sampled_from([0.05, 0.1, 0.37]))
def test_a_line_blocks_the_cells_that_it_touches_and_no_others(lines, resolution_m):
    lines = np.array(lines)
    occupancy = occupancy_of(Geometry(lines=lines), resolution_m, 0.5)
    assert occupancy.is_occupied(along(lines, resolution_m / 7)).all()
    centres = occupancy.center_of(np.argwhere(occupancy.occupied))
    start, step = lines[:, 0], lines[:, 1] - lines[:, 0]
    square = np.maximum((step**2).sum(axis=-1), 1e-12)
    share = np.clip(((centres[:, None] - start) * step).sum(axis=-1) / square, 0, 1)
    away = np.linalg.norm(centres[:, None] - start - share[..., None] * step, axis=-1).min(axis=1)
    assert (away <= resolution_m * (np.sqrt(0.5) + 1e-4)).all()


@given(st.floats(0, 6.3), st.tuples(st.floats(0.1, 4.4), st.floats(0.1, 4.4)), st.booleans())
def test_a_door_takes_its_length_from_a_wall_at_any_angle(turn_rad, ends, turned):
    direction = np.array([np.cos(turn_rad), np.sin(turn_rad)])
    door = direction * np.array(ends)[:, None]
    wall = np.array([[0 * direction, 4 * direction]])
    left = cut_doors(wall, door[None, :: -1 if turned else 1])
    low, high = np.clip(sorted(ends), 0, 4)
    length = np.linalg.norm(left[:, 1] - left[:, 0], axis=-1).sum()
    assert length == pytest.approx(4 - (high - low), abs=1e-6)


# Ground


def test_ground_with_a_hole_has_its_area(tmp_path):
    occupancy = map_of(tmp_path, HALL)
    assert (~occupancy.occupied).sum() * CELL_M**2 == pytest.approx(10 * 4 - 1)
    assert occupancy.is_occupied(np.array([[4.5, 1.5], [-0.5, 1], [10.5, 2]])).all()
    assert not occupancy.is_occupied(np.array([[4.5, 2.5], [0.1, 0.1]])).any()


@pytest.mark.parametrize(
    "text",
    [
        f"MULTIPOLYGON ({HALL.removeprefix('POLYGON ')})",
        "POLYGON ((0 0, 6 0, 6 0.9, 3 0.9, 3 4, 0 4, 0 0))\n"
        "POLYGON ((6 0, 10 0, 10 4, 3 4, 3 2, 5 2, 5 1, 4 1, 4 2, 3 2, 3 0.9, 6 0.9, 6 0))",
        xml([[ROOM]], obstacles=[[SQUARE]]),
    ],
)
def test_the_same_ground_is_written_in_many_ways(text, tmp_path):
    np.testing.assert_array_equal(map_of(tmp_path, text).occupied, map_of(tmp_path, HALL).occupied)


@pytest.mark.parametrize(
    "text",
    [
        f"GEOMETRYCOLLECTION ({HALL}, POINT (1 1))",
        "GEOMETRYCOLLECTION (" * 100_000 + "POINT (0 0)" + ")" * 100_000,
        xml([[ROOM]]).replace('"m"', '"km"'),
        f'<!DOCTYPE geometry [<!ENTITY a "ha"><!ENTITY b "&a;&a;">]>{xml([[ROOM]])}',
    ],
)
def test_what_is_no_geometry_is_refused(text, tmp_path):
    with pytest.raises(InputError) as error:
        map_of(tmp_path, text)
    assert error.value.path.stem == "hall"


def test_walls_of_too_many_cells_or_doors_are_refused(tmp_path):
    with refused("map size"):
        map_of(tmp_path, "LINESTRING (0 0, 1e7 1e7)")
    with refused("walls"):
        occupancy_of(Geometry(lines=np.tile([[[0, 0], [90, 90]]], (20_000, 1, 1))), CELL_M, 1.0)
    row = np.linspace(0, 9, 500)
    walls = np.stack([np.stack([row, 0 * row], axis=-1), np.stack([row, 9 + 0 * row], axis=-1)], axis=1)
    with refused("doors"):
        cut_doors(walls, np.tile([[[0, 4], [9, 4]]], (500, 1, 1)))
