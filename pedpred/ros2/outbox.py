"""A forecast as the messages to be published."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from pedpred.ros.grids import GRID_TYPE, SMALLEST_CELL_M, fitting_ground, grid_messages
from pedpred.ros.markers import forecast_message
from pedpred.ros.planning import PREDICTIONS_TYPE, predictions_message, warn_of_rounding
from pedpred.ros.scene_messages import Content, header, person
from pedpred.ros2.latched import Latched
from pedpred.ros2.live_map import LiveMap
from pedpred.ros2.outputs import (
    MARKERS,
    MARKERS_TYPE,
    NAMES,
    PEOPLE,
    PEOPLE_TYPE,
    PREDICTIONS,
    TEXT_TYPE,
    Output,
    grid_topics,
)
from pedpred.ros2.settings import NodeSettings
from pedpred.scenes import Forecast, OccupancyMap

_COLOUR = (0.84, 0.37, 0.0)
_EVERY_S = 0.08
"""Viewers and costmaps need no more than this, s."""
_log = logging.getLogger(__name__)


class Outbox:
    """Makes messages: predictions always, names when there are new ones, others for their subscribers.

    Markers and grids are made at most every 0.08 s, and in at most half of the time: forecasts come first.

    Args:
        has_subscribers: whether a topic has any. Without any, a message is only made if the last one of the
            topic shows people who have gone.
        clock: gives seconds; never stops or jumps.
    """

    def __init__(self, has_subscribers: Callable[[str], bool], clock: Callable[[], float]):
        self._latched, self._clock = Latched(has_subscribers), clock
        self._names: Mapping[int, str] = {}
        self._shown_s, self._next_s = -np.inf, -np.inf
        self._ground: OccupancyMap | None = None

    def outputs(
        self,
        forecast: Forecast,
        names: Mapping[int, str],
        time_ns: int,
        around: LiveMap,
        settings: NodeSettings,
    ) -> Iterator[Output]:
        """Make the messages of a forecast.

        Args:
            forecast: of all people.
            names: number -> name of people whose name is not their number.
            time_ns: its stamp.
            around: the map and the frame of the forecast.
            settings: of the node.
        """
        warn_of_rounding(forecast.predictions, _log)
        cloud = predictions_message(forecast.track_id, forecast.predictions, time_ns, around.frame)
        yield Output(PREDICTIONS, PREDICTIONS_TYPE, cloud)
        if names.keys() - self._names.keys():
            text = json.dumps({str(number): name for number, name in names.items()})
            yield Output(NAMES, TEXT_TYPE, {"data": text})
        self._names = dict(names)
        if self._latched.is_needed(PEOPLE, settings.publish_people, len(forecast)):
            shown = forecast if settings.publish_people else empty(forecast, forecast.time_s)
            content = _people_content(shown, self._labels(shown), time_ns, around.frame)
            yield Output(PEOPLE, PEOPLE_TYPE, content)
        begun_s = self._clock()
        is_early = abs(forecast.time_s - self._shown_s) < _EVERY_S or begun_s < self._next_s
        have_gone = not len(forecast) and self._latched.shows_people
        if is_early and not have_gone:
            return
        self._shown_s = forecast.time_s
        try:
            yield from self._markers(forecast, time_ns, around, settings.publish_markers)
            yield from self._grids(forecast, time_ns, around, settings.occupancy_cell_m)
        finally:
            ended_s = self._clock()
            self._next_s = ended_s + (ended_s - begun_s)

    def _markers(self, forecast: Forecast, time_ns: int, around: LiveMap, is_on: bool) -> Iterator[Output]:
        if self._latched.is_needed(MARKERS, is_on, len(forecast)):
            shown = forecast if is_on else empty(forecast, forecast.time_s)
            content = forecast_message(shown, self._labels(shown), _COLOUR, time_ns, around.frame)
            yield Output(MARKERS, MARKERS_TYPE, content)

    def _labels(self, forecast: Forecast) -> list[str]:
        return [self._names.get(track, str(track)) for track in forecast.track_id.tolist()]

    def _grids(self, forecast: Forecast, time_ns: int, around: LiveMap, cell_m: float) -> Iterator[Output]:
        is_on, steps = cell_m > 0, forecast.predictions.steps
        if around.occupancy is None:
            if is_on:
                _log.warning("predicted_occupancy is not published without a map: publish `map`")
            return
        needed = {
            f"/{topic}"
            for topic in grid_topics(steps)
            if self._latched.is_needed(topic, is_on, len(forecast))
        }
        if not needed:
            return
        if is_on or self._ground is None:
            self._ground = fitting_ground(around.occupancy, cell_m, steps)
        if is_on and self._ground.resolution_m > max(cell_m, SMALLEST_CELL_M):
            text = "predicted_occupancy has cells of %.2f m, since the map is large"
            _log.warning(text, self._ground.resolution_m)
        shown = forecast if is_on else empty(forecast, forecast.time_s)
        grids = grid_messages(
            shown.predictions, self._ground, time_ns, around.frame, True, needed.__contains__
        )
        for topic, content in grids.items():
            yield Output(topic.lstrip("/"), GRID_TYPE, content)


def empty(forecast: Forecast, time_s: float) -> Forecast:
    """A forecast without people, with the steps of another one."""
    none = np.zeros(0, np.int64)
    return replace(
        forecast,
        time_s=time_s,
        track_id=forecast.track_id[none],
        velocity=forecast.velocity[none],
        predictions=forecast.predictions.select(none),
    )


def _people_content(forecast: Forecast, names: list[str], time_ns: int, frame: str) -> Content:
    """people_msgs/People: positions now, and the mean velocities of the first step of the forecast."""
    velocity = forecast.velocity[:, 0]
    position = forecast.position[:, 0] - forecast.dt_s * velocity
    people = [
        person(*one) | {"tagnames": ["track_id"], "tags": [str(track)]}
        for track, *one in zip(forecast.track_id, names, position, velocity, strict=True)
    ]
    return {"header": header(time_ns, frame), "people": people}
