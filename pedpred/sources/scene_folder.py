"""A recording of your own: a scene folder as `pedpred convert` writes it, or one with `tracks.csv`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from pedpred.errors import ValueRuleError
from pedpred.scenes import Scene
from pedpred.storage.scenes import read_scene


def read_folder(folder: Path, name: str, settings: Mapping[str, Any]) -> Scene:
    """Read the scene in a folder.

    Args:
        folder: see `pedpred.storage.scenes`.
        name: name of the scene, whatever the folder's own is.
        settings: none.

    Raises:
        StorageError: a file is missing or cannot be understood; the message names file and field.
        ValueRuleError: there are settings.
    """
    if settings:
        raise ValueRuleError("settings", dict(settings), "a scene folder has none")
    return replace(read_scene(folder), name=name)
