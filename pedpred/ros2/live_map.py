"""The map of a node: the last nav_msgs/OccupancyGrid with the updates after it."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pedpred.ros.message_types import MAP, TYPES, UPDATE_TYPE
from pedpred.ros.scene_messages import blocked, map_of_grid, updated_grid
from pedpred.ros.tf import frame_name
from pedpred.ros2.wire import decode
from pedpred.scenes import OccupancyMap

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class LiveMap:
    """A map as it was received.

    Attributes:
        frame: of the forecasts, also before a map comes.
        occupancy: the map; None before it comes.
        raw: bytes of the last whole map.
        sent_ns: when these were sent; 0: unknown.
        grid: the message, with all updates; None before it comes.
        is_updated: whether there were updates.
    """

    frame: str
    occupancy: OccupancyMap | None = None
    raw: bytes = b""
    sent_ns: int = 0
    grid: Any = None
    is_updated: bool = False

    @property
    def text(self) -> str:
        """Size and share of blocked cells in words."""
        if self.occupancy is None:
            return "none"
        cells = self.occupancy.occupied
        return "{} x {} cells, {:.1f} % blocked".format(*cells.shape, 100 * cells.mean())

    def with_map(self, raw: bytes, sent_ns: int) -> LiveMap:
        """The map after a nav_msgs/OccupancyGrid; with the same `occupancy` where it is the same message.

        Args:
            raw: the message.
            sent_ns: when the publisher sent it; several subscriptions receive it several times.

        Raises:
            ValueRuleError: it is not a map.
        """
        is_copy = sent_ns != 0 and sent_ns == self.sent_ns
        if raw == self.raw and (is_copy or not self.is_updated):
            return replace(self, sent_ns=sent_ns)
        message = decode(raw, TYPES[MAP])
        occupancy, frame = map_of_grid(message), frame_name(message.header.frame_id)
        if not frame:
            frame = self.frame
            _log.warning("the map names no frame (header.frame_id): %r is assumed", frame)
        return LiveMap(frame, occupancy, raw, sent_ns, message)

    def with_update(self, raw: bytes) -> LiveMap:
        """The map after a map_msgs/OccupancyGridUpdate; without a map it is left out.

        Raises:
            ValueRuleError: the update does not fit the map.
        """
        if self.grid is None:
            _log.warning("an update of the map is left out: there is no map yet")
            return self
        grid = updated_grid(self.grid, decode(raw, UPDATE_TYPE))
        is_same = np.array_equal(blocked(grid.data), blocked(self.grid.data))
        return replace(
            self, grid=grid, is_updated=True, occupancy=self.occupancy if is_same else map_of_grid(grid)
        )
