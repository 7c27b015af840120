"""The files of the project that each stage's script imports, and each network, with what is in them.

A stage depends on data/code/SCRIPT, and on data/code/models/ARCHITECTURE if it runs such a network, so that
a change of the code makes those stages stale that run it. Comments, docstrings and blank lines do not count.
"""

from __future__ import annotations

import ast
import hashlib
import io
import tokenize
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

from pedpred.files import write_text
from pedpred.models import ARCHITECTURES

ROOT = Path(__file__).resolve().parents[1]
CODE = Path("data/code")
"""A file for each script, and one in `models` for each architecture."""

_NAMES = ("arrays", "compiled", "config", "errors", "files", "lazy", "plain", "settings", "workers")
UNRELATED = {ROOT / f"pedpred/{name}.py" for name in _NAMES}
"""These are not listed, though nearly all code imports them: they check, compile, read and write files. Force
the stages after a change of how loops are compiled or pictures are read (`dvc repro --force`)."""

_DIGITS = 16


def file_of(module: str) -> Path | None:
    """Return the project's file that holds a module; packages on the way to it have no side effects."""
    path = ROOT.joinpath(*module.split("."))
    return next((file for file in (path.with_suffix(".py"), path / "__init__.py") if file.is_file()), None)


@cache
def imported(path: Path) -> tuple[tuple[str, str | None], ...]:
    """Return the (module, name) pairs that a file imports; name is None for a plain `import module`."""
    pairs: list[tuple[str, str | None]] = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"), path)):
        if isinstance(node, ast.Import):
            pairs += ((alias.name, None) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            pairs += ((node.module, alias.name) for alias in node.names)
    return tuple(pairs)


def provider(module: str, name: str | None) -> Path | None:
    """Return the file that defines what is imported: names of a package are followed to their module."""
    file = (file_of(f"{module}.{name}") if name else None) or file_of(module)
    if name is not None and file is not None and file.name == "__init__.py":
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


def files_of(*scripts: Path) -> list[Path]:
    """Return what results of scripts depend on: their code, and other files beside that."""
    code = set().union(*map(code_behind, scripts)) - UNRELATED
    near = [path for folder in {path.parent for path in code} for path in folder.iterdir()]
    return sorted(code.union(filter(_is_read, near)))


def _is_read(path: Path) -> bool:
    """Whether a file may be read by the code beside it; hidden ones are those of editors."""
    return path.is_file() and path.suffix not in (".py", ".typed") and not path.name.startswith(".")


@cache
def checksum(path: Path) -> str:
    """Return the checksum of what a file means: of Python, without comments, docstrings and blank lines."""
    content = path.read_bytes()
    if path.suffix == ".py":
        content = meaning(content.decode()).encode()
    return hashlib.sha256(content).hexdigest()[:_DIGITS]


def meaning(text: str) -> str:
    """Return Python code without comments, docstrings and blank lines."""
    lines, nodes = dict(enumerate(text.encode().splitlines(), 1)), list(ast.walk(ast.parse(text)))
    for (first, begin), (last, end) in sorted([*_docstrings(nodes), *_comments(text)], reverse=True):
        lines[last] = lines[first][:begin] + lines[last][end:]
        for number in range(first, last):
            del lines[number]
    inside = _lines_in_strings(nodes)
    stripped = {number: line if number in inside else line.rstrip() for number, line in lines.items()}
    return b"\n".join(line for number, line in stripped.items() if line or number in inside).decode()


def _lines_in_strings(nodes: Iterable[ast.AST]) -> set[int]:
    """Lines whose end may be in a string, where blanks count."""
    strings = (node for node in nodes if isinstance(node, ast.Constant | ast.JoinedStr))
    return {number for node in strings for number in range(node.lineno, node.end_lineno or node.lineno)}


Span = tuple[tuple[int, int], tuple[int, int]]
"""Begin and end of a piece of text: line, from 1, and byte in it."""


def _docstrings(nodes: Iterable[ast.AST]) -> Iterator[Span]:
    """Strings that stand alone, of modules, classes, functions and values."""
    for node in nodes:
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


def scripts() -> list[Path]:
    """Return the scripts of all other stages."""
    files = (ROOT / "stages").glob("*.py")
    return sorted(
        path for path in files if '\nif __name__ == "__main__":' in path.read_text(encoding="utf-8")
    )


def listings() -> dict[Path, list[Path]]:
    """Return what is written: file -> the files that it lists."""
    files = {CODE / script.stem: files_of(script) for script in scripts()}
    for name, architecture in ARCHITECTURES.items():
        if home := file_of(architecture.settings.rpartition(".")[0]):
            files[CODE / "models" / name] = files_of(home)
    return files


def write_code() -> None:
    """Write data/code."""
    for path, files in listings().items():
        write_text(path, "".join(f"{checksum(file)} {file.relative_to(ROOT)}\n" for file in files))
