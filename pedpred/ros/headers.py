"""Time and frame of detections that have a header each, beside the header of their message."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pedpred.ros.frame_tree import frame_name

_SAME_NS, _LATE_NS = 10_000_000, 500_000_000
"""Stamps that differ by less are one instant: simulators stamp each agent while they fill a message. Those
that differ from the message's by more than the second do not count: a robot leaves older people out."""

_MOST_INSTANTS = 4
"""So many instants (times in frames) at most has a message of fused sensors; with more, as where each track
has the stamp of its last detection, the message says when."""


def time_of(header: Any) -> int:
    """The stamp of a header, ns."""
    return int(header.stamp.sec * 10**9 + header.stamp.nanosec)


def by_header(message: Any, detections: Sequence[Any | None]) -> list[tuple[int, str, list[int]]]:
    """Sort the detections of a message by time and frame.

    What the header of a detection says counts, since messages define that the detection is in it; the header
    of the message says what that one leaves empty. Trackers that fuse sensors, or detectors that stamp the
    message when they send it, fill both with different values.

    Args:
        message: the header of the message.
        detections: the header of each detection; None: it has none. [N]

    Returns:
        Time (ns), frame and the rows that are in it, in order of time; one without rows for no detections.
    """
    outer = time_of(message), frame_name(message.frame_id)
    keys = [outer if header is None else _key(header, *outer) for header in detections]
    groups = _grouped(keys)
    if len(groups) > _MOST_INSTANTS and len({time_ns for time_ns, *_ in groups}) > 1 and outer[0]:
        groups = _grouped([(outer[0], frame) for _, frame in keys])
    return groups or [(*outer, [])]


def _grouped(keys: Sequence[tuple[int, str]]) -> list[tuple[int, str, list[int]]]:
    """Time, frame and rows of detections, in order of time, from the time and frame of each."""
    groups: list[tuple[int, str, list[int]]] = []
    for row in sorted(range(len(keys)), key=lambda row: (keys[row][1], keys[row][0])):
        time_ns, frame = keys[row]
        if groups and groups[-1][1] == frame and time_ns - groups[-1][0] < _SAME_NS:
            groups[-1][2].append(row)
        else:
            groups.append((time_ns, frame, [row]))
    return [(time_ns, frame, sorted(rows)) for time_ns, frame, rows in sorted(groups)]


def _key(header: Any, outer_ns: int, outer_frame: str) -> tuple[int, str]:
    """Time, ns, and frame of a detection that has a header."""
    inner_ns = time_of(header)
    near = _SAME_NS < abs(inner_ns - outer_ns) <= _LATE_NS
    counts = inner_ns > 0 and (outer_ns == 0 or near)
    return inner_ns if counts else outer_ns, frame_name(header.frame_id) or outer_frame
