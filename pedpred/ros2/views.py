"""Messages for viewers and costmaps: markers, and grids of predicted occupancy."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator

import numpy as np

from pedpred.ros.markers import forecast_message
from pedpred.ros.planning import GRID_TYPE, SMALLEST_CELL_M, fitting_ground, grid_messages
from pedpred.ros2.latched import Latched, nobody
from pedpred.ros2.outputs import MARKERS, MARKERS_TYPE, Answer, grid_topics
from pedpred.ros2.settings import NodeSettings
from pedpred.scenes import Forecast, OccupancyMap

_COLOUR = (0.84, 0.37, 0.0)
_EVERY_S = 0.08
"""Viewers and costmaps need no more than this, s."""
_log = logging.getLogger(__name__)


class Views:
    """Makes markers and grids, at most every 0.08 s, and in at most half of the time: forecasts come first.

    Args:
        latched: says which topics are to be published.
        clock: gives seconds; never stops or jumps.
    """

    def __init__(self, latched: Latched, clock: Callable[[], float]):
        self._latched, self._clock = latched, clock
        self._shown_s, self._next_s = -np.inf, -np.inf
        self._ground: OccupancyMap | None = None
        self._has_warned = False

    def answers(
        self,
        forecast: Forecast,
        names: list[str],
        time_ns: int,
        frame: str,
        occupancy: OccupancyMap | None,
        settings: NodeSettings,
    ) -> Iterator[Answer]:
        """What to publish for a forecast, if it is time to; that all have gone is published at once.

        Args:
            forecast: of people.
            names: of each.
            time_ns: its stamp.
            frame: of its positions.
            occupancy: the map, if there is one.
            settings: of the node.
        """
        begun_s, count = self._clock(), len(forecast)
        is_early = abs(forecast.time_s - self._shown_s) < _EVERY_S or begun_s < self._next_s
        if is_early and (count or not self._latched.shows_people):
            return
        self._shown_s = forecast.time_s
        try:
            if self._latched.wants(MARKERS, settings.publish_markers, count):
                shown = forecast if settings.publish_markers else nobody(forecast, forecast.time_s)
                content = forecast_message(shown, names[: len(shown)], _COLOUR, time_ns, frame)
                yield Answer(MARKERS, MARKERS_TYPE, content)
            yield from self._grids(forecast, time_ns, frame, occupancy, settings.occupancy_cell_m)
        finally:
            ended_s = self._clock()
            self._next_s = ended_s + (ended_s - begun_s)

    def _grids(
        self, forecast: Forecast, time_ns: int, frame: str, occupancy: OccupancyMap | None, cell_m: float
    ) -> Iterator[Answer]:
        predictions, is_on = forecast.predictions, cell_m > 0
        if occupancy is None:
            if is_on and not self._has_warned:
                self._has_warned = True
                _log.warning("predicted_occupancy is not published without a map: publish `map`")
            return
        topics = grid_topics(predictions.steps)
        wanted = {f"/{topic}" for topic in topics if self._latched.wants(topic, is_on, len(forecast))}
        if not wanted:
            return
        if is_on or self._ground is None:
            self._ground = fitting_ground(occupancy, cell_m, predictions.steps)
        if self._ground.resolution_m > max(cell_m, SMALLEST_CELL_M) and is_on:
            text = "predicted_occupancy has cells of %.2f m, since the map is large"
            _log.warning(text, self._ground.resolution_m)
        shown = predictions if is_on else nobody(forecast, forecast.time_s).predictions
        grids = grid_messages(shown, self._ground, time_ns, frame, True, wanted.__contains__)
        for topic, content in grids.items():
            yield Answer(topic.lstrip("/"), GRID_TYPE, content)
