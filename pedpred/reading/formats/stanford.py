"""Annotations of the Stanford Drone Dataset (Robicquet et al., ECCV 2016): boxes in pixels.

    track xmin ymin xmax ymax frame lost occluded generated "Pedestrian"

People are at the centres of their boxes. Boxes outside the picture (`lost`) are left out.
"""

from __future__ import annotations

import re
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc

from pedpred.reading.head import Head
from pedpred.reading.options import PIXELS, ReadOptions
from pedpred.reading.table import Table
from pedpred.reading.text import BLANKS, TextForm, read_columns

NAME = "Stanford Drone Dataset"
_TITLES = ("track", "xmin", "ymin", "xmax", "ymax", "frame", "lost", "occluded", "generated", "label")
_ROW = re.compile(r'\d+( -?\d+(\.\d+)?){4} \d+ [01] [01] [01] ("\w+"|[A-Z]\w+)')
_USUAL_HZ = 30.0


def recognises(head: Head) -> bool:
    """Whether one of the first lines is such a box, with blanks, tabs or commas between the numbers."""
    return any(_ROW.fullmatch(" ".join(line.replace(",", " ").split())) for line in head.lines[:10])


def read(path: Path, options: ReadOptions) -> Table:
    """Read the boxes of all classes; the rate is 30 Hz unless `options` says another one."""
    delimiter = "," if "," in Head.of(path).line else BLANKS
    wanted = {title: title for title in _TITLES if title not in ("occluded", "generated")}
    boxes = read_columns(path, TextForm(_TITLES, delimiter), wanted, ("track", "label"))
    middle = {axis: boxes[f"{axis}min"].to_numpy() / 2 + boxes[f"{axis}max"].to_numpy() / 2 for axis in "xy"}
    rows = pa.table({"frame": boxes["frame"], "id": boxes["track"], "class": boxes["label"], **middle})
    seen = pc.not_equal(boxes["lost"], 1.0)
    return Table(rows.filter(seen), PIXELS, options.rate_hz or _USUAL_HZ)
