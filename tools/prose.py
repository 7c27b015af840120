"""Check the style of the pages: `python -m tools.prose`. Word list: tools/prose.yaml.

Pages are short, and contain no phrase of the list outside code.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import yaml

from pedpred.errors import user_errors
from tools.arguments import in_project, no_arguments

LONGEST = {"README.md": 120}
"""Most lines of some pages."""
LONGEST_PAGE = 200
"""Most lines of all others."""

_WORDS = Path(__file__).with_suffix(".yaml")
_CODE = re.compile(r"```.*?```|`[^`\n]*`|\]\([^)]*\)", re.DOTALL)


def word_list() -> dict[str, str]:
    """Return regular expression -> what to write instead."""
    words: dict[str, str] = yaml.safe_load(_WORDS.read_text())
    return words


def pages(root: Path) -> list[Path]:
    """Return the pages that people read."""
    return [*sorted(root.glob("*.md")), *sorted((root / "docs").rglob("*.md"))]


def faults(text: str, name: str, words: Mapping[str, str]) -> Iterator[str]:
    """Yield one line per fault of a page."""
    lines = len(text.splitlines())
    longest = LONGEST.get(name, LONGEST_PAGE)
    if lines > longest:
        yield f"{name}: {lines} lines, at most {longest}"
    prose = _CODE.sub(lambda code: re.sub(r"[^\n]", " ", code[0]), text)
    for phrase, instead in words.items():
        for match in re.finditer(phrase.replace(" ", r"\s+"), prose, re.IGNORECASE):
            line = prose.count("\n", 0, match.start()) + 1
            yield f"{name}:{line}: '{' '.join(match[0].split())}', write: {instead}"


@user_errors()
def main() -> None:
    """Print all faults; fail when there are some."""
    words, root = word_list(), Path()
    in_project(root)
    problems = [
        f for page in pages(root) for f in faults(page.read_text(), str(page.relative_to(root)), words)
    ]
    sys.stdout.writelines(f"{fault}\n" for fault in problems)
    sys.exit(int(bool(problems)))


if __name__ == "__main__":
    no_arguments("tools.prose", __doc__)
    main()
