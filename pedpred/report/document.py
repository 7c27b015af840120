"""What reports are made of: sections of texts, tables, pictures and plots, written as Markdown or as HTML.

The Markdown is written here, the HTML by the templates in `page/`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

from matplotlib.figure import Figure

from pedpred.report.canvas import write_png

NOTHING = "-"
"""Fills table cells without a figure."""


@dataclass(frozen=True)
class Whisker:
    """A mean with its interval on a scale of 0 to 100; `beyond` the scale an arrow is drawn."""

    low: float
    middle: float
    high: float
    beyond: bool = field(kw_only=True)


@dataclass(frozen=True)
class Cell:
    """A table cell."""

    text: str  # what is shown
    place: str = ""  # where the figure is in the metric files, such as `<scene>.<method>.ade_m`
    bounds: str = ""  # 95 % interval; in Markdown it follows the text, the page shows it as a tooltip
    unit: str = "m"  # of the interval
    remark: str = ""  # further words of the tooltip
    whisker: Whisker | None = None  # the interval as a drawing, on the page
    strong: bool = False

    @property
    def tip(self) -> str:
        """What the page shows when the cell is pointed at."""
        interval = f"95 % interval {self.bounds} {self.unit}" if self.bounds else ""
        return ", ".join(part for part in (interval, self.remark) if part)

    def markdown(self) -> str:
        """Text and interval."""
        text = f"**{self.text}**" if self.strong else self.text
        return f"{text} ({self.bounds})" if self.bounds else text


@dataclass(frozen=True)
class Row:
    """A table row; one about a method shows its colour, the main method's is emphasised."""

    cells: Sequence[Cell]
    method: str = ""
    main: bool = False


@dataclass(frozen=True)
class Table:
    """Rows below a header; the first `texts` columns are text, the others figures."""

    kind: ClassVar[str] = "table"
    header: Sequence[str]
    rows: Sequence[Row]
    texts: int = 1

    def markdown(self, folder: str) -> str:
        """Write a Markdown table."""
        rows = [[cell.markdown() for cell in row.cells] for row in self.rows]
        for plain, row in zip(rows, self.rows, strict=True):
            plain[0] = f"**{plain[0]}**" if row.main else plain[0]
        return markdown_table(self.header, rows, self.texts)


@dataclass(frozen=True)
class Text:
    """A paragraph in a style: "", "note", "warning" or "sentence" (a result); `**words**` are strong."""

    kind: ClassVar[str] = "text"
    text: str
    style: str = ""

    def markdown(self, folder: str) -> str:
        """The paragraph; a result is strong."""
        return f"**{self.text}**" if self.style == "sentence" else self.text


@dataclass(frozen=True)
class Picture:
    """A figure with its caption."""

    name: str  # file name without ending
    caption: str  # what is seen, and by which rule it was chosen
    figure: Figure


@dataclass(frozen=True)
class Pictures:
    """Figures, `columns` side by side."""

    kind: ClassVar[str] = "pictures"
    pictures: Sequence[Picture]
    columns: int = 1

    def markdown(self, folder: str) -> str:
        """Images, each with its caption below; several columns make a table."""
        images = [f"![{p.name}]({folder}/{p.name}.png)" for p in self.pictures]
        captions = [picture.caption for picture in self.pictures]
        if self.columns == 1:
            return "\n\n".join(text for pair in zip(images, captions, strict=True) for text in pair if text)
        cells = [f"{image}<br>{caption}" for image, caption in zip(images, captions, strict=True)]
        cells += [""] * (-len(cells) % self.columns)
        rows = [cells[k : k + self.columns] for k in range(0, len(cells), self.columns)]
        return markdown_table([""] * self.columns, rows, self.columns)


@dataclass(frozen=True)
class Section:
    """Blocks and further sections below a title; the page keeps a folded one closed until it is asked for."""

    kind: ClassVar[str] = "section"
    title: str
    blocks: Sequence[Block]
    name: str = ""
    folded: bool = False

    @property
    def pictures(self) -> Iterator[Picture]:
        """All pictures in it, in their order."""
        for block in self.blocks:
            if isinstance(block, (Section, Pictures)):
                yield from block.pictures

    def markdown(self, folder: str, level: int = 1) -> str:
        """Write the section with a heading of this level; the pictures' folder is relative to the page."""
        deeper = [
            b.markdown(folder, level + 1) if isinstance(b, Section) else b.markdown(folder)
            for b in self.blocks
        ]
        return "\n\n".join([f"{'#' * level} {self.title}", *deeper])


Block = Section | Table | Text | Pictures


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]], texts: int = 1) -> str:
    """Write a Markdown table; the first `texts` columns are text, the others are figures."""
    rule = ["---"] * texts + ["---:"] * (len(header) - texts)
    lines = [[cell.replace("|", "\\|") for cell in cells] for cells in [header, rule, *rows]]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines)


def write_pictures(section: Section, folder: Path) -> None:
    """Write all pictures of a section as PNG into a folder, which is made also where there are none."""
    folder.mkdir(parents=True, exist_ok=True)
    for picture in section.pictures:
        write_png(picture.figure, folder / f"{picture.name}.png")


def join_pages(pages: Sequence[str]) -> str:
    """Join Markdown pages below one heading; links stay as they are."""
    lowered = ["\n".join(f"#{row}" if row.startswith("#") else row for row in p.split("\n")) for p in pages]
    return "\n\n".join(["# Report", *(text.strip() for text in lowered)]) + "\n"
