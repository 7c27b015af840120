"""EWAP, the ETH walking-pedestrians recordings (Pellegrini et al., ICCV 2009), as a `Scene`.

A sequence is a folder with

* `obsmat.txt`: one row per pedestrian and annotated frame, the eight numbers of `COLUMNS`;
* `H.txt`: 3 x 3, image (row, column, 1) to world (x, y, w), rows and columns counted from 1;
* `map.png`: obstacles white;
* `groups.txt`: one group of pedestrian ids per line, others walk alone;
* `reference.png`: one video frame, optional.

The velocity columns are never used: they are central differences, so they contain the next annotation.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from pedpred.errors import InputError, ValueRuleError
from pedpred.files import check_input, read_picture
from pedpred.geometry import Homography
from pedpred.reading import read_recording
from pedpred.reading.errors import ContentError, add_path
from pedpred.reading.options import ReadOptions
from pedpred.reading.text import read_lines
from pedpred.scenes import Camera, OccupancyMap, Scene, Trajectories
from pedpred.settings import In, Settings, load

COLUMNS = ("frame", "id", "x", "height", "y", "v_x", "v_height", "v_y")
ALONE = -1
_FIRST_PIXEL = 1
_BRIGHTEST_FREE = 127
_MOST_CELLS = 4_000_000
_BORDER = 0.1  # how far outside the picture an annotation may lie, in sides of the picture


@dataclass(frozen=True)
class EwapSettings(Settings):
    """What the files of a sequence do not say.

    Attributes:
        frame_rate_hz: of the video.
        annotation_frames: frames between two annotations.
        resolution_m: side of a cell of the map.
        margin_m: free ground kept around all annotations and obstacles.
    """

    frame_rate_hz: Annotated[float, In("[0.001, 1e6]")]
    annotation_frames: Annotated[int, In("[1, 1000000]")]
    resolution_m: Annotated[float, In("[0.001, 100]")]
    margin_m: Annotated[float, In("[0, 1000]")]


def read_sequence(folder: Path, name: str, settings: Mapping[str, Any]) -> Scene:
    """Read one sequence.

    Args:
        folder: holds the files named above.
        name: name of the scene.
        settings: the fields of `EwapSettings`.

    Raises:
        InputError: a file is missing or wrong; it names file, line and value.
        ValueRuleError: a setting is out of range.
    """
    how: EwapSettings = load(EwapSettings, settings)
    homography = _read_homography(folder / "H.txt")
    blocked = _read_image(folder / "map.png", "L") > _BRIGHTEST_FREE
    camera = _read_camera(folder, homography, blocked.shape)
    options = ReadOptions(columns=COLUMNS, rate_hz=how.frame_rate_hz, any_speed=True)
    people = read_recording(folder / "obsmat.txt", options).scene.trajectories
    _check_in_picture(folder / "obsmat.txt", people, homography, blocked.shape)
    groups = _read_groups(folder / "groups.txt", set(people.track_id.tolist()))
    group_id = np.array([groups.get(track, ALONE) for track in people.track_id.tolist()])
    try:
        ground = occupancy_from_image(blocked, homography, people.position, how.resolution_m, how.margin_m)
    except ValueRuleError as cause:
        problem = f"{cause}: an obstacle reaches the horizon, H.txt is wrong or resolution_m too small"
        raise InputError(folder / "map.png", None, problem) from cause
    dt_s = how.annotation_frames / how.frame_rate_hz
    return Scene(name, replace(people, group_id=group_id), ground, dt_s, camera)


def merge_groups(groups: Iterable[set[int]]) -> list[set[int]]:
    """Unite groups that share a member until all are disjoint; ordered by their smallest member."""
    apart: list[set[int]] = []
    for group in groups:
        touching = [other for other in apart if other & group]
        apart = [other for other in apart if not other & group] + [group.union(*touching)]
    return sorted(apart, key=min)


def _read_homography(path: Path) -> Homography:
    check_input(path)
    with add_path(path):
        return Homography(np.loadtxt(path), first_pixel=_FIRST_PIXEL)


def _read_groups(path: Path, known: set[int]) -> dict[int, int]:
    """Return the group number of each pedestrian who is in a group."""
    check_input(path)
    groups = []
    with add_path(path):
        for line, text in enumerate(read_lines(path), start=1):
            try:
                group = {int(field) for field in text.split()}
            except ValueError as cause:
                raise ContentError(f"{cause}, expected pedestrian ids", line=line) from cause
            if not group:
                continue
            if strangers := group - known:
                raise ContentError(f"id {min(strangers)} has no row in obsmat.txt", line=line)
            groups.append(group)
    together = [group for group in merge_groups(groups) if len(group) > 1]
    return {track: number for number, group in enumerate(together) for track in group}


def _read_camera(folder: Path, homography: Homography, shape: tuple[int, ...]) -> Camera | None:
    path = folder / "reference.png"
    if not path.exists():
        return None
    picture = _read_image(path, "RGB")
    if picture.shape[:2] != shape:
        problem = f"{shape} pixels (rows, columns), but reference.png has {picture.shape[:2]}"
        raise InputError(folder / "map.png", None, problem)
    return Camera(homography, picture)


def _read_image(path: Path, mode: str) -> np.ndarray:
    return read_picture(path, mode, lambda text: InputError(path, None, f"not a readable image ({text})"))


def _check_in_picture(
    path: Path, people: Trajectories, homography: Homography, shape: tuple[int, ...]
) -> None:
    """People were annotated in the video, so that their positions must project into the picture."""
    pixels = homography.to_image(people.position)
    border = _BORDER * np.array(shape)
    outside = ~((pixels >= -border) & (pixels < shape + border)).all(axis=1)
    for row in np.flatnonzero(outside)[:1]:
        where = f"id {people.track_id[row]} at {people.time_s[row]:g} s, pixel {pixels[row].round().tolist()}"
        problem = f"{outside.sum()} positions are far outside map.png with its {shape} pixels, first {where}"
        raise InputError(path, None, problem, "Correct this row, H.txt or map.png")


def free_ground(points: np.ndarray, resolution_m: float, margin_m: float) -> OccupancyMap:
    """Make a map without obstacles around some points; its origin is a multiple of the resolution.

    Args:
        points: world frame, m. [M, 2]
        resolution_m: side of a cell, m.
        margin_m: ground kept around all points, m.

    Raises:
        ValueRuleError: the map would be absurdly large.
    """
    with np.errstate(invalid="ignore", over="ignore"):  # what is infinitely far is refused below
        first = np.floor((points.min(axis=0) - margin_m) / resolution_m)
        shape = np.ceil((points.max(axis=0) + margin_m) / resolution_m) - first
        cells, size = shape.prod(), (shape * resolution_m).round(1).tolist()
    if not cells <= _MOST_CELLS:
        raise ValueRuleError("map size [m]", size, f"it may have at most {_MOST_CELLS} cells")
    return OccupancyMap(np.zeros(shape.astype(int), dtype=bool), first * resolution_m, resolution_m)


def occupancy_from_image(
    blocked: np.ndarray, homography: Homography, points: np.ndarray, resolution_m: float, margin_m: float
) -> OccupancyMap:
    """Project an obstacle image onto the ground by inverse warp.

    The centre of each cell is looked up in the nearest pixel; outside the image is free. The map covers
    all obstacles and all given points, and its origin is a multiple of the resolution.

    Args:
        blocked: which pixels show an obstacle. [rows, columns] bool
        homography: image (row, column) <-> world.
        points: places that the map must cover, world frame, m. [M, 2]
        resolution_m: side of a cell, m.
        margin_m: ground kept around everything, m.

    Raises:
        ValueRuleError: the map would be absurdly large.
    """
    covered = np.concatenate([points, homography.to_world(np.argwhere(blocked))])
    occupancy = free_ground(covered, resolution_m, margin_m)
    centers = occupancy.center_of(np.moveaxis(np.indices(occupancy.occupied.shape), 0, -1))
    pixels = np.rint(homography.to_image(centers))
    inside = ((pixels >= 0) & (pixels < blocked.shape)).all(axis=-1)
    rows, columns = np.where(inside[..., None], pixels, 0).astype(np.int64).transpose(2, 0, 1)
    return OccupancyMap(inside & blocked[rows, columns], occupancy.origin, resolution_m)
