"""Messages in, forecasts as messages out; knows no middleware."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from pedpred.online import OnlinePredictor
from pedpred.ros.detections import DetectionFrame, find_usable
from pedpred.ros.identities import Identities
from pedpred.ros.localisation import Localisation
from pedpred.ros.tf import frame_name
from pedpred.ros2.counts import Counts
from pedpred.ros2.inbox import Arrival, Inbox
from pedpred.ros2.latched import nobody
from pedpred.ros2.live_map import LiveMap
from pedpred.ros2.outbox import Outbox
from pedpred.ros2.outputs import Answer
from pedpred.ros2.place import load_place
from pedpred.ros2.settings import NodeSettings
from pedpred.scenes import Forecast, OccupancyMap
from pedpred.tracking.tracks import LOST_AFTER_S, TIME_TOLERANCE_S

_GONE_S = 1.5 * LOST_AFTER_S
"""After so long without a forecast all have gone: a little longer than tracks last between two messages."""
_log = logging.getLogger(__name__)


class Follower:
    """Follows one stream of people: inbox, identities, predictor, outbox.

    Times called `now_s` are those of a clock that never stops or jumps, s.

    Args:
        predictor: of this stream only.
        settings: of the node.
        has_subscribers: whether a topic has any, see `Outbox`.
        clock: gives such times.
        decode_people: see `Inbox`.

    Attributes:
        inbox: messages that wait, and transforms.
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
        self._predictor, self._settings, self.counts = predictor, settings, Counts()
        self.inbox = Inbox(settings, self.counts, decode_people)
        self._identities = Identities(settings.identities, self.inbox.has_ids, 2 * LOST_AFTER_S)
        predictor.name = self._identities.name
        self._outbox = Outbox(has_subscribers, clock)
        self._map, self._localisation = LiveMap(frame_name(settings.map_frame)), Localisation()
        self._latest: Forecast | None = None
        self._shown: tuple[Forecast, Arrival] | None = None
        self._time_ns = 0
        self.forecast_s, self.arrived_s = -np.inf, -np.inf

    @property
    def settings(self) -> NodeSettings:
        """Of the node; may be replaced at any time."""
        return self._settings

    @settings.setter
    def settings(self, settings: NodeSettings) -> None:
        self._settings = self.inbox.settings = settings

    @property
    def frame(self) -> str:
        """Frame of the forecasts."""
        return self._map.frame

    @property
    def occupancy(self) -> OccupancyMap | None:
        """The map that is used."""
        return self._map.occupancy

    @property
    def map_text(self) -> str:
        """Size of the map in words."""
        return self._map.text

    @property
    def transform_age_s(self) -> float | None:
        """How much older than the latest people a transform is that they need, s; None if they need none."""
        latest = self.inbox.latest
        if latest is None or not latest.ids:
            return None
        return self.inbox.frames.age_s(latest.frame, self.frame, latest.time_s)

    @property
    def doubts(self) -> tuple[str, ...]:
        """What is wrong with many of the last people, in words."""
        return self._predictor.doubts

    def load_place(self) -> None:
        """Continue with the file of the place, see `pedpred.ros2.place`."""
        load_place(self._predictor, self.settings.place)

    def save_place(self) -> None:
        """Write the file of the place.

        Raises:
            OutputError: it cannot be written.
        """
        if (path := self.settings.place) is not None:
            self._predictor.save_place(path)

    def map_came(self, raw: bytes, sent_ns: int = 0) -> None:
        """Use a nav_msgs/OccupancyGrid from now on; see `LiveMap.with_map`."""
        before, new = self._map, self._map.with_map(raw, sent_ns)
        if new.frame != before.frame:
            text = "the map is in %r, forecasts were in %r: all people are forgotten"
            _log.warning(text, new.frame, before.frame)
            self._predictor.reset()
            self._localisation = Localisation()
            self.load_place()
        self._use(new)
        if new.raw != before.raw and new.occupancy is not None:
            text = "map of %.1f x %.1f m in %r: %s"
            _log.info(text, *new.occupancy.extent_m, new.frame, new.text)

    def map_update_came(self, raw: bytes) -> None:
        """Change a part of the map by a map_msgs/OccupancyGridUpdate."""
        self._use(self._map.with_update(raw))

    def _use(self, new: LiveMap) -> None:
        if new.occupancy is not None and new.occupancy is not self._map.occupancy:
            self._predictor.set_map(new.occupancy)
        self._map = new

    def transforms_came(self, raw: bytes, clock_s: float, fixed: bool) -> None:
        """Take a tf2_msgs/TFMessage; `fixed` if it is of /tf_static."""
        self.inbox.take_transforms(raw, clock_s, fixed)

    def people_came(self, raw: bytes, clock_ns: int, now_s: float, waited_s: float = 0.0) -> None:
        """Take people, who wait for the transform of their time.

        Args:
            raw: the message.
            clock_ns: the clock of the stamps now, for people without one.
            now_s: see the class.
            waited_s: how long it lay in a queue, s; people without a stamp are of the time before.
        """
        self.inbox.take_people(raw, clock_ns, now_s, waited_s)

    def answers(self, now_s: float) -> Iterator[Answer]:
        """What to publish for the people whose transforms have come."""
        for arrival in self.inbox.ready(now_s, self.frame):
            yield from self._answers_to(arrival)

    def cleared(self, clock_ns: int, after_s: float = _GONE_S) -> Iterator[Answer]:
        """Without a forecast for some time, publish an empty one: costmaps keep the last grid.

        Args:
            clock_ns: as that of `people_came`; it stands while a simulation pauses.
            after_s: for how long, s.
        """
        if self._shown is None:
            return
        forecast, of = self._shown
        gone_ns = clock_ns - of.clock_ns  # less than 0 after a jump back: the stamp is that of now, too
        if abs(gone_ns) < after_s * 1e9:
            return
        self._shown, self.counts.people = None, 0
        gone = nobody(forecast, forecast.time_s + gone_ns / 1e9)
        yield from self._messages(gone, max(of.time_ns + gone_ns, 0))

    def _answers_to(self, arrival: Arrival) -> Iterator[Answer]:
        with self.counts.count_errors():
            detected, place = self._placed(arrival.detected)
            self._follow_localisation(detected, place)
            time_s = detected.time_s
            unnamed = self._identities.unnamed
            track_id = self._identities.number(time_s, detected.ids, place)
            if self._identities.unnamed > unnamed:
                _log.warning("people without an id, among others who have one, are identified by position")
            times_s = np.full(len(place), time_s)
            kept, left_out = find_usable(times_s, track_id, place, self._identities.name)
            if left_out:
                _log.warning("%s", left_out)
            forecast = self._predictor.update(time_s, track_id[kept], place[kept])
        before = self._latest
        if forecast is before:  # the people are older than the last forecast
            self.counts.late += 1
            return
        if before is not None:
            longest_s = self._predictor.protocol.lost_after_s + TIME_TOLERANCE_S
            self.counts.jumps += abs(time_s - before.time_s) > longest_s
            if forecast.time_s == before.time_s:  # it has more people
                arrival = replace(arrival, time_ns=self._time_ns)
        self._time_ns = arrival.time_ns
        self._latest, self._shown = forecast, (forecast, arrival)
        self.counts.without_forecast += len(np.setdiff1d(track_id, forecast.track_id))
        self.counts.forecasts += 1
        self.counts.people = len(forecast)
        self.arrived_s, self.forecast_s = arrival.arrived_s, arrival.read_s
        if self.occupancy is None and self.settings.use_map and len(forecast):
            text = "there is no map: forecasts go through walls. Publish `map`, or set use_map to false"
            _log.warning(text)
        yield from self._messages(forecast, arrival.time_ns)

    def _placed(self, detected: DetectionFrame) -> tuple[DetectionFrame, np.ndarray]:
        """People without those near the robot, and their positions in `frame`, m. [n, 2]."""
        frames, time_s, near_m = self.inbox.frames, detected.time_s, self.settings.ignore_near_robot_m
        place = frames.placed(detected.places, time_s, detected.frame, self.frame)[:, :2]
        base = frames.base(detected.frame) if near_m else ""
        if not base or frames.lack(base, self.frame, time_s):
            return detected, place
        robot = frames.placed(np.zeros((1, 3)), time_s, base, self.frame)[0, :2]
        kept = ~(np.hypot(*(place - robot).T) < near_m)
        self.counts.near_robot += int((~kept).sum())
        ids = tuple(np.array(detected.ids, object)[kept].tolist())
        return replace(detected, ids=ids, places=detected.places[kept]), place[kept]

    def _follow_localisation(self, detected: DetectionFrame, place: np.ndarray) -> None:
        """Move all tracks with the robot's odometry where that has jumped on the map."""
        if not detected.ids:
            return
        correction = self._localisation.correction(
            self.inbox.frames, detected.frame, self.frame, detected.time_s, place
        )
        if correction is not None:
            self._predictor.correct(*correction)
            self._identities.correct(*correction)
            text = "the localisation has jumped by %.2f m and %.2f rad, and all tracks with it"
            _log.info(text, np.hypot(*correction[1]), correction[0])

    def _messages(self, forecast: Forecast, time_ns: int) -> Iterator[Answer]:
        names = self._identities.names
        yield from self._outbox.answers(forecast, names, time_ns, self.frame, self.occupancy, self.settings)
