"""Hooks of mkdocs.yml: pages of the root, reports, pictures outside docs/, equations, words that stay whole.

Links to files that are not part of the site (code, configuration) become plain names.
"""

from __future__ import annotations

import posixpath
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.structure.files import File

ROOT_PAGES = {"architecture.md": "ARCHITECTURE.md", "changelog.md": "CHANGELOG.md"}
"""Page of the site -> file in the project's root."""

REPORTS, PLAYER = "reports/", "reports/index.html"
"""Folder whose Markdown files are pages of the site, and the page with a player of its own."""

_LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)\s#]*)(#[^)\s]*)?\)")
_CODE = re.compile(r"(```.*?```|`[^`\n]*`)", re.DOTALL)
_BLOCK, _TEXT = re.compile(r"<(td|pre)\b.*?</\1>", re.DOTALL), re.compile(r">[^<]+<")
_WHOLE = {
    "td": re.compile(r"\(-?[\d.]+-[\d.]+\)"),
    "pre": re.compile(r"(?<![\w-])--?[a-z][\w-]*"),
}
"""What is not divided between two lines: intervals of figures, and options."""
_TABLE, _TITLE, _ROW = (re.compile(rf"<{tag}\b.*?</{tag}>", re.DOTALL) for tag in ("table", "th", "tr"))
_MOST_COLUMNS = 4
"""Wider tables become cards on a phone, see `docs/site.css`."""
_EQUATION = re.compile(r"\$\$(.+?)\$\$|(?<![\w$])\$([^$\n]+)\$(?!\w)", re.DOTALL)


def on_files(files: Any, config: Any) -> Any:
    """Add the pages of the root, the reports, and the pictures that pages show."""
    root = Path(config["config_file_path"]).parent
    for page, source in ROOT_PAGES.items():
        files.append(File.generated(config, page, content=(root / source).read_text()))
    for report in sorted((root / REPORTS).rglob("*.md")):
        name = report.relative_to(root).as_posix()
        files.append(File.generated(config, name, content=report.read_text()))
    files.append(File.generated(config, PLAYER, abs_src_path=str(root / PLAYER)))
    pictures = {
        picture
        for file in list(files.documentation_pages())
        for mark, target in _targets(file.content_string)
        if mark and not (picture := _in_project(file.src_uri, target)).startswith("docs/")
    }
    for picture in sorted(pictures):
        files.append(File.generated(config, picture, abs_src_path=str(root / picture)))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """Rewrite links and equations of a page."""
    source = page.file.src_uri
    text = _LINK.sub(lambda link: _rewritten(link, source), markdown)
    parts = _CODE.split(text)
    return "".join(part if k % 2 else _EQUATION.sub(_mathml, part) for k, part in enumerate(parts))


def on_page_content(html: str, page: Any, config: Any, files: Any) -> str:
    """Keep intervals in cells and options in commands on one line; give cells of wide tables their titles."""
    return _BLOCK.sub(_without_breaks, _TABLE.sub(_titled, html))


def _without_breaks(block: re.Match[str]) -> str:
    """A cell or a block of code, in which spans mark what stays on one line."""
    whole = _WHOLE[block[1]]
    return _TEXT.sub(lambda text: whole.sub(r'<span class="whole">\g<0></span>', text[0]), block[0])


def _targets(markdown: str) -> Iterator[tuple[str, str]]:
    """Yield ("!" or "", target) of every link within the project."""
    for mark, _, target, _ in _LINK.findall(markdown):
        if target and "://" not in target:
            yield mark, target


def _in_project(page: str, target: str) -> str:
    """Path of a link's target in the project; links of root pages and of reports start at the root."""
    folder = posixpath.dirname(page)
    if page not in ROOT_PAGES and not page.startswith(REPORTS):
        folder = posixpath.join("docs", folder)
    return posixpath.normpath(posixpath.join(folder, target))


def _rewritten(link: re.Match[str], page: str) -> str:
    """Return the link as it must be in the site."""
    mark, text, target, anchor = link[1], link[2], link[3], link[4] or ""
    if not target or "://" in target:
        return link[0]
    path = _in_project(page, target)
    there = {source: name for name, source in ROOT_PAGES.items()}
    if path.startswith("docs/"):
        path = path.removeprefix("docs/")
    elif path in there:
        path = there[path]
    elif not mark and not (path.startswith(REPORTS) and path.endswith((".md", ".html"))):
        return f"`{path}`" if text.strip("`/") in path else f"{text} (`{path}`)"
    here = posixpath.relpath(path, posixpath.dirname(page) or ".")
    return f"{mark}[{text}]({here}{anchor})"


def _titled(table: re.Match[str]) -> str:
    """A wide table whose cells, but the first of each row, have the title of their column."""
    titles = [re.sub(r"<[^>]*>", "", title).replace('"', "&quot;") for title in _TITLE.findall(table[0])]
    if len(titles) <= _MOST_COLUMNS:
        return table[0]

    def titled_row(row: re.Match[str]) -> str:
        first, *others = re.split(r"(?=<td\b)", row[0])[1:] or [""]
        named = [
            f'<td data-title="{title}"{cell[3:]}' for title, cell in zip(titles[1:], others, strict=False)
        ]
        return "".join([row[0].partition("<td")[0], first, *named]) if first else row[0]

    return _ROW.sub(titled_row, table[0])


def _mathml(equation: re.Match[str]) -> str:
    """Return an equation as MathML."""
    if equation[1]:
        return f'<div class="equation">{convert(equation[1].strip(), display="block")}</div>'
    return f"<span>{convert(equation[2])}</span>"  # at the start of a line, <math> would be a block
