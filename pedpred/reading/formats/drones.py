"""Drone recordings of the levelXdata family (inD, rounD, uniD): `NN_tracks.csv` and two files beside it.

    recordingId,trackId,frame,trackLifetime,xCenter,yCenter,heading,...
    0,0,26,0,162.75,-56.26,267.2,...

`NN_tracksMeta.csv` says which tracks are pedestrians, `NN_recordingMeta.csv` the rate; positions are metres.
"""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc

from pedpred.reading.errors import NO_PEDESTRIAN, ContentError, add_path
from pedpred.reading.head import Head
from pedpred.reading.options import ReadOptions
from pedpred.reading.table import Table, text_form
from pedpred.reading.text import read_columns

NAME = "drone recording (inD, rounD, uniD)"
_WANTED = {"id": "trackId", "frame": "frame", "x": "xCenter", "y": "yCenter"}
_TRACKS = "tracks"


def recognises(head: Head) -> bool:
    """Whether the header is that of such tracks."""
    titles = set(head.line.replace(";", ",").replace("\t", ",").split(","))
    return {"trackLifetime", *_WANTED.values()} <= titles


def read(path: Path, options: ReadOptions) -> Table:
    """Read the pedestrians; `rate_hz` of the options is used where NN_recordingMeta.csv is missing.

    Raises:
        ContentError: a column is missing, or there is no pedestrian.
        InputError: one of the other files is missing or wrong.
    """
    if _TRACKS not in path.name:
        problem = "two files beside it are found by the name of this one, which is not NN_tracks.csv"
        raise ContentError(problem, "Give the files their names, such as 00_tracks.csv")
    meta = path.with_name(path.name.replace(_TRACKS, "tracksMeta"))
    with add_path(meta):
        kinds = _columns(meta, {"id": "trackId", "class": "class"})
        walks = pc.equal(pc.utf8_lower(kinds["class"].cast(pa.string())), "pedestrian")
        pedestrians = kinds["id"].cast(pa.string()).filter(walks).combine_chunks()
    rows = _columns(path, _WANTED)
    rows = rows.filter(pc.is_in(rows["id"].cast(pa.string()), pedestrians))
    if not rows.num_rows:
        raise ContentError(f"no track is a pedestrian in {meta.name}", NO_PEDESTRIAN)
    recording = path.with_name(path.name.replace(_TRACKS, "recordingMeta"))
    if not recording.exists():
        return Table(rows, "m")
    with add_path(recording):
        return Table(rows, "m", _columns(recording, {"rate": "frameRate"})["rate"][0].as_py())


def _columns(path: Path, wanted: dict[str, str]) -> pa.Table:
    """Columns by name."""
    if not path.exists():
        raise ContentError("the file is missing", "The three files of a recording lie together")
    form, *_ = text_form(path, ReadOptions())
    if missing := [title for title in wanted.values() if title not in form.titles]:
        raise ContentError(f"no column {missing[0]}; there are {', '.join(form.titles)[:200]}")
    return read_columns(path, form, wanted)
