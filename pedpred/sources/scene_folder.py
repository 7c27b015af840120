"""A recording of your own: a scene folder as `pedpred convert` writes it, or one with `tracks.csv`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pedpred.errors import InputError
from pedpred.reading import table
from pedpred.reading.checks import check
from pedpred.reading.errors import add_path
from pedpred.reading.names import TrackNames
from pedpred.reading.options import ReadOptions
from pedpred.reading.tracks import to_tracks
from pedpred.scenes import Scene
from pedpred.settings import load
from pedpred.storage.scenes import read_scene
from pedpred.storage.tracks import TRACK_COLUMNS


@dataclass(frozen=True)
class FolderSettings:
    """None: a scene folder contains everything."""


def read_own(folder: Path, names: TrackNames | None = None) -> Scene:
    """Read a scene folder whose tracks are in `tracks.parquet` or in `tracks.csv`.

    Args:
        folder: the folder.
        names: to be filled with the names of tracks whose ids are words.

    Raises:
        InputError: a file is missing or cannot be understood, or both tables are there; it names the file.
    """
    stored, path = folder / "tracks.parquet", folder / "tracks.csv"
    if not path.exists():
        return read_scene(folder)
    if stored.exists():
        problem = f"{stored.name} is here too, and only one can be right"
        raise InputError(path, "file", problem, "Remove one of them")
    with add_path(path):
        tracks = to_tracks(str(path), table.read(path, ReadOptions(), TRACK_COLUMNS), ReadOptions())
    if names is not None:
        names.of_number.update(tracks.names.of_number)
    return read_scene(folder, tracks.people)


def read_folder(folder: Path, name: str, settings: Mapping[str, Any]) -> Scene:
    """Read the scene in a folder.

    Args:
        folder: see `read_own`.
        name: name of the scene, whatever the folder's own is.
        settings: none, see `FolderSettings`.

    Raises:
        InputError: a file is missing or cannot be understood, or its times are not seconds.
        ValueRuleError: there are settings.
    """
    load(FolderSettings, settings)
    scene = read_own(folder)
    with add_path(folder):
        check(scene.trajectories, str(folder), any_speed=True)
    return replace(scene, name=name)
