"""Random plausible rooms: partition walls with doors, columns and furniture, as a `Layout`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import ndimage

from pedpred.errors import ConfigError
from pedpred.simulation.furniture import KINDS, columns, furniture, split_walls
from pedpred.simulation.layouts import RESOLUTION_M, WALL_CELLS, Layout, covered
from pedpred.simulation.shapes import Shape

Range = tuple[float, float]


@dataclass(frozen=True)
class ClutterSettings:
    """What the generator draws from; ranges are (least, most). Shares lie in [0, 1].

    Attributes:
        side_m: sides of the room.
        partitions: how many times a room is split by a wall with a door.
        smallest_room_m: a split leaves no side shorter than this.
        door_m: widths of the openings.
        second_door_share: walls that get another opening.
        wall_m: thickness of the partition walls.
        column_share: arrangements with a grid of columns.
        column_radius_m: their radii.
        column_spacing_m: their distances.
        furniture_share: share of the ground that furniture covers.
        turned_share: share of the furniture that stands at any angle.
        scale: factor on the size of an arrangement's furniture.
        clearance_m: half the narrowest way; the ground stays connected at it.
        attempts: placements tried per arrangement.
    """

    side_m: Range
    partitions: tuple[int, int]
    smallest_room_m: float
    door_m: Range
    second_door_share: float
    wall_m: Range
    column_share: float
    column_radius_m: Range
    column_spacing_m: Range
    furniture_share: Range
    turned_share: Range
    scale: Range
    clearance_m: float
    attempts: int


def clutter_settings(cfg: Mapping[str, Any]) -> ClutterSettings:
    """Read the group `clutter`; lists become ranges."""
    values: dict[str, Any] = {
        key: value if isinstance(value, (int, float)) else tuple(value) for key, value in cfg.items()
    }
    try:
        return ClutterSettings(**values)
    except TypeError as cause:
        raise ConfigError("clutter", dict(values), str(cause)) from cause


def cluttered_room(settings: ClutterSettings, rng: np.random.Generator) -> Layout:
    """One random arrangement; the same generator state gives the same room.

    An obstacle is kept only if the ground stays connected for a walker who needs `clearance_m` to
    both sides, so no room is closed off.
    """
    size = tuple(np.round(rng.uniform(*settings.side_m, 2), 1).tolist())
    room = _Room(size, settings.clearance_m)
    _partition(room, size, settings, rng)
    if rng.random() < settings.column_share:
        radius, spacing = rng.uniform(*settings.column_radius_m), rng.uniform(*settings.column_spacing_m)
        for column in columns(size, radius, spacing, rng):
            room.add([column])
    share, turned = rng.uniform(*settings.furniture_share), rng.uniform(*settings.turned_share)
    scale, mixture = rng.uniform(*settings.scale), rng.dirichlet(np.full(len(KINDS), 0.7))
    for _ in range(settings.attempts):
        if room.furnished >= share:
            break
        room.furnish(furniture(size, mixture, turned, scale, rng))
    return Layout(size, tuple(room.shapes))


def _partition(room: _Room, size: Range, settings: ClutterSettings, rng: np.random.Generator) -> None:
    """Split the room, then the largest part of it, and so on."""
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
    """Obstacles placed so far, as shapes and as cells."""

    def __init__(self, size_m: Range, clearance_m: float):
        self._empty = empty = Layout(size_m).empty()
        self.shapes: list[Shape] = []
        self.furnished = 0.0  # share of the ground that furniture covers
        self._reach = clearance_m / RESOLUTION_M + 0.5  # of an obstacle's cell centres, in cells
        self._occupied = empty.occupied
        self._near = self._grown(empty.occupied)
        self._ground = int((~empty.occupied).sum())

    def add(self, shapes: list[Shape]) -> bool:
        """Place some shapes if they leave the ground connected; say whether they stand."""
        return self._place(shapes, np.logical_or.reduce([covered(shape, self._empty) for shape in shapes]))

    def furnish(self, shape: Shape) -> None:
        """Place one piece where nothing but an outer wall stands yet."""
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
        """Cells where a walker would be too close to covered ones; looks only around those."""
        near = np.zeros_like(cells)
        rows, columns = np.nonzero(cells.any(axis=1))[0], np.nonzero(cells.any(axis=0))[0]
        if len(rows):
            margin = int(np.ceil(self._reach))
            window = tuple(slice(max(at[0] - margin, 0), at[-1] + margin + 1) for at in (rows, columns))
            near[window] = ndimage.distance_transform_edt(~cells[window]) < self._reach - 1e-9
        return near
