"""Names of a package that are imported on first use, so that importing the package loads nothing else."""

from __future__ import annotations

import ast
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any


def names_on_use(package: str, file: str) -> tuple[list[str], Callable[[str], Any]]:
    """Make `__all__` and `__getattr__` of a package from what its file imports for type checkers.

    Args:
        package: its name.
        file: its `__init__.py`, with the imports inside `if TYPE_CHECKING:`.

    Returns:
        The names, and what imports one of them, or raises an `AttributeError`.
    """
    homes = {
        alias.name: node.module
        for block in ast.parse(Path(file).read_text(encoding="utf-8")).body
        if isinstance(block, ast.If) and ast.unparse(block.test) == "TYPE_CHECKING"
        for node in block.body
        if isinstance(node, ast.ImportFrom) and node.module
        for alias in node.names
    }

    def find(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(homes[name]), name)

    return sorted(homes), find
