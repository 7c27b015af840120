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
from pedpred.simulation.layouts import WALL_CELLS
from tests.simulated import CLUTTER, DRAWN, data_set_of, drawn, read

NEARLY_EQUAL = 0.5
RASTER = slice(2, None, 5)  # of the map's cells: points 0.5 m apart
SIDE = 250  # cells; no room is longer


def obstacles(layout):
    inner = slice(WALL_CELLS, -WALL_CELLS)
    return layout.occupancy().occupied[inner, inner]


def rasters(cells):
    """The room with each of its corners in the origin. [4, P]."""
    found = []
    for placed in (cells, cells[::-1], cells[:, ::-1], cells[::-1, ::-1]):
        canvas = np.zeros((SIDE, SIDE), dtype=np.float32)
        canvas[: placed.shape[0], : placed.shape[1]] = placed
        found.append(canvas[RASTER, RASTER].ravel())
    return np.stack(found)


def overlap(rooms, others):
    """Intersection over union of the obstacles of every two rooms, laid on each other at best. [A, B]."""
    ours = np.concatenate([rasters(cells) for cells in rooms])
    theirs = np.concatenate([rasters(own) for cells in others for own in (cells, cells.T)])
    both = ours @ theirs.T
    either = ours.sum(axis=1)[:, None] + theirs.sum(axis=1) - both
    share = np.where(either > 0, both / np.maximum(either, 1), 1.0)
    return share.reshape(len(rooms), 4, len(others), 8).max(axis=(1, 3))


@pytest.mark.slow
def test_no_test_room_nearly_equals_a_training_room():
    layouts, rows = {name: drawn(name) for name in DRAWN}, read("simulations/rooms")
    made = {
        key: rooms(data_set_of(rows[key]), layouts, load(ClutterSettings, CLUTTER))
        for key in ("corridor", "main", "sim_test")
    }
    trained = [obstacles(layout) for key in ("corridor", "main") for layout, _ in made[key].values()]
    tested = [obstacles(layout) for layout, _ in made["sim_test"].values()]
    assert (len(trained), len(tested)) == (301, 10)
    assert overlap(trained, tested).max() < NEARLY_EQUAL
    turned = [cells.T[::-1] for cells in tested]
    assert overlap(tested, turned).diagonal().min() > 0.9  # a turned room is found
