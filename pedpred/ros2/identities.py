"""Who is who among the people of a stream of messages: by their ids, or by where they are."""

from __future__ import annotations

import logging
from collections import deque

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.geometry import rotate
from pedpred.ros.assignment import NearestTracks
from pedpred.ros.detections import Instant
from pedpred.ros.identity import find_exchanged
from pedpred.ros.people import TrackNumbers
from pedpred.tracking.tracks import LOST_AFTER_S, jumped

UNNAMED_TYPES = ("geometry_msgs/msg/PoseArray", "people_msgs/msg/PositionMeasurementArray")
"""Detections of these types say nothing, or nothing that lasts, about who is who."""
_REMEMBERED_S = 2 * LOST_AFTER_S
"""A name that is not used for so long loses its number: its person is lost, too."""
_MESSAGES, _JUDGED, _OF_A_MESSAGE, _FLEETING = 10, 100, 20, 0.95
"""An id is known if it is in one of so many messages before. Of the last so many detections, of which so many
are of one message at most, a larger share without a known id means that ids do not stay with people: once, a
tracker that starts again names a whole crowd anew."""
_LATEST, _JUMPY, _JUMPING = 20, 10, 0.2
"""So do jumps, farther than anybody can move or to where others were, in more than so many of the last
messages, of a larger share of their detections."""
_NAMELESS = -(2**62)
"""Numbers of people without an id begin here, where others have one or may get one: no name has these."""
_log = logging.getLogger(__name__)


class Identities:
    """Numbers people, and remembers the names of those who have one.

    Args:
        how: `NodeSettings.identities`.
        kind: type of the messages.
    """

    def __init__(self, how: str, kind: str):
        self._how, self._kind = how, kind
        self._assigns, self._nearest, self._numbers = how == "assigned", NearestTracks(), TrackNumbers()
        self._first = 0 if how == "assigned" or kind in UNNAMED_TYPES else _NAMELESS
        self._used_s: dict[str, float] = {}
        self._names: dict[int, str] = {}
        self._unclear: deque[bool] = deque(maxlen=_MESSAGES)
        self._recent: deque[dict[str, tuple[float, np.ndarray]]] = deque(maxlen=_MESSAGES)
        self._new: deque[bool] = deque(maxlen=_JUDGED)
        self._jumping: deque[tuple[int, int]] = deque(maxlen=_LATEST)

    @property
    def names(self) -> dict[int, str]:
        """Number -> name of people who are there, or were just there, and whose name is not a number."""
        return self._names

    def name(self, number: int) -> str:
        """The name of a person of that number, or what stands for it: #1 is nobody's number.

        Those who are there have different ones: if somebody is named #1, the first one without a name is ##1.
        """
        if number in self._names or number >= _NAMELESS // 2:
            return self._names.get(number, str(number))
        without = f"#{number - _NAMELESS}"
        while without in self._used_s:
            without = f"#{without}"
        return without

    def number(self, one: Instant, place: np.ndarray) -> np.ndarray:
        """Number the people of a message. [D] int64.

        Args:
            one: the message.
            place: where they are, in a frame that does not move, m. [D, 2]

        Raises:
            ValueRuleError: ids are asked for, and some have none or share one.
        """
        if self._how != "assigned":
            self._judge(one, place)
        if self._assigns:
            _log.warning(
                "people have no ids that say who is who: the nearest one is taken, who may be another"
            )
            self._names = {}
            return self._first + self._nearest.assign(one.stamp_s, place)
        return self._named(one, place)

    def correct(self, turn_rad: float, shift: np.ndarray) -> None:
        """See `NearestTracks.correct`."""
        self._nearest.correct(turn_rad, shift)
        for known in self._recent:
            for name, (seen_s, at) in known.items():
                known[name] = seen_s, rotate(at, np.float64(turn_rad)) + shift

    def _judge(self, one: Instant, place: np.ndarray) -> None:
        """Decide whether ids say who is who; if not, and they are asked for, say so.

        They do not while most of the last messages have none; then they do once none of these lacks them, as
        where a tracker names people some time after it has found them.
        """
        names = [name for name in one.ids if name]
        unnamed = not names or len(set(names)) < len(names)
        if self._how == "given" and one.ids and unnamed:
            rule = "each person needs an id of his or her own; or set identities to auto"
            raise ValueRuleError("id", list(one.ids), rule)
        if one.ids:
            self._unclear.append(unnamed)
        fleeting, jumping = self._fleeting(names), self._jumps(one, place)
        if fleeting:
            _log.warning(
                "ids do not stay with people: of the last %d detections, %d have an id of their own",
                *(len(self._new), sum(self._new)),
            )
        if jumping:
            _log.warning(
                "ids do not stay with people: in %d of %d messages, some are elsewhere than anybody can have "
                "moved, or where others were: do two trackers give the same ids? "
                "Or are positions not in metres?",
                *(sum(count > 0 for count, _ in self._jumping), len(self._jumping)),
            )
        if one.ids:
            self._recent.append(_seen(one, place))
        most = 0 if self._assigns else len(self._unclear)
        without = 2 * sum(self._unclear) > most or self._kind in UNNAMED_TYPES
        assigns = self._how == "auto" and (without or fleeting or jumping)
        if self._assigns and not assigns:
            _log.info("people have ids now, which are taken from here on")
        self._assigns = assigns

    def _fleeting(self, names: list[str]) -> bool:
        """Whether hardly any id lasts from one message to the next."""
        if self._recent:
            new = [not any(name in known for known in self._recent) for name in names]
            self._new.extend(new[:_OF_A_MESSAGE])
        return len(self._new) == _JUDGED and sum(self._new) > _FLEETING * _JUDGED

    def _jumps(self, one: Instant, place: np.ndarray) -> bool:
        """Whether many ids are elsewhere again and again."""
        before = {name: seen for known in self._recent for name, seen in known.items()}
        pairs = [(before[name], seen) for name, seen in _seen(one, place).items() if name in before]
        if pairs:
            old_s, old, new_s, new = (
                np.array(values) for values in zip(*((*a, *b) for a, b in pairs), strict=True)
            )
            gap_s = np.abs(new_s - old_s)
            elsewhere = jumped(old, new, gap_s) | find_exchanged(old, new, gap_s)
            self._jumping.append((int(elsewhere.sum()), len(pairs)))
        found, judged = np.reshape(self._jumping, (-1, 2)).sum(axis=0)
        return sum(count > 0 for count, _ in self._jumping) > _JUMPY and found > _JUMPING * judged

    def _named(self, one: Instant, place: np.ndarray) -> np.ndarray:
        for name in [n for n, used_s in self._used_s.items() if abs(one.stamp_s - used_s) > _REMEMBERED_S]:
            self._numbers.forget(name)
            del self._used_s[name]
        self._used_s |= dict.fromkeys(filter(None, one.ids), one.stamp_s)
        numbers = {name: self._numbers.number(name) for name in self._used_s}
        self._names = {number: name for name, number in numbers.items() if number < 0}
        numbered = np.array([numbers.get(name, 0) for name in one.ids], np.int64)
        nameless = np.array([not name for name in one.ids], bool)
        if nameless.any():
            _log.warning(
                "%d of %d people have no id: the nearest one without an id is taken",
                nameless.sum(),
                len(numbered),
            )
            numbered[nameless] = self._first + self._nearest.assign(one.stamp_s, place[nameless])
        return numbered


def _seen(one: Instant, place: np.ndarray) -> dict[str, tuple[float, np.ndarray]]:
    """Id -> when and where, of those who have one; of several with the same one the first."""
    named = [(name, (one.stamp_s, at)) for name, at in zip(one.ids, place, strict=True) if name]
    return dict(reversed(named))
