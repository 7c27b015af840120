"""What viewers and costmaps show, beside the forecasts that planners read."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator

import numpy as np

from pedpred.ros.markers import forecast_message
from pedpred.ros.planning import GRID_TYPE, grid_messages
from pedpred.ros2.grounds import Grounds
from pedpred.ros2.latched import Latched, nobody
from pedpred.ros2.outputs import MARKERS, MARKERS_TYPE, Answer, grid_topics
from pedpred.ros2.settings import NodeSettings
from pedpred.scenes import Forecast, OccupancyMap

_COLOUR = (0.84, 0.37, 0.0)
_EVERY_S = 0.08
"""Viewers and costmaps need no more than this, s."""
_DETAIL_M = 0.1
"""Predicted occupancy is computed in no smaller squares: the time grows with the fourth power of their number
per metre, and a person is wider."""
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
        self._grounds = Grounds(clock, _DETAIL_M)

    def answers(
        self,
        forecast: Forecast,
        named: list[str],
        time_ns: int,
        frame: str,
        ground: OccupancyMap | None,
        settings: NodeSettings,
    ) -> Iterator[Answer]:
        """What to publish for a forecast, if it is time to.

        Args:
            forecast: of people.
            named: the name of each.
            time_ns: its stamp.
            frame: of its places.
            ground: the map, if there is one.
            settings: of the node.
        """
        begun_s = self._clock()
        is_early = abs(forecast.time_s - self._shown_s) < _EVERY_S or begun_s < self._next_s
        all_have_gone = self._latched.shows_people and not len(forecast)
        if is_early and not all_have_gone:  # which is told at once
            return
        self._shown_s = forecast.time_s
        try:
            if self._latched.wants(MARKERS, settings.publish_markers, len(forecast)):
                shown = forecast if settings.publish_markers else nobody(forecast, forecast.time_s)
                content = forecast_message(shown, named[: len(shown)], _COLOUR, time_ns, frame)
                yield Answer(MARKERS, MARKERS_TYPE, content)
            yield from self._grids(forecast, time_ns, frame, ground, settings.occupancy_cell_m)
        finally:
            ended_s = self._clock()
            self._next_s = ended_s + (ended_s - begun_s)

    def _grids(
        self, forecast: Forecast, time_ns: int, frame: str, there: OccupancyMap | None, cell_m: float
    ) -> Iterator[Answer]:
        steps, is_on = forecast.predictions.steps, cell_m > 0
        wanted = {
            f"/{topic}" for topic in grid_topics(steps) if self._latched.wants(topic, is_on, len(forecast))
        }
        if not wanted:
            return
        if not is_on:
            forecast = nobody(forecast, forecast.time_s)
        ground, shown = self._grounds.ground(forecast.predictions, there, frame, cell_m)
        if ground.resolution_m > cell_m > 0:
            reason = "people are far apart" if there is None else "the map is large"
            text = "predicted_occupancy has cells of %.2f m: %s for smaller ones"
            _log.warning(text, ground.resolution_m, reason)
        grids = grid_messages(shown, ground, time_ns, frame, True, wanted.__contains__, detail_m=_DETAIL_M)
        for topic, content in grids.items():
            yield Answer(topic.lstrip("/"), GRID_TYPE, content)
