"""Reading scenes in any supported format."""

from __future__ import annotations

from pathlib import Path

from pedpred.errors import StorageError, ValueRuleError
from pedpred.ros import is_bag, read_bag, read_recording
from pedpred.scenes import OccupancyMap, Scene
from pedpred.storage.scenes import read_scene, read_tracks_csv


def read_any(path: Path, topic: str | None = None) -> Scene:
    """Read a scene folder, a CSV file of tracks (on free ground), a recording or a ROS bag.

    Args:
        path: its name determines the format.
        topic: of a bag's people; an .mcap file is read as a bag if one is given.

    Raises:
        StorageError, SourceError: the file is missing, damaged or of another format.
    """
    if is_bag(path) or (path.suffix == ".mcap" and topic is not None):
        return read_bag(path, topic)
    if path.is_dir():
        return read_scene(path)
    if path.suffix != ".csv":
        return read_recording(path)
    trajectories = read_tracks_csv(path)
    try:
        dt_s = trajectories.usual_interval_s()
    except ValueRuleError as cause:
        raise StorageError(path, "table", str(cause), "A track needs several detections") from cause
    return Scene(path.stem, trajectories, OccupancyMap.free_around(trajectories.position), dt_s)
