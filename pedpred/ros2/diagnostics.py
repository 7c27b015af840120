"""What a node says of itself on /diagnostics."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Mapping

import numpy as np

from pedpred.ros.frame_tree import is_robots
from pedpred.ros.scene_messages import Content, header
from pedpred.ros2.follower import Counts, Follower

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
        """Note one, s."""
        self._taken_s.append(taken_s)

    def median_ms(self) -> float:
        """Median, ms; NaN before the first."""
        return 1000 * float(np.median(self._taken_s)) if self._taken_s else float("nan")


def diagnose(
    follower: Follower,
    now_s: float,
    publishers: int,
    before: Counts,
    kinds: Collection[str] = (),
    latency_ms: float = 0.0,
    clock_ns: int = 1,
    rivals: int = 0,
) -> tuple[int, str]:
    """Level and summary: OK, or what is wrong.

    Args:
        follower: of the node.
        now_s: by the clock of `Follower.people_came`.
        publishers: how many there are of the people's topic.
        before: what had happened at the last diagnosis.
        kinds: the types that they publish.
        latency_ms: from people to their forecasts, ms.
        clock_ns: that of the node; 0 where time is simulated and no clock has come.
        rivals: other publishers of `predictions`.
    """
    problems = []
    if not clock_ns:
        problems.append(
            "nobody publishes /clock: people who have gone stay in costmaps. Set use_sim_time to false"
        )
    if rivals > 0:
        problems.append("another node publishes forecasts here, too: end it, or give each a namespace")
    if follower.occupancy is None and follower.settings.use_map:
        problems.append("no map: forecasts go through walls")
    if is_robots(follower.frame):
        problems.append(
            f"forecasts are in {follower.frame!r}, which moves with the robot: who stands seems to walk. "
            "Publish the map in a frame that stands, or set map_frame"
        )
    if publishers == 0:
        problems.append("nobody publishes people")
    elif now_s - follower.heard_s > _SILENT_S:
        others = sorted(set(kinds) - {follower.settings.people_type})
        published = f": {', '.join(others)} is published, people_type is {follower.settings.people_type}"
        problems.append("no people heard" + (published if others else ""))
    elif now_s - follower.forecast_s > _SILENT_S:
        problems.append("people are heard, but there is no forecast: see what is left out, and the log")
    if follower.counts.others and not follower.counts.detections:
        problems.append("no detection so far is of a class of people: see the log, and class_ids")
    problems.extend(follower.doubts)
    messages = follower.counts.messages - before.messages
    left_out = follower.counts.left_out - before.left_out
    if left_out > _MANY_LEFT_OUT * messages:
        problems.append(f"of the last {messages} messages of people, {left_out} are left out")
    if latency_ms > _LATE_MS:
        problems.append(f"forecasts come {latency_ms:.0f} ms after people: send fewer of them, or less often")
    if clock_ns and _WRONG_CLOCK_S < abs(follower.stamp_age_s) < _RECORDED_S:
        problems.append(
            f"people are stamped {follower.stamp_age_s:.1f} s ago: are clocks of two computers apart, or do "
            "detections come late?"
        )
    if follower.counts.jumps - before.jumps > 1:
        problems.append("time jumps again and again, and all are forgotten: do two clocks stamp people?")
    return (
        (WARN, "; ".join(problems))
        if problems
        else (OK, "forecasts with map" if follower.occupancy else "forecasts")
    )


def diagnostics_content(
    name: str, level: int, summary: str, values: Mapping[str, object], time_ns: int
) -> Content:
    """diagnostic_msgs/DiagnosticArray with one status."""
    pairs = [{"key": key, "value": str(value)} for key, value in values.items()]
    status = {
        "level": level,
        "name": f"{name}: forecasts of people",
        "message": summary,
        "hardware_id": "pedpred",
    }
    return {"header": header(time_ns, ""), "status": [status | {"values": pairs}]}


def told_values(follower: Follower, latencies: Latencies) -> dict[str, object]:
    """What stands in the table of a status."""
    counts, age_s = follower.counts, follower.transform_age_s
    return {
        "map": follower.map_told,
        "frame": follower.frame,
        "people": counts.people,
        "messages": counts.messages,
        "forecasts": counts.forecasts,
        "jumps of time, all forgotten": counts.jumps,
        "left out: no transform": counts.lost,
        "left out: earlier than another": counts.late,
        "left out: forecasts take too long": counts.slow,
        "left out: something is wrong with it": counts.refused,
        "left out: lost before they were read": counts.missed,
        "left out: people without a forecast": counts.without_forecast,
        "left out: detections of other classes": counts.others,
        "left out: people of other floors": counts.elsewhere,
        "age of people when they come (s)": f"{follower.stamp_age_s:.2f}",
        "latency, median (ms)": f"{latencies.median_ms():.1f}",
        "age of /tf (s)": "not needed" if age_s is None else f"{age_s:.2f}",
    }
