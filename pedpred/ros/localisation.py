"""The localisation jumps on the map, and nobody has moved: the frame of the robot's odometry tells it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pedpred.geometry import rotate
from pedpred.ros.frame_tree import FrameTree
from pedpred.tracking.tracks import LOST_AFTER_S

JUMPS_MPS = 0.5
"""Faster changes of where the odometry lies on the map are jumps of the localisation; in slower ones it makes
good for wheels that slip, so that people are where they seem."""
ALWAYS = (-np.inf, np.inf)
_SPREAD_MPS = 0.1
"""People whose places are corrected after the fact move by no more than this speed for it."""


@dataclass(frozen=True)
class Poses:
    """How the frame of the odometry lies on the ground of another one: origin, m [K, 2], and yaw, rad [K]."""

    frame: str
    time_s: np.ndarray
    origin: np.ndarray
    yaw_rad: np.ndarray

    def since(self, before: Poses) -> tuple[np.ndarray, np.ndarray]:
        """How what does not move in the frame has moved in the other one: turn, rad [K], shift, m [K, 2]."""
        turn_rad = np.angle(np.exp(1j * (self.yaw_rad - before.yaw_rad)))
        return turn_rad, self.origin - rotate(before.origin, turn_rad)

    def select(self, rows: slice) -> Poses:
        """Some of them."""
        return Poses(self.frame, self.time_s[rows], self.origin[rows], self.yaw_rad[rows])


def find_poses(
    tree: FrameTree, frame: str, target: str, time_s: np.ndarray, heard_s: tuple[float, float] = ALWAYS
) -> Poses | None:
    """How the odometry that people are seen from lies in a target at some times; None: there is none.

    Args:
        tree: all transforms.
        frame: of the people.
        target: the frame in which the localisation places them.
        time_s: [K]
        heard_s: see `FrameTree.placed`.

    Returns:
        NaN where transforms are missing.
    """
    if not (odometry := tree.odometry(frame, target)):
        return None
    ends = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    start, tip = (
        tree.placed(np.tile(end, (len(time_s), 1)), time_s, odometry, target, heard_s)[:, :2] for end in ends
    )
    return Poses(odometry, time_s, start, np.arctan2(*(tip - start).T[::-1]))


def moved(place: np.ndarray, turn_rad: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """Places turned about the origin, then shifted, m. [N, 2], of [N] and [N, 2] or of one for all."""
    return np.asarray(rotate(place, turn_rad) + shift)


def without_jumps(poses: Poses, instant: np.ndarray, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places that lead to where the localisation has people after each of its jumps.

    What it has found out is spread over the time since it did so before, as the error has come, or over a
    longer one: else everybody runs at that instant.

    Args:
        poses: at the times of all messages, which rise. [K]
        instant: the message of each place, rising. [M]
        place: m. [M, 2]

    Returns:
        The places, m [M, 2], and how far each jump has moved somebody, m. [J]
    """
    place, time_s = place.copy(), poses.time_s
    gap_s = np.diff(time_s)
    turn_rad, shift = poses.select(slice(1, None)).since(poses.select(slice(-1)))
    later = instant > 0
    row = instant[later] - 1
    each_m = np.hypot(*(moved(place[later], turn_rad[row], shift[row]) - place[later]).T)
    far_m = np.zeros(len(gap_s))
    np.fmax.at(far_m, row, each_m)
    jumps = np.flatnonzero((far_m > JUMPS_MPS * gap_s) & (gap_s <= LOST_AFTER_S))
    before_s = time_s[0]
    for jump in jumps:
        end_s = time_s[jump + 1]
        span_s = max(end_s - before_s, far_m[jump] / _SPREAD_MPS)
        begun = np.searchsorted(time_s, end_s - span_s)
        first, end, after = np.searchsorted(instant, (begun, jump + 1, jump + 2))
        part = 1.0 - (end_s - time_s[instant[first:end]]) / span_s
        centre = np.nanmean(place[end:after], axis=0)
        step = moved(centre, turn_rad[jump], shift[jump]) - centre
        place[first:end] = (
            rotate(place[first:end] - centre, part * turn_rad[jump]) + centre + part[:, None] * step
        )
        before_s = end_s
    return place, far_m[jumps]
