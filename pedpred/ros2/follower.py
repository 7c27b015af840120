"""Messages in, forecasts as messages out; knows no middleware."""

from __future__ import annotations

import json
import logging
import os
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from pedpred.errors import PedpredError, ValueRuleError
from pedpred.files import translate_errors
from pedpred.online import OnlinePredictor
from pedpred.ros.decoding import Connection, Decoder
from pedpred.ros.detections import Instant
from pedpred.ros.frame_tree import frame_name
from pedpred.ros.localisation import JUMPS_MPS, Poses, moved
from pedpred.ros.message_types import MAP, TRANSFORMS, TYPES, UPDATE_TYPE
from pedpred.ros.people import Nameless, find_usable
from pedpred.ros.planning import PREDICTIONS_TYPE, predictions_message, tell_rounding
from pedpred.ros.scene_messages import blocked, map_of_grid, updated_grid
from pedpred.ros2.identities import Identities
from pedpred.ros2.latched import Latched, nobody
from pedpred.ros2.live_frames import LiveFrames
from pedpred.ros2.outputs import (
    NAMES,
    PEOPLE,
    PEOPLE_TYPE,
    PREDICTIONS,
    TEXT_TYPE,
    Answer,
    people_content,
)
from pedpred.ros2.robot_seen import RobotSeen
from pedpred.ros2.settings import NodeSettings
from pedpred.ros2.views import Views
from pedpred.scenes import Forecast, OccupancyMap
from pedpred.tracking.tracks import LOST_AFTER_S, TIME_TOLERANCE_S

_MOST_WAITING = 100
_GONE_S = 1.5 * LOST_AFTER_S
"""After so long without a forecast nobody is there: a little longer than tracks last between two messages."""
_CAUGHT_UP = 0.1
"""Once people had to wait too long, all are left out until some wait less than this share of that time: when
forecasts take longer than messages need to come, late ones would be late for ever."""
_log = logging.getLogger(__name__)


@dataclass
class Counts:
    """What happened since the start, for diagnostics."""

    messages: int = 0
    forecasts: int = 0
    people: int = 0
    lost: int = 0
    late: int = 0
    slow: int = 0
    refused: int = 0
    missed: int = 0
    jumps: int = 0
    without_forecast: int = 0
    detections: int = 0
    others: int = 0
    elsewhere: int = 0

    @property
    def left_out(self) -> int:
        """Messages without a forecast."""
        return self.lost + self.late + self.slow + self.refused + self.missed

    @contextmanager
    def refusing(self) -> Iterator[None]:
        """Count a message that something is wrong with."""
        try:
            yield
        except Exception:
            self.refused += 1
            raise


@dataclass(frozen=True)
class _Waiting:
    came_s: float
    arrived_s: float
    clock_ns: int
    time_ns: int
    instant: Instant


@dataclass
class _Map:
    """The map in use; `frame` is that of the forecasts, also before a map comes.

    Of the whole map that came last, `raw` are the bytes, and `sent_ns` when they were sent, if that is known.
    """

    frame: str
    occupancy: OccupancyMap | None = None
    raw: bytes = b""
    sent_ns: int = 0
    is_updated: bool = False
    grid: Any = None
    told: str = "none"


class Follower:
    """Follows one stream of people.

    Times called `now_s` are those of a clock that never stops or jumps, s.

    Args:
        predictor: used by nobody else.
        settings: of the node; may be replaced at any time.
        is_heard: whether somebody listens to a topic; all but the table of forecasts, which planners read,
            and the names is left out where nobody does, unless it still shows people who have gone.
        clock: gives such times.

    Attributes:
        counts: what happened.
        heard_s: when the last people were read.
        forecast_s: when those of the last forecast were.
        came_s: when those of the last forecast came, into the queue from which they were read.
        stamp_age_s: by how much the last people were older than the clock of their stamps when they came.
    """

    def __init__(
        self,
        predictor: OnlinePredictor,
        settings: NodeSettings,
        is_heard: Callable[[str], bool] = lambda topic: True,
        clock: Callable[[], float] = time.monotonic,
    ):
        self._predictor, self.settings, self._latched = predictor, settings, Latched(is_heard)
        self._decoder, self._frames = Decoder(), LiveFrames()
        self._map = _Map(frame_name(settings.map_frame))
        self._waiting: deque[_Waiting] = deque()
        self._nameless = Nameless()
        self._identities = Identities(settings.identities, settings.people_type)
        predictor.name = self._identities.name
        self._named: dict[int, str] = {}
        self._is_behind = False
        self._latest: Forecast | None = None
        self._time_ns = 0
        self._floor_m, self._robot_seen = 0.0, RobotSeen()
        self._shown: tuple[Forecast, _Waiting] | None = None
        self._odometry: Poses | None = None
        self._views = Views(self._latched, clock)
        self.counts, self.heard_s, self.forecast_s = Counts(), -np.inf, -np.inf
        self.came_s, self.stamp_age_s = -np.inf, 0.0
        self._heard: Instant | None = None

    @property
    def frame(self) -> str:
        """Frame of the forecasts."""
        return self._map.frame

    @property
    def occupancy(self) -> OccupancyMap | None:
        """The map that is used."""
        return self._map.occupancy

    @property
    def is_waiting(self) -> bool:
        """Whether people wait for a transform."""
        return bool(self._waiting)

    @property
    def transform_age_s(self) -> float | None:
        """How much older than the latest people a transform is that they need, s; None if they need none."""
        heard = self._heard
        if heard is None or not heard.ids:
            return None
        return self._frames.age_s(heard.frame, self._map.frame, heard.stamp_s)

    @property
    def doubts(self) -> tuple[str, ...]:
        """What is wrong with many of the last people, in words."""
        return tuple(text for text in (*self._predictor.doubts, self._robot_seen.text) if text)

    @property
    def map_told(self) -> str:
        """Size of the map in words."""
        return self._map.told

    def load_place(self) -> None:
        """Go on with what the file of the place says, if there is one; what cannot be used is put aside."""
        path = self.settings.place
        if path is None or not path.exists():
            return
        try:
            self._predictor.load_place(path)
        except PedpredError as problem:
            aside = _free_name(path)
            path.replace(aside)  # it may be somebody's, and is written soon
            _log.warning("what was learned before is not used, and now %s: %s", aside, problem)
        else:
            _log.info("going on with what was learned in %s", path)

    def save_place(self) -> None:
        """Write the file of the place.

        Raises:
            OutputError: it cannot be written.
        """
        if (path := self.settings.place) is not None:
            self._predictor.save_place(path)

    def map_came(self, raw: bytes, sent_ns: int = 0) -> None:
        """Use a nav_msgs/OccupancyGrid from now on; it takes updates back, unless it came before them.

        Args:
            raw: the message.
            sent_ns: when the publisher sent it, by its clock; several subscriptions bring it several times.
        """
        is_copy = sent_ns != 0 and sent_ns == self._map.sent_ns
        if raw == self._map.raw and (is_copy or not self._map.is_updated):
            self._map.sent_ns = sent_ns
            return
        message = self._decoded(raw, TYPES[MAP])
        occupancy, frame = map_of_grid(message), frame_name(message.header.frame_id)
        if not frame:
            frame = self._map.frame
            _log.warning("the map names no frame (header.frame_id): it is taken to be in %r", frame)
        if frame != self._map.frame:
            _log.warning("the map is in %r, forecasts were in %r: all are forgotten", frame, self._map.frame)
            self._predictor.reset()
            self._odometry = None
            self.load_place()
        self._predictor.set_map(occupancy)
        self._map = _Map(frame, occupancy, raw, sent_ns, grid=message, told=told_map(occupancy))
        _log.info("map of %.1f x %.1f m in %r: %s", *occupancy.extent_m, frame, self._map.told)

    def map_update_came(self, raw: bytes) -> None:
        """Change a part of the map by a map_msgs/OccupancyGridUpdate; without a map it is left out."""
        before = self._map.grid
        if before is None:
            _log.warning("an update of the map is left out: the map has not come")
            return
        grid = updated_grid(before, self._decoded(raw, UPDATE_TYPE))
        if not np.array_equal(blocked(grid.data), blocked(before.data)):
            occupancy = map_of_grid(grid)
            self._predictor.set_map(occupancy)
            self._map.occupancy, self._map.told = occupancy, told_map(occupancy)
        self._map.grid, self._map.is_updated = grid, True

    def transforms_came(self, raw: bytes, clock_s: float, fixed: bool) -> None:
        """Take a tf2_msgs/TFMessage; `fixed` if it is of /tf_static."""
        self._frames.add(self._decoded(raw, TRANSFORMS), clock_s, fixed)

    def people_missed(self, count: int) -> None:
        """Count messages of people that were sent, and that nobody can read any more."""
        self.counts.messages += count
        self.counts.missed += count
        text = (
            "%d messages of people were lost before they were read: more come than can be read in time, or "
        )
        _log.warning(text + "the network loses them", count)

    def people_came(self, raw: bytes, clock_ns: int, now_s: float, waited_s: float = 0.0) -> None:
        """Take people, who wait for the transform of their time.

        Args:
            raw: the message.
            clock_ns: the clock of the stamps now, for people without one.
            now_s: see the class.
            waited_s: how long it lay in a queue, s; people without a stamp are of the time before.
        """
        self.counts.messages += 1
        self.heard_s = now_s
        self._is_behind = waited_s > self.settings.max_wait_s * (_CAUGHT_UP if self._is_behind else 1.0)
        if self._is_behind:
            self.counts.slow += 1
            _log.warning(
                "left out: people of %.1f s ago. Forecasts take too long: send fewer of them, or less often",
                waited_s,
            )
            return
        kind = self.settings.people_type
        with self.counts.refusing():
            message = self._decoded(raw, kind)
            instants = Instant.all_of(message, kind, clock_ns / 1e9, self.settings.class_ids)
        self.counts.detections += sum(len(one.ids) for one in instants)
        others = {label for one in instants for label in one.others}
        self.counts.others += sum(len(one.others) for one in instants)
        if others:
            text = "left out: detections of class %s; parameter class_ids says who is a person"
            _log.info(text, sorted(others))
        for one in instants:
            self._nameless.note(one.ids)
        for one in instants:
            if one.ids and one.array_frame:
                text = "people are in %r, and the headers of their detections in %r, which counts"
                _log.warning(text, one.array_frame, one.frame)
            self._queue(one, clock_ns, now_s, waited_s)

    def _queue(self, one: Instant, clock_ns: int, now_s: float, waited_s: float) -> None:
        """Let people wait for their transforms; see `people_came`."""
        one = replace(one, ids=self._nameless.named(one.ids))
        if not one.time_ns:
            _log.warning("people have no stamp: the time of their arrival is taken")
            time_ns = max(clock_ns - round(waited_s * 1e9), 0)
            one = replace(one, stamp_s=time_ns / 1e9, time_ns=time_ns)
        self.stamp_age_s = (clock_ns - one.time_ns) / 1e9 - waited_s
        self._heard = one
        if len(self._waiting) >= _MOST_WAITING:  # the first ones stay: their transforms come first
            self.counts.lost += 1
            _log.warning("people left out: %d messages wait for transforms", _MOST_WAITING)
            return
        self._waiting.append(_Waiting(now_s - waited_s, now_s, clock_ns, one.time_ns, one))

    def _decoded(self, raw: bytes, kind: str) -> Any:
        """A message.

        Raises:
            ValueRuleError: it is none of its type.
        """

        def wording(problem: str) -> ValueRuleError:
            rule = f"it must be a {kind}: does the publisher have another edition of its package? ({problem})"
            return ValueRuleError("message", f"{len(raw)} bytes", rule)

        with translate_errors(wording):
            return self._decoder.decode(raw, Connection("", kind))

    def answers(self, now_s: float) -> Iterator[Answer]:
        """What to publish for people whose transforms have come, or who have waited long enough in vain."""
        while self._waiting:
            first = self._waiting[0]
            one, target = first.instant, self._map.frame
            lack = self._frames.lack(one.frame, target, one.stamp_s) if one.ids else ""
            if lack and now_s - first.arrived_s < self.settings.transform_timeout_s:
                return
            self._waiting.popleft()
            if lack:
                self.counts.lost += 1
                waited_s = self.settings.transform_timeout_s
                _log.warning("people in %r left out: %s (waited %s s)", one.frame, lack, waited_s)
                continue
            yield from self._answered(first, target)

    def forget_waiting(self) -> None:
        """Leave out the people who wait for transforms, as when nobody is listened to any more."""
        self._waiting.clear()

    def cleared(self, clock_ns: int, after_s: float = _GONE_S) -> Iterator[Answer]:
        """Once there was no forecast for some time, publish one of nobody: costmaps keep the last grid.

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
        yield from self._contents(gone, max(of.time_ns + gone_ns, 0), self._map.frame)

    def _answered(self, waiting: _Waiting, frame: str) -> Iterator[Answer]:
        one = waiting.instant
        with self.counts.refusing():
            one, place = self._on_this_floor(one, frame)
            place = self._follow_localisation(one, place, frame)
            track_id = self._identities.number(one, place)
            times_s = np.full(len(place), one.stamp_s)
            kept, left_out = find_usable(times_s, track_id, place, self._identities.name)
            if left_out:
                _log.warning("%s", left_out)
            forecast = self._predictor.update(one.stamp_s, track_id[kept], place[kept])
        if forecast is self._latest:  # the frame was dropped
            self.counts.late += 1
            return
        self.counts.jumps += self._jumped(one.stamp_s)
        if self._latest is not None and forecast.time_s == self._latest.time_s:  # it has more people
            waiting = replace(waiting, time_ns=self._time_ns)
        self._time_ns = waiting.time_ns
        self._latest, self._shown = forecast, (forecast, waiting)
        self.counts.without_forecast += len(np.setdiff1d(track_id, forecast.track_id))
        self.counts.forecasts += 1
        self.counts.people = len(forecast)
        self.came_s, self.forecast_s = waiting.came_s, waiting.arrived_s
        if self._map.occupancy is None and self.settings.use_map and len(forecast):
            _log.warning(
                "no map has come: forecasts go through walls. Publish `map`, or set use_map to false"
            )
        yield from self._contents(forecast, waiting.time_ns, frame)

    def _on_this_floor(self, one: Instant, frame: str) -> tuple[Instant, np.ndarray]:
        """A message without the people of other floors, and the places of the others, m. [n, 2]."""
        place, most_m = self._frames.placed(one.place, one.stamp_s, one.frame, frame), self.settings.floor_m
        base = self._frames.base(one.frame, frame, one.stamp_s)
        self._robot_seen.note(base[:2], place[:, :2])
        if not most_m or not len(place):
            return one, place[:, :2]
        now_m = base[2]
        self._floor_m = now_m if np.isfinite(now_m) else self._floor_m
        away = np.abs(place[:, 2] - self._floor_m) > most_m
        if away.any():
            self.counts.elsewhere += int(away.sum())
            text = "left out: %d people more than %g m above or below %.2f m, where the robot is"
            _log.info(text, away.sum(), most_m, self._floor_m)
        ids = tuple(name for name, gone in zip(one.ids, away, strict=True) if not gone)
        return replace(one, ids=ids, place=one.place[~away]), place[~away, :2]

    def _follow_localisation(self, one: Instant, place: np.ndarray, frame: str) -> np.ndarray:
        """Move all tracks with the robot's odometry where that has jumped on the map: nobody has moved.

        Returns:
            The places as the latest localisation has them, which knows more than that of late people. [n, 2]
        """
        before, longest_s = self._odometry, self._predictor.protocol.lost_after_s
        after_s = one.stamp_s - before.time_s[0] if before is not None else np.inf
        if not one.ids:
            return place
        now = self._frames.odometry(one.frame, frame, one.stamp_s)
        is_late = -longest_s <= after_s <= TIME_TOLERANCE_S
        if not is_late:
            self._odometry = now
        if now is None or before is None or now.frame != before.frame or abs(after_s) > longest_s:
            return place
        if is_late:
            return moved(place, *before.since(now))
        turn_rad, shift = now.since(before)
        moved_m = np.hypot(*(moved(place, turn_rad, shift) - place).T)
        if (moved_m > JUMPS_MPS * after_s).any():
            correction = float(turn_rad[0]), shift[0]
            self._predictor.correct(*correction)
            self._identities.correct(*correction)
            text = "the localisation has moved %r by %.2f m in %r, and all tracks with it"
            _log.info(text, now.frame, np.hypot(*(now.origin - before.origin)[0]), frame)
        return place

    def _jumped(self, stamp_s: float) -> bool:
        """Whether the predictor has forgotten all, as time has jumped since the last forecast."""
        before, longest_s = self._latest, self._predictor.protocol.lost_after_s
        return before is not None and abs(stamp_s - before.time_s) > longest_s + TIME_TOLERANCE_S

    def _contents(self, forecast: Forecast, time_ns: int, frame: str) -> Iterator[Answer]:
        tell_rounding(forecast.predictions, _log)
        cloud = predictions_message(forecast.track_id, forecast.predictions, time_ns, frame)
        yield Answer(PREDICTIONS, PREDICTIONS_TYPE, cloud)
        names = self._identities.names
        named = [self._identities.name(int(track)) for track in forecast.track_id]
        if names.keys() - self._named.keys():
            text = json.dumps({str(number): name for number, name in names.items()})
            yield Answer(NAMES, TEXT_TYPE, {"data": text})
        self._named = names
        is_on = self.settings.publish_people
        if self._latched.wants(PEOPLE, is_on, len(forecast)):
            shown = forecast if is_on else nobody(forecast, forecast.time_s)
            content = people_content(shown, named[: len(shown)], time_ns, frame)
            yield Answer(PEOPLE, PEOPLE_TYPE, content)
        yield from self._views.answers(forecast, named, time_ns, frame, self._map.occupancy, self.settings)


def _free_name(path: Path) -> Path:
    """Where a file can be put aside: beside it, under a name that no other one has."""
    names = (f"{path.name}.unused{number or ''}" for number in count())
    return next(path.with_name(name) for name in names if not os.path.lexists(path.with_name(name)))


def told_map(occupancy: OccupancyMap) -> str:
    """Size of a map and share of its obstacles in words."""
    return "{} x {} cells, {:.1f} % blocked".format(
        *occupancy.occupied.shape, 100 * occupancy.occupied.mean()
    )
