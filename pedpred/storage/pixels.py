"""Pixels of a map's picture as `nav2_map_server` understands them.

`map_io.cpp` there turns a picture into percentages: 100 is occupied, -1 unknown. Thresholds include their
value, as in its present version. Colours count by the mean of their channels, as in all released versions.
"""

from __future__ import annotations

import numpy as np
from PIL import Image

MODES = ("trinary", "scale", "raw")
"""Of map_server; the first is the default."""

_BLOCKED_ABOVE = 50  # per cent, as in every nav_msgs/OccupancyGrid
_BLOCK_PIXELS = 2**20
_OPAQUE = 255


def blocked_greys(mode: str, negate: bool, occupied_thresh: float, free_thresh: float) -> np.ndarray:
    """Which greys are blocked. [256] bool.

    With shade s = grey / 255 and occupancy p = 1 - s, or s if negated, in single precision:
    trinary: p >= occupied_thresh is 100, then p <= free_thresh is 0, others are unknown;
    scale: those in between are 100 (p - free_thresh) / (occupied_thresh - free_thresh), rounded;
    raw: the grey itself, unknown above 100.

    Args:
        mode: one of `MODES`.
        negate: bright is blocked.
        occupied_thresh: of p.
        free_thresh: of p.
    """
    grey = np.arange(256)
    if mode == "raw":
        return np.asarray((grey > _BLOCKED_ABOVE) & (grey <= 100))
    shade = grey.astype(np.float32) / np.float32(255)
    occupancy = shade if negate else np.float32(1) - shade
    occupied, free = occupancy >= np.float32(occupied_thresh), occupancy <= np.float32(free_thresh)
    per_cent = np.where(free, 0, np.where(occupied, 100, -1))
    if mode == "scale" and (span := np.float32(occupied_thresh - free_thresh)) > 0:
        scaled = np.floor((occupancy - np.float32(free_thresh)) / span * np.float32(100) + np.float32(0.5))
        per_cent = np.where(free | occupied, per_cent, scaled)
    return np.asarray(per_cent > _BLOCKED_ABOVE)


def blocked_cells(image: Image.Image, greys: np.ndarray, mode: str) -> np.ndarray:
    """Which pixels are blocked. [rows, columns] bool.

    Pixels that are not opaque are unknown, except in mode raw, which does not look at transparency.

    Args:
        image: of any number of bits and channels.
        greys: which greys are blocked. [256]
        mode: one of `MODES`.

    Raises:
        ValueError: pixels are fractions, whose range is unknown.
    """
    if image.mode == "F":
        raise ValueError("pixels are fractions: save the picture with 8 bits per channel")
    blocked = np.zeros((image.height, image.width), bool)
    rows = max(1, _BLOCK_PIXELS // image.width)
    for top in range(0, image.height, rows):
        block = image.crop((0, top, image.width, min(top + rows, image.height)))
        grey, opaque = _greys(block)
        blocked[top : top + rows] = greys[grey] & (opaque | (mode == "raw"))
    return blocked


def _greys(block: Image.Image) -> tuple[np.ndarray, np.ndarray | np.bool]:
    """Brightness in 8 bits, and what is opaque, both [rows, columns]."""
    if block.mode.startswith("I"):  # 16 bits
        values = np.asarray(block).astype(np.int64)
        grey = np.rint(values / 257).clip(0, 255).astype(np.uint8)
        return grey, values != block.info.get("transparency", -1)
    if block.mode in ("1", "L") and "transparency" not in block.info:
        return np.asarray(block.convert("L")), np.True_
    if block.mode in ("CMYK", "YCbCr", "LAB", "HSV"):
        block = block.convert("RGB")
    channels = np.asarray(block.convert("RGBA"))
    mean = channels[..., :3].sum(axis=-1, dtype=np.uint16) / 3
    return np.rint(mean).astype(np.uint8), channels[..., 3] == _OPAQUE
