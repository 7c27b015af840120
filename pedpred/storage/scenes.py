"""Scenes on disk: one folder with `tracks.parquet`, `map.yaml` + `map.pgm`, `scene.json`.

pedpred writes all of them. A folder of your own may have no map, and other tracks, which
`pedpred.sources.scene_folder` reads.

A scene *set* is a folder of scene folders (the arrangements of one simulated set).
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
from PIL import Image

from pedpred.errors import InputError, brief
from pedpred.files import (
    Wording,
    atomic_write,
    read_json,
    read_picture,
    translate_errors,
    write_json,
)
from pedpred.geometry import Homography
from pedpred.scenes import Camera, OccupancyMap, Scene, Trajectories
from pedpred.storage.maps import read_map, write_map
from pedpred.storage.tracks import read_parquet_tracks, write_parquet_tracks

SCENE_SCHEMA = 1
_REMEDY = "Correct the file or write the scene again"
_ONE = "Remove one of them, or write to another folder"


def write_scene(scene: Scene, folder: Path) -> None:
    """Write a scene; `read_scene` returns an equal one.

    Raises:
        InputError: the folder holds a table of tracks, which is not replaced.
    """
    if (folder / "tracks.csv").exists():
        problem = "tracks.parquet would contradict it as soon as one of them changes"
        raise InputError(folder / "tracks.csv", "file", problem, _ONE)
    write_parquet_tracks(scene.trajectories, folder / "tracks.parquet")
    write_map(scene.occupancy, folder)
    about: dict[str, object] = {
        "schema": SCENE_SCHEMA,
        "name": scene.name,
        "detection_dt_s": scene.detection_dt_s,
    }
    if scene.unavailable is not None:
        about["unavailable"] = scene.unavailable
    if scene.stand_in is not None:
        about["stand_in"] = scene.stand_in
    if scene.camera is not None:
        about["homography"] = scene.camera.homography.matrix.tolist()
        about["first_pixel"] = scene.camera.homography.first_pixel
        _write_picture(scene.camera.picture, folder / "reference.png")
    write_json(folder / "scene.json", about)


def read_scene(folder: Path, trajectories: Trajectories | None = None) -> Scene:
    """Read one scene folder.

    Args:
        folder: as `write_scene` makes it.
        trajectories: those of the scene; None: they are in its `tracks.parquet`.

    Raises:
        InputError: a file is missing or cannot be understood; it names file and field.
    """
    path = folder / "scene.json"
    about = read_json(path, _wording(path, "file"))
    if about.get("schema") != SCENE_SCHEMA:
        raise InputError(path, "schema", f"{brief(about.get('schema'))}, expected {SCENE_SCHEMA}", _REMEDY)
    if trajectories is None:
        trajectories = read_parquet_tracks(folder / "tracks.parquet")
    free = not (folder / "map.yaml").exists()
    occupancy = OccupancyMap.free_around(trajectories.position) if free else read_map(folder)
    with translate_errors(_wording(path, "scene")):
        camera, view = None, folder / "reference.png"
        if "homography" in about and view.exists():
            picture = read_picture(view, "RGB", _wording(view, "file"))
            camera = Camera(Homography(np.array(about["homography"]), about["first_pixel"]), picture)
        remarks = (about.get("unavailable"), about.get("stand_in"))
        return Scene(about["name"], trajectories, occupancy, about["detection_dt_s"], camera, *remarks)


def scene_folders(folder: Path) -> list[Path]:
    """The folder itself if it is a scene, else the scenes in it, by name."""
    if (folder / "scene.json").exists():
        return [folder]
    folders = sorted(path.parent for path in folder.glob("*/scene.json"))
    if not folders:
        raise InputError(folder, "scene.json", "no scene is here", _REMEDY)
    return folders


def read_scenes(folder: Path) -> Iterator[Scene]:
    """All scenes of a scene folder or a scene set, one at a time."""
    return (read_scene(path) for path in scene_folders(folder))


def _write_picture(picture: np.ndarray, path: Path) -> None:
    with atomic_write(path) as new:
        Image.fromarray(picture).save(new)


def _wording(path: Path, field: str) -> Wording:
    return partial(InputError, path, field, remedy=_REMEDY)
