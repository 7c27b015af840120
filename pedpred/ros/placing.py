"""Bring the people of a bag into the frame of its map."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.ros.detections import DetectionFrame
from pedpred.ros.frames import Transform
from pedpred.ros.tf import MAP_FRAME, Frames, is_robot_base

_TF_REMEDY = "record /tf and /tf_static up to the frame of the map, too"
_SENSOR = re.compile(r"base_|_link|laser|lidar|velodyne|ouster|livox|camera|scan|realsense|zed")
"""In names of frames that robots carry, mostly."""


def place_people(
    detections: Sequence[DetectionFrame],
    grid: str | None,
    tree: Frames,
    transform: Transform | None,
    warn: Callable[[str], object],
) -> list[np.ndarray]:
    """Bring detections into the frame of the map, or without a map into `map` or the topmost frame.

    Args:
        detections: the people of each message.
        grid: the map's frame; None without a map.
        tree: all transforms.
        transform: of the people's frame in the map's; of a frame that moves, of the topmost one.
        warn: called if detections have no transform, or if a sensor's frame has none at all.

    Returns:
        Positions of each message, m; NaN where a transform is missing. [n, 2] each

    Raises:
        ValueRuleError: it is not known how the frames of people and map lie, transforms are missing at all
            times, or z is not the height.
    """
    targets = {name: _target(name, grid, tree, transform) for name in {each.frame for each in detections}}
    _check_targets(set(targets.values()), grid, transform)
    counts = [len(each.ids) for each in detections]
    points = np.concatenate([each.positions for each in detections])
    time_s = np.repeat([each.time_s for each in detections], counts)
    frames = np.repeat([each.frame for each in detections], counts)
    for name, target in targets.items():
        rows = np.flatnonzero(frames == name)
        if name != target:
            points[rows] = _moved(points[rows], time_s[rows], name, target, tree, warn)
        if target != grid and transform is None and _SENSOR.search(target):
            warn(f"people are in {name!r}, without transforms: if it moves, {_TF_REMEDY}")
    placed = points[:, :2] if transform is None else transform.to_map(points[:, :2])
    return np.split(placed, np.cumsum(counts)[:-1])


def _target(frame: str, grid: str | None, tree: Frames, transform: Transform | None) -> str:
    """The frame into which people are brought: the map's, or the topmost one where that is unknown."""
    above = tree.chain(frame)
    reached = grid is not None and tree.chain(grid)[-1] == above[-1]
    if transform is not None:
        if reached and tree.moves(frame):
            rule = f"{frame!r} moves, as /tf says, and /tf leads to {grid!r}: leave --transform out"
            raise ValueRuleError("transform", vars(transform), rule)
        return above[-1] if tree.moves(frame) else frame
    if reached:
        return str(grid)
    if grid is None:
        return MAP_FRAME if MAP_FRAME in above else above[-1]
    if tree.moves(frame) or is_robot_base(above[-1]):
        frames = f"people in {frame!r}, which /tf brings to {above[-1]!r}, map in {grid!r}"
        rule = f"nothing says how these lie: {_TF_REMEDY}, or leave the bag's maps out (--map-topic '')"
        raise ValueRuleError("frame_id", frames, rule)
    return frame


def _check_targets(targets: set[str], grid: str | None, transform: Transform | None) -> None:
    """Check that all people come into one frame, which is that of the map, and has z upwards."""
    for target in targets:
        if "optical" in target:
            rule = f"z of an optical frame looks forward, not up: {_TF_REMEDY}"
            raise ValueRuleError("frame_id", target, rule)
    if len(targets) > 1:
        raise ValueRuleError("frame_id", sorted(targets), "people must be in one frame: record them in one")
    if transform is None and grid is not None and targets != {grid}:
        frames = f"people in {targets.pop()!r}, map in {grid!r}"
        pose = "the pose of the people's frame in the map's, x, y and yaw (--transform)"
        rule = f"both must be in one frame: record /tf that leads from one to the other, or give {pose}"
        raise ValueRuleError("frame_id", frames, rule)


def _moved(
    points: np.ndarray,
    time_s: np.ndarray,
    frame: str,
    target: str,
    tree: Frames,
    warn: Callable[[str], object],
) -> np.ndarray:
    """Points in another frame, m; NaN where a transform is missing. [n, 3]."""
    moved = tree.placed(points, time_s, frame, target)
    lost = np.isnan(moved).any(axis=1)
    if lost.all():
        rule = tree.explain_missing(frame, target, float(time_s[0]))
        raise ValueRuleError("transform", f"none at {time_s[0]} s", f"{rule}: {_TF_REMEDY}")
    if lost.any():
        text = f"{lost.sum()} of {len(lost)} detections, without /tf from {frame!r} to {target!r}"
        warn(f"left out: {text}, the first at {time_s[lost][0]} s")
    return moved
