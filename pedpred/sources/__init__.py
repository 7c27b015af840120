"""Readers of recordings of real places, one module per format.

A reader takes the folder of one recording, the name of the scene and the `settings` of its row in
conf/places, and returns a `Scene`. To add a format, write its module and add its line to `SOURCES`,
and one to `SETTINGS` if rows are to be checked before anything is read. Files to be downloaded are listed
in conf/mirrors.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from pedpred.scenes import Scene
from pedpred.sources import eth_ucy, ewap, jupedsim, scene_folder

SOURCES: dict[str, Callable[[Path, str, Mapping[str, Any]], Scene]] = {
    "eth_ucy": eth_ucy.read_text,
    "ewap": ewap.read_sequence,
    "jupedsim": jupedsim.read_laboratory,
    "scene_folder": scene_folder.read_folder,
}

SETTINGS: dict[str, type] = {
    "eth_ucy": eth_ucy.EthUcySettings,
    "ewap": ewap.EwapSettings,
    "jupedsim": jupedsim.LaboratorySettings,
    "scene_folder": scene_folder.FolderSettings,
}
"""Format -> the dataclass of its settings, by which rows are checked before anything is read."""

__all__ = ["SETTINGS", "SOURCES"]
