"""The picture of the pipeline: families of stages in columns, with arrows that go around them."""

from __future__ import annotations

from collections.abc import Sequence

import networkx as nx
import numpy as np
from grandalf.graphs import Edge, Graph, Vertex
from grandalf.layouts import SugiyamaLayout, VertexViewer
from grandalf.routing import EdgeViewer
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch
from matplotlib.path import Path as Corners

from pedpred.report.canvas import FAINT, INK, blank, styled

PIXELS_PER_INCH = 95.0
LINE, LETTER = 13.0, 6.2
"""Height of a line and mean width of a letter of a label, pixels."""

PADDING, BETWEEN, COLUMNS_APART, LANE = 12.0, 6.0, 44.0, 12.0
"""Around a label, between two boxes of a column, between columns, and width of a passing arrow; pixels."""

SWEEPS = 12
"""Over all columns, in which boxes are sorted so that few arrows cross."""

Point = tuple[float, float]
"""To the right and upwards, pixels."""


class Box(Vertex):
    """A family. The layout iterates over sets of boxes, so their hashes are numbers rather than addresses."""

    def __init__(self, name: str, number: int):
        super().__init__(name)
        self.number = number
        width, height = size_of(name)
        self.view = VertexViewer(w=height, h=width)  # the layout goes downwards; the picture, to the right

    def __hash__(self) -> int:
        return self.number


class Arrow(Edge):
    """From one family to another; see `Box` for its hash."""

    def __init__(self, one: Box, other: Box, number: int):
        super().__init__(one, other)
        self.number = number
        self.view = EdgeViewer()

    def __hash__(self) -> int:
        return self.number


class Layout:
    """Where families and arrows are (Sugiyama et al. 1981).

    Attributes:
        at: family -> middle of its box.
        arrows: corners of each arrow, the first one at the right side of the box that it leaves.
    """

    def __init__(self, flow: nx.DiGraph):
        """Arrange families whose graph is connected and has no loops."""
        boxes = {name: Box(name, number) for number, name in enumerate(sorted(flow))}
        ends = enumerate(sorted(flow.edges))
        edges = [Arrow(boxes[one], boxes[other], number) for number, (one, other) in ends]
        (connected,) = Graph([*boxes.values()], edges).C
        layout = SugiyamaLayout(connected)
        layout.xspace, layout.yspace, layout.dw = BETWEEN, COLUMNS_APART, LANE
        layout.init_all(optimize=True)
        layout.draw(SWEEPS)
        layout.draw_edges()
        self.at: dict[str, Point] = {name: box.view.xy[::-1] for name, box in boxes.items()}
        widest = (max(size_of(name)[0] for name in flow) + PADDING) / 2
        self.arrows = [self._around(edge, widest) for edge in edges]

    def _around(self, edge: Edge, beside: float) -> list[Point]:
        """Corners of an arrow, which turns only between columns."""
        (one, other), (_, *passed, _) = edge.v, edge.view._pts
        (y_one, x_one), (y_other, x_other) = one.view.xy, other.view.xy
        return [
            (x_one + one.view.h / 2, y_one),
            (x_one + beside, y_one),
            *((x + side, y) for y, x in passed for side in (-beside, beside)),
            (x_other - beside, y_other),
            (x_other - other.view.h / 2, y_other),
        ]


def lines_of(name: str) -> Sequence[str]:
    """Split the name of a family into the lines of its label."""
    return name.split("_")


def size_of(name: str) -> tuple[float, float]:
    """Width and height of the box of a family, pixels."""
    lines = lines_of(name)
    return LETTER * max(map(len, lines)) + PADDING, LINE * len(lines) + PADDING


@styled
def draw_families(flow: nx.DiGraph) -> Figure:
    """Draw families of stages from left to right, with an arrow to each from those that it reads."""
    layout = Layout(flow)
    ends = [(x + side * size_of(name)[0], y) for name, (x, y) in layout.at.items() for side in (-1, 1)]
    corners = np.array([*ends, *(corner for arrow in layout.arrows for corner in arrow)])
    low, high = corners.min(axis=0) - 2 * PADDING, corners.max(axis=0) + 2 * PADDING
    figure = blank(*((high - low) / PIXELS_PER_INCH))
    axes = figure.subplots()
    for arrow in layout.arrows:
        axes.add_patch(
            FancyArrowPatch(path=Corners(arrow), arrowstyle="-|>", mutation_scale=8, color=FAINT, shrinkB=0)
        )
    for name, where in layout.at.items():
        box = {"boxstyle": "round", "facecolor": "white", "edgecolor": INK}
        axes.annotate("\n".join(lines_of(name)), where, ha="center", va="center", bbox=box, fontsize=8)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    axes.axis("off")
    return figure
