"""A recording of your own: a scene folder as `pedpred convert` writes it, or one with `tracks.csv`."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pedpred.errors import StorageError, ValueRuleError
from pedpred.fields import parsed
from pedpred.scenes import Scene
from pedpred.sources.times import check_clock
from pedpred.storage.scenes import read_scene
from pedpred.tables.options import TableOptions
from pedpred.tables.reading import read_table


@dataclass(frozen=True)
class FolderSettings:
    """A scene folder says everything itself."""


def read_own(folder: Path, options: TableOptions | None = None) -> Scene:
    """Read a scene folder whose tracks are in `tracks.parquet` or in `tracks.csv`.

    Args:
        folder: the folder.
        options: takes the names of tracks.

    Raises:
        StorageError: a file is missing or cannot be understood, or both tables are there; it names the file.
        SourceError: the table cannot be understood.
    """
    stored, table = folder / "tracks.parquet", folder / "tracks.csv"
    if not table.exists():
        return read_scene(folder)
    if stored.exists():
        problem = f"{stored.name} is here too, and only one can be right"
        raise StorageError(table, "file", problem, "Remove one of them")
    return read_scene(folder, read_table(table, options))


def read_folder(folder: Path, name: str, settings: Mapping[str, Any]) -> Scene:
    """Read the scene in a folder.

    Args:
        folder: see `read_own`.
        name: name of the scene, whatever the folder's own is.
        settings: none, see `FolderSettings`.

    Raises:
        StorageError: a file is missing or cannot be understood; the message names file and field.
        SourceError: the times are not seconds.
        ValueRuleError: there are settings.
    """
    parsed(FolderSettings, settings)
    scene = read_own(folder)
    with suppress(ValueRuleError):  # nobody was detected twice
        check_clock(folder, scene.trajectories.usual_interval_s())
    return replace(scene, name=name)
