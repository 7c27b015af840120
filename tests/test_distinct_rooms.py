"""No network is tested in a room that it was trained in: the rooms of the published configuration.

Two rooms are laid on each other in every way in which one corner of the one lies on one corner of the
other with the walls along each other, turned and mirrored ones included. They count as nearly equal
if in one of these ways their obstacles (outer walls left out) overlap by half, as intersection over union.
"""

import numpy as np
import pytest

from pedpred.settings import load
from pedpred.simulation.arrangements import rooms
from pedpred.simulation.clutter import ClutterSettings
from pedpred.simulation.layouts import WALL_CELLS, Layout
from pedpred.simulation.shapes import Circle, Rectangle
from tests.simulated import CLUTTER, DRAWN, data_set_of, drawn, read

NEARLY_EQUAL = 0.5
RASTER = slice(2, None, 5)  # of the map's cells: points 0.5 m apart
SIDE = 250  # cells; no room is longer

EMPTY_RIGHT = Layout((12.0, 9.0), [Rectangle([2.0, 3.0], [2.0, 4.0]), Circle([6.0, 7.0], 1.5)])


def obstacles(layout):
    inner = slice(WALL_CELLS, -WALL_CELLS)
    return layout.occupancy().occupied[inner, inner]


def rasters(cells, mirrored_only=False):
    """The room with each of its corners in the origin, as it is and mirrored at the diagonal. [8 or 4, P]."""
    found = []
    for turned in (cells,) if mirrored_only else (cells, cells.T):
        for placed in (turned, turned[::-1], turned[:, ::-1], turned[::-1, ::-1]):
            canvas = np.zeros((SIDE, SIDE), dtype=np.float32)
            canvas[: placed.shape[0], : placed.shape[1]] = placed
            found.append(canvas[RASTER, RASTER].ravel())
    return np.stack(found)


def overlap(layouts, others):
    """Intersection over union of the obstacles of every two rooms, laid on each other at best. [A, B]."""
    ours = np.concatenate([rasters(obstacles(room), mirrored_only=True) for room in layouts])
    theirs = np.concatenate([rasters(obstacles(room)) for room in others])
    both = ours @ theirs.T
    either = ours.sum(axis=1)[:, None] + theirs.sum(axis=1) - both
    share = np.where(either > 0, both / np.maximum(either, 1), 1.0)
    return share.reshape(len(layouts), 4, len(others), 8).max(axis=(1, 3))


def test_a_room_nearly_equals_itself_however_turned_and_lengthened():
    room = EMPTY_RIGHT
    turned = Layout((9.0, 12.0), [Rectangle([3.0, 10.0], [4.0, 2.0]), Circle([7.0, 6.0], 1.5)])
    longer = Layout((14.0, 9.0), [*room.shapes, Circle([12.5, 1.0], 0.4)])
    moved = Layout((12.0, 9.0), [Rectangle([2.2, 3.2], [2.0, 4.0]), Circle([5.8, 7.0], 1.5)])
    found = overlap([room], [room, turned, longer, moved, Layout((12.0, 9.0))])[0]
    assert found[0] == found[1] == 1.0
    assert found[2] > 0.9
    assert found[3] > NEARLY_EQUAL
    assert found[4] == 0.0
    assert overlap([Layout((12.0, 9.0))], [Layout((12.0, 9.0))]) == 1.0


@pytest.mark.slow
def test_no_test_room_nearly_equals_a_training_room():
    layouts, rows = {name: drawn(name) for name in DRAWN}, read("simulations/rooms")
    made = {
        key: rooms(data_set_of(rows[key]), layouts, load(ClutterSettings, CLUTTER))
        for key in ("corridor", "main", "sim_test")
    }
    trained = [layout for key in ("corridor", "main") for layout, _ in made[key].values()]
    tested = [layout for layout, _ in made["sim_test"].values()]
    assert (len(trained), len(tested)) == (301, 10)
    assert overlap(trained, tested).max() < NEARLY_EQUAL
