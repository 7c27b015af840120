"""Messages in, forecasts as messages out; knows no middleware."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from pedpred.errors import PedpredError
from pedpred.online import OnlinePredictor
from pedpred.ros.detections import DetectionFrame, find_usable
from pedpred.ros.identities import Identities
from pedpred.ros.localisation import Localisation
from pedpred.ros.tf import frame_name
from pedpred.ros2.counts import Counts
from pedpred.ros2.inbox import Arrival, Inbox
from pedpred.ros2.live_map import LiveMap
from pedpred.ros2.outbox import Outbox, empty
from pedpred.ros2.outputs import Output
from pedpred.ros2.settings import NodeSettings
from pedpred.scenes import Forecast
from pedpred.tracking.tracks import LOST_AFTER_S, TIME_TOLERANCE_S

_GONE_S = 1.5 * LOST_AFTER_S
"""After so long without a forecast all have gone: a little longer than tracks last between two messages."""
_log = logging.getLogger(__name__)


class Follower:
    """Forecasts one stream of people: inbox, identities, predictor, outbox.

    Times called `now_s` are those of a clock that never stops or jumps, s.

    Args:
        predictor: of this stream only.
        settings: of the node.
        has_subscribers: whether a topic has any, see `Outbox`.
        clock: gives such times.
        decode_people: see `Inbox`.

    Attributes:
        predictor: see above.
        inbox: messages that wait, and transforms; takes people and transforms.
        map: the map, and the frame of the forecasts.
        counts: what happened.
        forecast_s: when the people of the last forecast were read.
        arrived_s: when they came into the queue from which they were read.
    """

    def __init__(
        self,
        predictor: OnlinePredictor,
        settings: NodeSettings,
        has_subscribers: Callable[[str], bool] = lambda topic: True,
        clock: Callable[[], float] = time.monotonic,
        decode_people: Callable[[bytes], Any] | None = None,
    ):
        self.predictor, self.counts = predictor, Counts()
        self.inbox = Inbox(settings, self.counts, decode_people)
        self._identities = Identities(settings.identities, self.inbox.has_ids, 2 * LOST_AFTER_S)
        predictor.name = self._identities.name
        self._outbox = Outbox(has_subscribers, clock)
        self.map, self._localisation = LiveMap(frame_name(settings.map_frame)), Localisation()
        self._latest: Forecast | None = None
        self._shown: tuple[Forecast, Arrival] | None = None
        self._time_ns = 0
        self.forecast_s, self.arrived_s = -np.inf, -np.inf

    @property
    def settings(self) -> NodeSettings:
        """Of the node; may be replaced at any time."""
        return self.inbox.settings

    @settings.setter
    def settings(self, settings: NodeSettings) -> None:
        self.inbox.settings = settings

    def load_place(self) -> None:
        """Continue with the file of the place, if there is one; a file that cannot be used is renamed."""
        path = self.settings.place
        if path is None or not path.exists():
            return
        try:
            self.predictor.load_place(path)
        except PedpredError as problem:
            unused = path.replace(path.with_name(f"{path.name}.unused"))  # the name is soon written to
            _log.warning("what was learned before is not used, and now %s: %s", unused, problem)
        else:
            _log.info("continuing with what was learned in %s", path)

    def save_place(self) -> None:
        """Write the file of the place.

        Raises:
            OutputError: it cannot be written.
        """
        if (path := self.settings.place) is not None:
            self.predictor.save_place(path)

    def take_map(self, raw: bytes, sent_ns: int = 0) -> None:
        """Use a nav_msgs/OccupancyGrid from now on; see `LiveMap.with_map`."""
        before, new = self.map, self.map.with_map(raw, sent_ns)
        if new.frame != before.frame:
            text = "the map is in %r, forecasts were in %r: all people are forgotten"
            _log.warning(text, new.frame, before.frame)
            self.predictor.reset()
            self._localisation = Localisation()
            self.load_place()
        self._use(new)
        if new.raw != before.raw and new.occupancy is not None:
            _log.info("map of %.1f x %.1f m in %r: %s", *new.occupancy.extent_m, new.frame, new.text)

    def take_map_update(self, raw: bytes) -> None:
        """Change a part of the map by a map_msgs/OccupancyGridUpdate."""
        self._use(self.map.with_update(raw))

    def _use(self, new: LiveMap) -> None:
        if new.occupancy is not None and new.occupancy is not self.map.occupancy:
            self.predictor.set_map(new.occupancy)
        self.map = new

    def outputs(self, now_s: float) -> Iterator[Output]:
        """What to publish for the people whose transforms have arrived."""
        for arrival in self.inbox.ready(now_s, self.map.frame):
            yield from self._outputs_of(arrival)

    def clear_outputs(self, clock_ns: int, after_s: float = _GONE_S) -> Iterator[Output]:
        """Without a forecast for some time, publish an empty one: costmaps keep the last grid.

        Args:
            clock_ns: as that of `Inbox.take_people`; it stands while a simulation pauses.
            after_s: for how long, s.
        """
        if self._shown is None:
            return
        forecast, arrival = self._shown
        gone_ns = clock_ns - arrival.clock_ns  # less than 0 after a jump back: the stamp is that of now, too
        if abs(gone_ns) < after_s * 1e9:
            return
        self._shown, self.counts.people = None, 0
        yield from self._messages(
            empty(forecast, forecast.time_s + gone_ns / 1e9), max(arrival.time_ns + gone_ns, 0)
        )

    def _outputs_of(self, arrival: Arrival) -> Iterator[Output]:
        with self.counts.count_errors():
            detected, position = self._place(arrival.detected)
            self._follow_localisation(detected, position)
            track_id, forecast = self._update(detected, position)
        before = self._latest
        if forecast is before:  # the people are older than the last forecast
            self.counts.late += 1
            return
        if before is not None:
            longest_s = self.predictor.protocol.lost_after_s + TIME_TOLERANCE_S
            self.counts.jumps += abs(detected.time_s - before.time_s) > longest_s
            if forecast.time_s == before.time_s:  # it has more people
                arrival = replace(arrival, time_ns=self._time_ns)
        self._time_ns = arrival.time_ns
        self._latest, self._shown = forecast, (forecast, arrival)
        self.counts.without_forecast += len(np.setdiff1d(track_id, forecast.track_id))
        self.counts.forecasts += 1
        self.counts.people = len(forecast)
        self.arrived_s, self.forecast_s = arrival.arrived_s, arrival.read_s
        if self.map.occupancy is None and self.settings.use_map and len(forecast):
            text = "there is no map: forecasts go through walls. Publish `map`, or set use_map to false"
            _log.warning(text)
        yield from self._messages(forecast, arrival.time_ns)

    def _place(self, detected: DetectionFrame) -> tuple[DetectionFrame, np.ndarray]:
        """People without those near the robot, and their positions in the frame of the map, m. [n, 2]."""
        frames, target, near_m = self.inbox.frames, self.map.frame, self.settings.ignore_near_robot_m
        time_s = detected.time_s
        position = frames.placed(detected.positions, time_s, detected.frame, target)[:, :2]
        base = frames.base(detected.frame) if near_m else ""
        if not base or frames.explain_missing(base, target, time_s):
            return detected, position
        robot = frames.placed(np.zeros((1, 3)), time_s, base, target)[0, :2]
        kept = ~(np.hypot(*(position - robot).T) < near_m)
        self.counts.near_robot += int((~kept).sum())
        ids = tuple(np.array(detected.ids, object)[kept].tolist())
        return replace(detected, ids=ids, positions=detected.positions[kept]), position[kept]

    def _follow_localisation(self, detected: DetectionFrame, position: np.ndarray) -> None:
        """Move all tracks with the robot's odometry where that has jumped on the map."""
        if not detected.ids:
            return
        correction = self._localisation.correction(
            self.inbox.frames, detected.frame, self.map.frame, detected.time_s, position
        )
        if correction is not None:
            self.predictor.correct(*correction)
            self._identities.correct(*correction)
            text = "the localisation has jumped by %.2f m and %.2f rad, and all tracks with it"
            _log.info(text, np.hypot(*correction[1]), correction[0])

    def _update(self, detected: DetectionFrame, position: np.ndarray) -> tuple[np.ndarray, Forecast]:
        """Numbers of the people, [n] int64, and the forecast after them."""
        time_s, unnamed = detected.time_s, self._identities.unnamed
        track_id = self._identities.number(time_s, detected.ids, position)
        if self._identities.unnamed > unnamed:
            _log.warning("people without an id, among others who have one, are identified by position")
        usable, text = find_usable(np.full(len(position), time_s), track_id, position, self._identities.name)
        if text:
            _log.warning("%s", text)
        return track_id, self.predictor.update(time_s, track_id[usable], position[usable])

    def _messages(self, forecast: Forecast, time_ns: int) -> Iterator[Output]:
        yield from self._outbox.outputs(forecast, self._identities.names, time_ns, self.map, self.settings)
