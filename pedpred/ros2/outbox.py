"""A forecast as the messages to be published."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterator, Mapping

from pedpred.ros.planning import PREDICTIONS_TYPE, predictions_message, warn_of_rounding
from pedpred.ros2.latched import Latched, nobody
from pedpred.ros2.outputs import (
    NAMES,
    PEOPLE,
    PEOPLE_TYPE,
    PREDICTIONS,
    TEXT_TYPE,
    Answer,
    people_content,
)
from pedpred.ros2.settings import NodeSettings
from pedpred.ros2.views import Views
from pedpred.scenes import Forecast, OccupancyMap

_log = logging.getLogger(__name__)


class Outbox:
    """Makes messages. Predictions are always made, names when there are new ones.

    Args:
        has_subscribers: whether a topic has any; all others are left out where there are none, unless the
            last message still shows people who have gone.
        clock: gives seconds; never stops or jumps.
    """

    def __init__(self, has_subscribers: Callable[[str], bool], clock: Callable[[], float]):
        self._latched = Latched(has_subscribers)
        self._views = Views(self._latched, clock)
        self._published: Mapping[int, str] = {}

    def answers(
        self,
        forecast: Forecast,
        names: Mapping[int, str],
        time_ns: int,
        frame: str,
        ground: OccupancyMap | None,
        settings: NodeSettings,
    ) -> Iterator[Answer]:
        """Make the messages of a forecast.

        Args:
            forecast: of all people.
            names: number -> name of people whose name is not their number.
            time_ns: its stamp.
            frame: of its positions.
            ground: the map, if there is one.
            settings: of the node.
        """
        warn_of_rounding(forecast.predictions, _log)
        cloud = predictions_message(forecast.track_id, forecast.predictions, time_ns, frame)
        yield Answer(PREDICTIONS, PREDICTIONS_TYPE, cloud)
        if names.keys() - self._published.keys():
            text = json.dumps({str(number): name for number, name in names.items()})
            yield Answer(NAMES, TEXT_TYPE, {"data": text})
        self._published = dict(names)
        labels = [names.get(track, str(track)) for track in forecast.track_id.tolist()]
        is_on = settings.publish_people
        if self._latched.wants(PEOPLE, is_on, len(forecast)):
            shown = forecast if is_on else nobody(forecast, forecast.time_s)
            yield Answer(PEOPLE, PEOPLE_TYPE, people_content(shown, labels[: len(shown)], time_ns, frame))
        yield from self._views.answers(forecast, labels, time_ns, frame, ground, settings)
