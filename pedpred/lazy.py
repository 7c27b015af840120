"""Names of a package that are imported on first use, so that importing the package loads nothing else."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def names_on_use(package: str, modules: Mapping[str, str]) -> tuple[list[str], Callable[[str], Any]]:
    """Make `__all__` and `__getattr__` of a package, see PEP 562.

    Args:
        package: its name.
        modules: public name -> module that defines it. For type checkers, the package imports the same names
            inside `if TYPE_CHECKING:`.
    """

    def find(name: str) -> Any:
        if name not in modules:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(modules[name]), name)

    return sorted(modules), find
