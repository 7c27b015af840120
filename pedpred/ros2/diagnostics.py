"""The state of the node for /diagnostics."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence

import numpy as np

from pedpred.ros.scene_messages import Content, header
from pedpred.ros.tf import is_robot_base
from pedpred.ros2.counts import Counts
from pedpred.ros2.follower import Follower

DIAGNOSTICS_TYPE = "diagnostic_msgs/msg/DiagnosticArray"
OK, WARN = 0, 1
_SILENT_S = 2.0
_LATEST = 100
_MANY_LEFT_OUT = 0.1
_LATE_MS = 300.0
_WRONG_CLOCK_S, _RECORDED_S = 1.0, 12 * 3600.0
"""Stamps so far from the clock are wrong; those farther away are of a recording that is played."""


class Latencies:
    """Times from the arrival of a message of people in a queue to its forecast, of the last ones."""

    def __init__(self) -> None:
        self._taken_s: deque[float] = deque(maxlen=_LATEST)

    def add(self, taken_s: float) -> None:
        """Add one, s."""
        self._taken_s.append(taken_s)

    def median_ms(self) -> float:
        """Median, ms; NaN before the first."""
        return 1000 * float(np.median(self._taken_s)) if self._taken_s else float("nan")


def diagnose(
    follower: Follower,
    now_s: float,
    kinds: Sequence[str],
    before: Counts,
    latency_ms: float = 0.0,
    clock_ns: int = 1,
    rivals: int = 0,
) -> tuple[int, str]:
    """Level and summary: OK, or what is wrong.

    Args:
        follower: of the node.
        now_s: by the clock of `Inbox.take_people`.
        kinds: the type of each publisher of people.
        before: what had happened at the last diagnosis.
        latency_ms: from people to their forecasts, ms.
        clock_ns: that of the node; 0 where time is simulated and no clock has come.
        rivals: other publishers of `predictions`.
    """
    counts, settings, frame = follower.counts, follower.settings, follower.map.frame
    messages, left_out = counts.messages - before.messages, counts.left_out - before.left_out
    others = sorted(set(kinds) - {settings.people_type})
    published = f": {', '.join(others)} is published, people_type is {settings.people_type}" if others else ""
    age_s = follower.inbox.stamp_age_s
    is_silent = bool(kinds) and now_s - follower.inbox.read_s > _SILENT_S
    is_without = bool(kinds) and not is_silent and now_s - follower.forecast_s > _SILENT_S
    problems = {
        "no /clock, so people who have gone stay in costmaps: set use_sim_time to false": not clock_ns,
        "another node publishes forecasts here, too: end it, or give each a namespace": rivals > 0,
        "no map: forecasts go through walls": follower.map.occupancy is None and settings.use_map,
        f"forecasts are in {frame!r}, which moves with the robot: publish the map in a fixed frame, or set "
        "map_frame": is_robot_base(frame),
        "people are not published": not kinds,
        f"no people received{published}": is_silent,
        "people are received, but there is no forecast: see what is left out, and the log": is_without,
        "no detection is of a class of people: see class_ids": counts.others and not counts.detections,
        **dict.fromkeys(follower.predictor.doubts, True),
        f"of the last {messages} messages of people, {left_out} are left out": (
            left_out > _MANY_LEFT_OUT * messages
        ),
        f"forecasts come {latency_ms:.0f} ms after people: send fewer, or less often": latency_ms > _LATE_MS,
        f"people are stamped {age_s:.1f} s ago: synchronise clocks, or speed up the detector": (
            clock_ns > 0 and _WRONG_CLOCK_S < abs(age_s) < _RECORDED_S
        ),
        "time jumps, and people are forgotten: do two clocks stamp people?": counts.jumps - before.jumps > 1,
    }
    found = [text for text, is_there in problems.items() if is_there]
    if found:
        return WARN, "; ".join(found)
    return OK, "forecasts with map" if follower.map.occupancy else "forecasts"


def diagnostics_content(
    name: str, level: int, summary: str, values: Mapping[str, object], time_ns: int
) -> Content:
    """diagnostic_msgs/DiagnosticArray with one status."""
    status = {
        "level": level,
        "name": f"{name}: forecasts of people",
        "message": summary,
        "hardware_id": "pedpred",
        "values": [{"key": key, "value": str(value)} for key, value in values.items()],
    }
    return {"header": header(time_ns, ""), "status": [status]}


def status_values(follower: Follower, latencies: Latencies) -> dict[str, object]:
    """The table of a status."""
    counts = follower.counts
    return {
        "map": follower.map.text,
        "frame": follower.map.frame,
        "people": counts.people,
        "messages": counts.messages,
        "forecasts": counts.forecasts,
        "jumps of time, people forgotten": counts.jumps,
        "left out: no transform": counts.lost,
        "left out: earlier than another": counts.late,
        "left out: forecasts take too long": counts.slow,
        "left out: something is wrong with it": counts.refused,
        "left out: people without a forecast": counts.without_forecast,
        "left out: detections of other classes": counts.others,
        "left out: detections near the robot": counts.near_robot,
        "age of people when they come (s)": f"{follower.inbox.stamp_age_s:.2f}",
        "latency, median (ms)": f"{latencies.median_ms():.1f}",
    }
