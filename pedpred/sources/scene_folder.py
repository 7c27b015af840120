"""A recording of your own: a scene folder as `pedpred convert` writes it, or one with `tracks.csv`."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pedpred.errors import ValueRuleError
from pedpred.fields import parsed
from pedpred.scenes import Scene
from pedpred.sources.single_file import check_clock
from pedpred.storage.scenes import read_scene


@dataclass(frozen=True)
class FolderSettings:
    """A scene folder says everything itself."""


def read_folder(folder: Path, name: str, settings: Mapping[str, Any]) -> Scene:
    """Read the scene in a folder.

    Args:
        folder: see `pedpred.storage.scenes`.
        name: name of the scene, whatever the folder's own is.
        settings: none, see `FolderSettings`.

    Raises:
        StorageError: a file is missing or cannot be understood; the message names file and field.
        SourceError: the times are no seconds.
        ValueRuleError: there are settings.
    """
    parsed(FolderSettings, settings)
    scene = read_scene(folder)
    with suppress(ValueRuleError):  # nobody was detected twice
        check_clock(folder, scene.trajectories.usual_interval_s())
    return replace(scene, name=name)
