"""Parsing of plain dictionaries into checked settings; errors name the path of the field."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from numbers import Integral, Real
from typing import Any, TypeVar

import numpy as np

from pedpred.errors import ValueRuleError

Range = tuple[float, float]
"""Smallest and largest value."""

Kind = TypeVar("Kind")

LARGEST_SEED = 2**32 - 1
"""Of the generators of all random numbers."""


def parsed(kind: type[Kind], plain: Any, path: str = "") -> Kind:
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
    known = {field.name: field for field in fields(kind)}  # type: ignore[arg-type]  # it is a dataclass
    what = f"the fields of {kind.__name__} are {', '.join(known)}"
    check_names(known, plain, path, what)
    values = dict(plain)
    for name, field in known.items():
        if name not in plain:
            if field.default is MISSING and field.default_factory is MISSING:
                raise ValueRuleError(field_path(path, name), None, f"it is missing: {what}")
        elif "parse" in field.metadata:
            values[name] = field.metadata["parse"](plain[name], field_path(path, name))
        elif "each" in field.metadata:
            if not isinstance(plain[name], Sequence) or isinstance(plain[name], str):
                raise ValueRuleError(field_path(path, name), plain[name], "a list is needed")
            entries = enumerate(plain[name])
            each = field.metadata["each"]
            values[name] = tuple(each(entry, field_path(path, f"{name}[{n}]")) for n, entry in entries)
        elif isinstance(plain[name], list) and str(field.type).startswith(("Range", "tuple")):
            values[name] = tuple(plain[name])
    try:
        return kind(**values)
    except ValueRuleError as cause:
        raise ValueRuleError(field_path(path, cause.field), cause.value, cause.rule) from cause


def parsed_together(kinds: Sequence[type], plain: Any) -> list[Any]:
    """Make several dataclasses from one dictionary that holds the fields of all of them.

    Args:
        kinds: dataclasses whose fields have different names; see `parsed`.
        plain: field name -> value.

    Raises:
        ValueRuleError: a field is unknown to all of them, missing or breaks its rule.
    """
    fields_of = [[field.name for field in fields(kind)] for kind in kinds]
    known = [name for names in fields_of for name in names]
    check_names(known, plain, "", f"the fields are {', '.join(known)}")
    parts = ({name: plain[name] for name in names if name in plain} for names in fields_of)
    return [parsed(kind, part) for kind, part in zip(kinds, parts, strict=True)]


def parsed_each(kind: type[Kind], plain: Any, path: str = "") -> dict[str, Kind]:
    """Make dataclasses from a dictionary whose names are free and whose entries are dictionaries of fields.

    Raises:
        ValueRuleError: it is not a dictionary, or an entry breaks a rule of `parsed`.
    """
    check_mapping(path, plain)
    return {name: parsed(kind, entry, field_path(path, name)) for name, entry in plain.items()}


def check_mapping(field: str, value: Any) -> None:
    """Check that a value maps names to something.

    Raises:
        ValueRuleError: it does not.
    """
    if not isinstance(value, Mapping):
        raise ValueRuleError(field, value, "it must map names to values")


def check_names(known: Collection[str], plain: Any, path: str, rule: str) -> None:
    """Check that a dictionary has no other names than those known.

    Raises:
        ValueRuleError: it has, or it is not a dictionary; the rule ends the message.
    """
    if not isinstance(plain, Mapping):
        raise ValueRuleError(path, plain, rule)
    for name in plain:
        if name not in known:
            raise ValueRuleError(field_path(path, name), plain[name], f"there is no such field: {rule}")


def check_choice(field: str, value: Any, known: Collection[str]) -> None:
    """Check that a value is one of some names.

    Raises:
        ValueRuleError: it is not.
    """
    if not isinstance(value, str) or value not in known:
        raise ValueRuleError(field, value, f"it must be one of {', '.join(known)}")


def field_path(path: str, name: str) -> str:
    """Return the path of a field inside the dictionary at `path`."""
    return f"{path}.{name}" if path else str(name)


def check_ranges(settings: Any, ranges: Mapping[str, str]) -> None:
    """Check the kinds of fields by their annotations, and that numeric ones lie in their intervals.

    Fields annotated as bool, str or `tuple[str, ...]`, or as mappings to such, must hold those, whether
    `ranges` names them or not. The annotation of a numeric field says how many numbers it holds: one; a
    rising pair (`Range`, `tuple[int, int]`); some in any order (`...`); some by name (`Mapping`). Those
    annotated as int must be whole.

    Args:
        settings: a dataclass or named tuple.
        ranges: field name -> interval such as "(0, 1]".

    Raises:
        ValueRuleError: a field holds something else.
    """
    if is_dataclass(settings):
        annotations = {field.name: str(field.type) for field in fields(settings)}
    else:
        annotations = {name: str(kind) for name, kind in type(settings).__annotations__.items()}
    for name, annotation in annotations.items():
        _check_words(name, getattr(settings, name), annotation)
    for name, interval in ranges.items():
        _check_numbers(name, getattr(settings, name), annotations[name], interval)


def _is_list_of_texts(value: Any) -> bool:
    return isinstance(value, (tuple, list)) and all(isinstance(entry, str) for entry in value)


_WORDS = {
    "bool": (lambda value: isinstance(value, bool), "true or false"),
    "bool | None": (lambda value: value is None or isinstance(value, bool), "true, false or None"),
    "str": (lambda value: isinstance(value, str), "a text"),
    "tuple[str, ...]": (_is_list_of_texts, "a list of texts"),
}
"""Annotation -> whether a value is of it, and what it is called."""
_ENTRIES = {"Mapping[str, Sequence[str]]": "tuple[str, ...]", "Mapping[str, str]": "str"}
"""Annotation of a mapping -> that of its values."""


def _check_words(name: str, value: Any, annotation: str) -> None:
    """Check a truth value, a text or several; of a mapping, each entry by its name. Others pass."""
    if annotation in _ENTRIES:
        check_mapping(name, value)
        for key, entry in value.items():
            _check_words(f"{name}.{key}", entry, _ENTRIES[annotation])
    elif annotation in _WORDS:
        is_one, called = _WORDS[annotation]
        if not is_one(value):
            raise ValueRuleError(name, value, f"it must be {called}")


def _check_numbers(name: str, value: Any, annotation: str, interval: str) -> None:
    """Check one number, a pair of them, or several; of a mapping, each entry by its name."""
    if annotation.startswith("Mapping"):
        check_mapping(name, value)
        of_entry = annotation.partition(", ")[2].removesuffix("]")
        for key, entry in value.items():
            _check_numbers(f"{name}.{key}", entry, of_entry, interval)
        return
    whole = "int" in annotation
    if "..." in annotation:
        what = "some numbers"
        fits = _are_numbers(value, whole, interval) and len(value) > 0
    elif annotation.startswith(("Range", "tuple")):
        what = "two rising numbers"
        fits = _are_numbers(value, whole, interval) and len(value) == 2 and value[0] <= value[1]
    else:
        what = "a whole number" if whole else "a number"
        fits = _are_numbers([value], whole, interval)
    if not fits:
        raise ValueRuleError(name, value, f"it must be {what} in {interval}")


def _are_numbers(values: Any, whole: bool, interval: str) -> bool:
    """Whether a value is a list of (whole) numbers, all of them in an interval."""
    kind = Integral if whole else Real  # those of numpy, too
    return isinstance(values, (tuple, list)) and all(
        not isinstance(entry, bool) and isinstance(entry, kind) and _inside(entry, interval)
        for entry in values
    )


def _inside(value: Any, interval: str) -> bool:
    low, high = map(float, interval[1:-1].split(","))
    above = low <= value if interval[0] == "[" else low < value
    return bool(above and (value <= high if interval[-1] == "]" else value < high))


_LARGEST = 1e9


def finite(field: str, value: Any, shape: tuple[int | None, ...] = ()) -> np.ndarray:
    """Convert to finite numbers of some shape; None in it stands for any length.

    Raises:
        ValueRuleError: the value is something else.
    """
    what = f"finite numbers are needed, of shape {shape}" if shape else "a finite number is needed"
    wanted = f"{what}, at most {_LARGEST:g}"
    try:
        numbers = np.asarray(value)
    except ValueError as cause:  # rows of different lengths
        raise ValueRuleError(field, value, wanted) from cause
    fits = len(numbers.shape) == len(shape) and all(
        n in (None, length) for n, length in zip(shape, numbers.shape, strict=True)
    )
    if (
        not fits
        or _holds_truth(value)
        or numbers.dtype.kind not in "iuf"
        or not (np.abs(numbers) <= _LARGEST).all()
    ):
        raise ValueRuleError(field, value, wanted)
    return numbers.astype(np.float64)


def _holds_truth(value: Any) -> bool:
    """Whether a number of nested lists is true or false, which numpy takes for 1 or 0."""
    return any(map(_holds_truth, value)) if isinstance(value, (list, tuple)) else isinstance(value, bool)


def positive(field: str, value: Any, shape: tuple[int | None, ...] = ()) -> np.ndarray:
    """Convert to positive finite numbers of some shape.

    Raises:
        ValueRuleError: the value is something else.
    """
    numbers = finite(field, value, shape)
    if not (numbers > 0).all():
        raise ValueRuleError(field, value, "it must be positive")
    return numbers
