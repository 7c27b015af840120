"""The recordings of the comparison, as the files of the field hold them."""

from __future__ import annotations

from pathlib import Path

from pedpred.literature.settings import ComparisonSettings
from pedpred.scenes import Scene
from pedpred.sources.eth_ucy import read_text
from pedpred.sources.mirrors import NOTE


def are_available(comparison: ComparisonSettings) -> bool:
    """Whether the files are there."""
    return not Path(comparison.raw, NOTE).exists()


def read_recording(comparison: ComparisonSettings, name: str) -> Scene:
    """Read a recording; see `pedpred.sources.eth_ucy.read_text`."""
    return read_text(Path(comparison.raw), name, {**comparison.reader, "recording": name})
