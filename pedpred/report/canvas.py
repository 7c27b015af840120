"""Blank figures in one style, and their bytes: the same figure gives the same file anywhere."""

from __future__ import annotations

import io
from functools import cached_property
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox
from PIL import Image

from pedpred.files import atomic_write

DPI = 110
LARGEST_BYTES = 60_000
"""Pictures above this size are reduced to 256 colours."""

AVIF_QUALITY = 39

_PLACE_DIGITS = 6
"""Decimals of the places of axes, as shares of the figure."""

INK = "#222222"
FAINT = "#B8B8B8"
OBSTACLE = "#111111"

_STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "axes.labelsize": 9,
    "axes.edgecolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "path.simplify": True,
}

styled = matplotlib.rc_context(_STYLE)
"""Decorator of functions that draw: texts take their size from the style when they are made."""


class _Canvas(FigureCanvasAgg):
    """Draws a figure once, for all files that it is written to."""

    @cached_property
    def image(self) -> Image.Image:
        """The figure as it is now."""
        if (engine := self.figure.get_layout_engine()) is not None:
            engine.execute(self.figure)
            self._fix_layout()
        self.draw()
        return Image.fromarray(np.asarray(self.buffer_rgba()))

    def _fix_layout(self) -> None:
        """Keep the axes where they are, rounded.

        The solver of layouts orders its unknowns by their addresses in memory: the last digits differ from
        run to run, and lines with them.
        """
        self.figure.set_layout_engine("none")
        for axes in self.figure.axes:
            bounds = np.round(axes.get_position(original=True).bounds, _PLACE_DIGITS)
            axes.set_position(Bbox.from_bounds(*bounds.tolist()), which="original")


def blank(width_in: float, height_in: float) -> Figure:
    """An empty figure that belongs to no window system and no global state."""
    figure = Figure(figsize=(width_in, height_in), dpi=DPI, layout="constrained", facecolor="white")
    _Canvas(figure)
    return figure


@styled
def _image(figure: Figure) -> Image.Image:
    assert isinstance(figure.canvas, _Canvas), "it must be made by `blank`"
    return figure.canvas.image


def png_bytes(figure: Figure) -> bytes:
    """A figure of `blank` as PNG, without dates or versions in it."""
    image, buffer = _image(figure), io.BytesIO()
    image.save(buffer, "png", dpi=(DPI, DPI))
    if buffer.getbuffer().nbytes <= LARGEST_BYTES:
        return buffer.getvalue()
    reduced = io.BytesIO()
    image.convert("RGB").quantize(256, dither=Image.Dither.NONE).save(reduced, "png", optimize=True)
    return reduced.getvalue()


def avif_bytes(figure: Figure, speed: int) -> bytes:
    """A figure of `blank` as AVIF, five times smaller than the PNG: for pages that hold their pictures.

    Args:
        figure: to encode.
        speed: of the encoder, from 0, smallest files, to 10, fastest.
    """
    packed = io.BytesIO()
    _image(figure).convert("RGB").save(packed, "avif", quality=AVIF_QUALITY, speed=speed, max_threads=1)
    return packed.getvalue()


def write_png(figure: Figure, path: Path) -> None:
    """Write the figure as PNG."""
    with atomic_write(path) as new:
        new.write_bytes(png_bytes(figure))
