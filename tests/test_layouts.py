"""Layouts from dictionaries, and the rooms of the clutter generator."""

import re
import shlex
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from pedpred.settings import load
from pedpred.simulation.clutter import ClutterSettings, draw_cluttered_room
from pedpred.simulation.ground import ground_of, signed_distance
from pedpred.simulation.layouts import Layout, draw_targets
from pedpred.simulation.shapes import Door, Wall, shape_from
from stages import simulate
from tests.configuration import composed
from tests.simulated import CLUTTER, CONF, DRAWN, SETTINGS, asked, drawn, scene_of


def connected_parts(distance, clearance_m):
    """How many separate parts the cells with some clearance form."""
    return ndimage.label(distance >= clearance_m)[1]


def room_maps(seeds):
    settings = load(ClutterSettings, CLUTTER)
    return [draw_cluttered_room(settings, np.random.default_rng(seed)).occupancy() for seed in seeds]


@pytest.mark.parametrize(
    ("shape", "area_m2"),
    [
        ({"rectangle": {"center": [5, 4], "size_m": [3, 2], "angle_deg": 30}}, 6.0),
        ({"circle": {"center": [5, 4], "radius_m": 1.5}}, np.pi * 1.5**2),
        ({"polygon": {"corners": [[2, 2], [8, 2], [5, 6]]}}, 12.0),
        ({"wall": {"start": [2, 2], "end": [6, 2], "thickness_m": 0.4}}, 4 * 0.4 + np.pi * 0.2**2),
        (
            {
                "wall": {
                    "start": [2, 2],
                    "end": [8, 6],
                    "thickness_m": 0.4,
                    "doors": [{"at_m": 2, "width_m": 1}],
                }
            },
            (np.hypot(6, 4) - 1) * 0.4 + np.pi * 0.2**2,
        ),
    ],
)
def test_a_shape_covers_its_area(shape, area_m2):
    empty, filled = (Layout((10, 8), shapes).occupancy() for shapes in ((), (shape_from(shape, "shape"),)))
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


@given(st.floats(0.0, 360.0), st.floats(0.5, 5.5), st.floats(0.3, 1.0))
def test_a_door_opens_its_width_and_leaves_the_rest_of_the_wall(angle_deg, at_m, width_m):
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


def test_corridor_targets_lie_at_its_two_ends():
    layout = drawn("corridor")
    pool = draw_targets(layout, ground_of(layout.occupancy()), SETTINGS.crowd, np.random.default_rng(0))
    assert set(pool.region) == {0, 1}
    assert np.abs(pool.position[:, 0] - 10.0).min() > 7.5


def test_generated_rooms_are_connected_and_differ():
    maps = room_maps(range(6))
    for occupancy in maps:
        distance = signed_distance(occupancy.occupied, occupancy.resolution_m)
        assert connected_parts(distance, CLUTTER["clearance_m"] - 1e-9) == 1
    assert len({occupancy.occupied.tobytes() for occupancy in maps}) == len(maps)


def test_a_layout_of_ones_own_is_a_file_and_a_command(tmp_path, monkeypatch):
    page = (CONF.parent / "docs/layouts.md").read_text().partition("## The simulated people")[0]
    layout, commands = re.findall(r"```(?:yaml|sh)\n(.*?)```", page, re.DOTALL)
    (tmp_path / "kitchen.yaml").write_text(layout)
    monkeypatch.setattr(simulate, "LAYOUTS", tmp_path)
    command, info = (shlex.split(line) for line in commands.splitlines())
    cfg = composed(*command[3:])
    row = cfg["simulations"][cfg["name"]]
    (todo,) = asked(row, simulate.read_layouts(row["drawn"]))
    assert f"{cfg['out']}/{todo.name}" == info[-1]
    scene = scene_of(replace(todo, duration_s=6.0))
    assert len(scene.trajectories) == 20 * 20
    assert scene.occupancy.is_occupied([[6.0, 1.0], [2.5, 6.0], [13.8, 8.8]]).all()
    assert not scene.occupancy.is_occupied([6.0, 3.0])
