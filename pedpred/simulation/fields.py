"""Parsing of plain dictionaries into checked settings; errors name the path of the field."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields
from typing import Any

import numpy as np

from pedpred.errors import ValueRuleError

Range = tuple[float, float]
"""Smallest and largest value."""


def parsed(kind: type, plain: Any, path: str = "") -> Any:
    """Make a dataclass from a dictionary of its fields.

    Fields whose metadata hold a function `parse` are made by `parse(value, path)`; those that hold `each`
    are lists with entries made by `each(entry, path)`. Lists become tuples where a range is expected.

    Args:
        kind: a dataclass that raises `ValueRuleError` when a field breaks its rule.
        plain: field name -> value.
        path: of the dictionary, prefixed to the fields that errors name.

    Raises:
        ValueRuleError: a field is unknown, missing or breaks its rule.
    """
    known = {field.name: field for field in fields(kind)}
    what = f"the fields of {kind.__name__} are {', '.join(known)}"
    if not isinstance(plain, Mapping):
        raise ValueRuleError(path, plain, what)
    for name in plain:
        if name not in known:
            raise ValueRuleError(_joined(path, name), plain[name], f"there is no such field: {what}")
    values = dict(plain)
    for name, field in known.items():
        if name not in plain:
            if field.default is MISSING:
                raise ValueRuleError(_joined(path, name), None, f"it is missing: {what}")
        elif "parse" in field.metadata:
            values[name] = field.metadata["parse"](plain[name], _joined(path, name))
        elif "each" in field.metadata:
            if not isinstance(plain[name], Sequence) or isinstance(plain[name], str):
                raise ValueRuleError(_joined(path, name), plain[name], "a list is needed")
            entries = enumerate(plain[name])
            each = field.metadata["each"]
            values[name] = tuple(each(entry, _joined(path, f"{name}[{n}]")) for n, entry in entries)
        elif isinstance(plain[name], list) and str(field.type).startswith(("Range", "tuple")):
            values[name] = tuple(plain[name])
    try:
        return kind(**values)
    except ValueRuleError as cause:
        raise ValueRuleError(_joined(path, cause.field), cause.value, cause.rule) from cause


def _joined(path: str, name: str) -> str:
    return f"{path}.{name}" if path else str(name)


def check_ranges(settings: Any, ranges: Mapping[str, str]) -> None:
    """Check that numeric fields lie in their intervals; both ends of a range must, in rising order.

    Args:
        settings: a dataclass or named tuple; fields annotated as int must hold whole numbers, those annotated
            with `...` any number of them, in any order.
        ranges: field name -> interval such as "(0, 1]".

    Raises:
        ValueRuleError: a field holds something else.
    """
    for name, interval in ranges.items():
        value, annotation = getattr(settings, name), str(type(settings).__annotations__[name])
        listed = "..." in annotation
        pair = annotation.startswith(("Range", "tuple")) and not listed
        several = isinstance(value, (tuple, list)) and (len(value) == 2 if pair else listed)
        ends = value if several else [value]
        numbers = (int,) if "int" in annotation else (int, float)
        counted = several and len(ends) > 0 if listed else len(ends) == 1 + pair
        fits = counted and all(
            isinstance(end, numbers) and not isinstance(end, bool) and _inside(end, interval) for end in ends
        )
        if not fits or (pair and ends[0] > ends[1]):
            one = "a whole number" if "int" in annotation else "a number"
            what = "two rising numbers" if pair else "some numbers" if listed else one
            raise ValueRuleError(name, value, f"it must be {what} in {interval}")


def _inside(value: float, interval: str) -> bool:
    low, high = map(float, interval[1:-1].split(","))
    above = low <= value if interval[0] == "[" else low < value
    return above and (value <= high if interval[-1] == "]" else value < high)


def finite(field: str, value: Any, shape: tuple[int | None, ...] = ()) -> np.ndarray:
    """Convert to finite numbers of some shape; None in it stands for any length.

    Raises:
        ValueRuleError: the value is something else.
    """
    wanted = f"finite numbers are needed, of shape {shape}" if shape else "a finite number is needed"
    try:
        numbers = np.asarray(value)
    except ValueError as cause:  # rows of different lengths
        raise ValueRuleError(field, value, wanted) from cause
    fits = len(numbers.shape) == len(shape) and all(
        n in (None, length) for n, length in zip(shape, numbers.shape, strict=True)
    )
    if not fits or numbers.dtype.kind not in "iuf" or not np.isfinite(numbers).all():
        raise ValueRuleError(field, value, wanted)
    return numbers.astype(np.float64)


def positive(field: str, value: Any, shape: tuple[int | None, ...] = ()) -> np.ndarray:
    """Convert to positive finite numbers of some shape.

    Raises:
        ValueRuleError: the value is something else.
    """
    numbers = finite(field, value, shape)
    if not (numbers > 0).all():
        raise ValueRuleError(field, value, "it must be positive")
    return numbers
