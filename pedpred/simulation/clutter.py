"""Random plausible rooms: partition walls with doors, columns and furniture, as a `Layout`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy import ndimage

from pedpred.settings import In, Range, Settings
from pedpred.simulation.furniture import KINDS, columns, furniture, split_walls
from pedpred.simulation.layouts import RESOLUTION_M, WALL_CELLS, Layout, covered
from pedpred.simulation.shapes import Shape


@dataclass(frozen=True)
class ClutterSettings(Settings):
    """Parameters of the room generator, which draws from the ranges. Shares lie in [0, 1].

    Attributes:
        side_m: lengths of the sides of a room.
        partitions: number of walls with doors that split a room.
        smallest_room_m: least side of the parts after a split.
        door_m: widths of the openings.
        second_door_share: share of the walls with a second opening.
        wall_m: thickness of the partition walls.
        column_share: share of the rooms with a grid of columns.
        column_radius_m: radii of the columns.
        column_spacing_m: distances between columns.
        furniture_share: share of the ground that furniture covers.
        turned_share: share of the furniture that stands at any angle.
        scale: factor on the size of the furniture of a room.
        clearance_m: the ground stays connected at this clearance.
        attempts: number of placements tried per room.
    """

    side_m: Annotated[Range, In("(0, 1000]")]
    partitions: Annotated[tuple[int, int], In("[0, 100]")]
    smallest_room_m: Annotated[float, In("(0, 1000]")]
    door_m: Annotated[Range, In("(0, 1000]")]
    second_door_share: Annotated[float, In("[0, 1]")]
    wall_m: Annotated[Range, In("(0, 1000]")]
    column_share: Annotated[float, In("[0, 1]")]
    column_radius_m: Annotated[Range, In("(0, 1000]")]
    column_spacing_m: Annotated[Range, In("(0, 1000]")]
    furniture_share: Annotated[Range, In("[0, 1]")]
    turned_share: Annotated[Range, In("[0, 1]")]
    scale: Annotated[Range, In("(0, 1000]")]
    clearance_m: Annotated[float, In("[0, 1000]")]
    attempts: Annotated[int, In("[0, 100000]")]


def draw_cluttered_room(settings: ClutterSettings, rng: np.random.Generator) -> Layout:
    """Generate a random room; the same generator state gives the same room.

    An obstacle is kept only if the ground stays connected at `clearance_m`, so no part is closed off.
    """
    size = tuple(np.round(rng.uniform(*settings.side_m, 2), 1).tolist())
    room = _Room(size, settings.clearance_m)
    _partition(room, size, settings, rng)
    if rng.random() < settings.column_share:
        radius, spacing = rng.uniform(*settings.column_radius_m), rng.uniform(*settings.column_spacing_m)
        for column in columns(size, radius, spacing, rng):
            room.add([column])
    share, turned = rng.uniform(*settings.furniture_share), rng.uniform(*settings.turned_share)
    scale, shares = rng.uniform(*settings.scale), rng.dirichlet(np.full(len(KINDS), 0.7))
    for _ in range(settings.attempts):
        if room.furnished >= share:
            break
        room.furnish(furniture(size, shares, turned, scale, rng))
    return Layout(size, tuple(room.shapes))


def _partition(room: _Room, size: Range, settings: ClutterSettings, rng: np.random.Generator) -> None:
    """Split the largest part of the room repeatedly."""
    parts = [(0.0, 0.0, *size)]
    least, most = settings.partitions
    for _ in range(rng.integers(least, most + 1)):
        parts.sort(key=lambda part: (part[2] - part[0]) * (part[3] - part[1]))
        doors = [
            rng.uniform(*settings.door_m) for _ in range(1 + (rng.random() < settings.second_door_share))
        ]
        split = split_walls(parts[-1], doors, rng.uniform(*settings.wall_m), settings.smallest_room_m, rng)
        if split is None:
            return
        walls, halves = split
        if room.add(walls):
            parts[-1:] = halves


class _Room:
    """The obstacles placed so far, as shapes and as cells."""

    def __init__(self, size_m: Range, clearance_m: float):
        self._empty = empty = Layout(size_m).empty()
        self.shapes: list[Shape] = []
        self.furnished = 0.0  # share of the ground that furniture covers
        self._reach = clearance_m / RESOLUTION_M + 0.5  # of an obstacle's cell centres, in cells
        self._occupied = empty.occupied
        self._near = self._grown(empty.occupied)
        self._ground = int((~empty.occupied).sum())

    def add(self, shapes: list[Shape]) -> bool:
        """Place shapes if they leave the ground connected; return whether they were placed."""
        return self._place(shapes, np.logical_or.reduce([covered(shape, self._empty) for shape in shapes]))

    def furnish(self, shape: Shape) -> None:
        """Place a piece unless it overlaps other obstacles than the outer walls."""
        cells = covered(shape, self._empty)
        taken = (cells & self._occupied)[WALL_CELLS:-WALL_CELLS, WALL_CELLS:-WALL_CELLS]
        if not taken.any() and self._place([shape], cells):
            self.furnished += cells.sum() / self._ground

    def _place(self, shapes: list[Shape], cells: np.ndarray) -> bool:
        near = self._near | self._grown(cells)
        if ndimage.label(~near)[1] != 1:
            return False
        self._near, self._occupied = near, self._occupied | cells
        self.shapes.extend(shapes)
        return True

    def _grown(self, cells: np.ndarray) -> np.ndarray:
        """Cells closer than the clearance to covered ones."""
        near = np.zeros_like(cells)
        rows, columns = np.nonzero(cells.any(axis=1))[0], np.nonzero(cells.any(axis=0))[0]
        if len(rows):
            margin = int(np.ceil(self._reach))
            window = tuple(slice(max(at[0] - margin, 0), at[-1] + margin + 1) for at in (rows, columns))
            near[window] = ndimage.distance_transform_edt(~cells[window]) < self._reach - 1e-9
        return near
