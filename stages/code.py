"""code: for each stage, the files of the project that its script imports, and what is in them.

A stage depends on data/code/SCRIPT alone, so that a change of the code makes exactly those stages stale that
run it. Comments, docstrings and blank lines do not count.
"""

from __future__ import annotations

import ast
import hashlib
import io
import tokenize
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from pedpred.config import config_errors
from pedpred.files import write_text

ROOT = Path(__file__).resolve().parents[1]
CODE = Path("data/code")
"""A file for each script."""

_NAMES = ("arrays", "compiled", "config", "contents", "errors", "fields", "files", "lazy", "plain", "workers")
UNRELATED = {ROOT / f"pedpred/{name}.py" for name in _NAMES}
"""On these, no result depends: they check, say where the work is done, or read and write whole files."""

_DIGITS = 16


def file_of(module: str) -> Path | None:
    """Return the project's file that holds a module; packages on the way to it have no side effects."""
    path = ROOT.joinpath(*module.split("."))
    return next((file for file in (path.with_suffix(".py"), path / "__init__.py") if file.is_file()), None)


@cache
def imported(path: Path) -> tuple[tuple[str, str | None], ...]:
    """Return the (module, name) pairs that a file imports; name is None for a plain `import module`."""
    pairs: list[tuple[str, str | None]] = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            pairs += ((alias.name, None) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            pairs += ((node.module, alias.name) for alias in node.names)
    return tuple(pairs)


def provider(module: str, name: str | None) -> Path | None:
    """Return the file that defines what is imported: names of a package are followed to their module."""
    file = (file_of(f"{module}.{name}") if name else None) or file_of(module)
    if file is not None and file.name == "__init__.py":
        sources = [source for source, public in imported(file) if public == name]
        return provider(sources[0], name) if sources else file
    return file


@cache
def imports_of(path: Path) -> frozenset[Path]:
    """Return the project's files that a file of the project imports."""
    return frozenset(file for module, name in imported(path) if (file := provider(module, name)))


def code_behind(script: Path) -> set[Path]:
    """Return every file that a script imports, directly or not, and itself."""
    seen: set[Path] = set()
    waiting = {script}
    while waiting:
        path = waiting.pop()
        seen.add(path)
        waiting |= imports_of(path) - seen
    return seen


def files_of(script: Path) -> list[Path]:
    """Return what the results of a stage depend on: its code, and other files beside that."""
    code = code_behind(script) - UNRELATED
    beside = {
        path for folder in {path.parent for path in code} for path in folder.iterdir() if _is_read(path)
    }
    return sorted(code | beside)


def _is_read(path: Path) -> bool:
    return path.is_file() and path.suffix not in (".py", ".typed")


@cache
def checksum(path: Path) -> str:
    """Return the checksum of what a file means: of Python, without comments, docstrings and blank lines."""
    text = path.read_text(encoding="utf-8")
    return hashlib.sha256((meaning(text) if path.suffix == ".py" else text).encode()).hexdigest()[:_DIGITS]


def meaning(text: str) -> str:
    """Return Python code without comments, docstrings and blank lines."""
    lines = dict(enumerate(text.encode().splitlines(), 1))
    for (first, begin), (last, end) in sorted([*_docstrings(text), *_comments(text)], reverse=True):
        lines[last] = lines[first][:begin] + lines[last][end:]
        for number in range(first, last):
            del lines[number]
    inside = _lines_in_strings(text)
    stripped = {number: line if number in inside else line.rstrip() for number, line in lines.items()}
    return b"\n".join(line for number, line in stripped.items() if line or number in inside).decode()


def _lines_in_strings(text: str) -> set[int]:
    """Lines whose end may be in a string, where blanks count."""
    strings = (node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Constant | ast.JoinedStr))
    return {number for node in strings for number in range(node.lineno, node.end_lineno or node.lineno)}


Span = tuple[tuple[int, int], tuple[int, int]]
"""Begin and end of a piece of text: line, from 1, and byte in it."""


def _docstrings(text: str) -> Iterator[Span]:
    """Strings that stand alone, of modules, classes, functions and values."""
    for node in ast.walk(ast.parse(text)):
        match node:
            case ast.Expr(ast.Constant(str()), end_lineno=int(last), end_col_offset=int(end)):
                yield (node.lineno, node.col_offset), (last, end)


def _comments(text: str) -> Iterator[Span]:
    """Comments, which end with their line."""
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            line, character = token.start
            begin = len(token.line[:character].encode())
            yield (line, begin), (line, begin + len(token.string.encode()))


def listing(script: Path) -> str:
    """Return a line per file that a stage depends on, with its checksum."""
    return "".join(f"{checksum(path)} {path.relative_to(ROOT)}\n" for path in files_of(script))


def scripts() -> list[Path]:
    """Return the scripts of all other stages."""
    others = (path for path in (ROOT / "stages").glob("*.py") if path != Path(__file__).resolve())
    return sorted(path for path in others if "__main__" in path.read_text(encoding="utf-8"))


def main() -> None:
    """Write data/code/<script> for every stage."""
    with config_errors():
        for script in scripts():
            write_text(CODE / script.stem, listing(script))


if __name__ == "__main__":
    main()
