"""Put a wrong change (`tools.mutations`) into the code of the running process."""

from __future__ import annotations

import ast
import builtins
import gc
import importlib
import os
import sys
from collections import defaultdict
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np
import torch

from tools.mutations import MEDIAN, Mutation, constants


def import_module(path: str | Path) -> ModuleType:
    """Import a module of this repository by its path."""
    return importlib.import_module(".".join(Path(path).with_suffix("").parts).removesuffix(".__init__"))


@cache
def place_of(code: CodeType) -> tuple[str, str]:
    """Path from the repository's root, and the qualified name; what is inside of a function belongs to it."""
    return os.path.relpath(code.co_filename), _qualified(code).split(".<locals>")[0]


def loaded_functions() -> dict[tuple[str, str, int], list[FunctionType]]:
    """The functions of this repository that are loaded, by path, qualified name and first line."""
    gc.unfreeze()  # what is frozen is not listed
    found: dict[tuple[str, str, int], list[FunctionType]] = defaultdict(list)
    root = str(Path.cwd()) + os.sep
    for one in gc.get_objects():
        if type(one) is FunctionType and one.__code__.co_filename.startswith(root):
            path, name = place_of(one.__code__)
            found[path, name, one.__code__.co_firstlineno].append(one)
    return found


def change_functions(tree: ast.Module, mutation: Mutation, targets: Sequence[FunctionType]) -> bool:
    """Replace the code of functions by what a mutation makes of it.

    Args:
        tree: the module; it is changed.
        mutation: the change.
        targets: functions made from the same lines of this module.

    Returns:
        Whether that is possible.
    """
    mutation.apply()
    vars(builtins)[MEDIAN] = _median
    old = targets[0].__code__
    for code in _inside(compile(tree, old.co_filename, "exec", dont_inherit=True)):
        if (_qualified(code), code.co_firstlineno) == (_qualified(old), old.co_firstlineno):
            if code.co_freevars != old.co_freevars:  # no longer reads super(), for example
                return False
            for target in targets:
                target.__code__ = code
            return True
    return False


def change_constant(tree: ast.Module, mutation: Mutation, path: str, name: str) -> bool:
    """Replace a number, or a tuple of them, wherever it was imported; returns whether it is one."""
    mutation.apply()
    home = vars(import_module(path))
    old, node = home.get(name), dict(constants(tree))[name].value
    if node is None or not isinstance(old, int | float | tuple):
        return False
    new = eval(compile(ast.Expression(node), path, "eval"), home)  # noqa: S307, source of this repository
    for module in list(sys.modules.values()):
        if isinstance(module, ModuleType) and vars(module).get(name) is old:
            setattr(module, name, new)
    return True


def _qualified(code: CodeType) -> str:
    name: str = code.co_qualname  # type: ignore[attr-defined]  # of Python 3.11
    return name


def _inside(code: CodeType) -> Iterator[CodeType]:
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield inner
            yield from _inside(inner)


def _median(values: Any, *arguments: Any, **named: Any) -> Any:
    """Median of an array or of a tensor, called as its mean is."""
    if not isinstance(values, torch.Tensor):
        return np.median(values, *arguments, **named)
    chosen = torch.median(values.double(), *arguments, **named)
    return getattr(chosen, "values", chosen)
