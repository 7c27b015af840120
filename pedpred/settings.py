"""Settings: dataclasses whose annotations say what each field may hold; errors name the path of a field.

A class of settings is a frozen dataclass that inherits `Settings`:

    @dataclass(frozen=True)
    class SensorSettings(Settings):
        rate_hz: Annotated[float, In("(0, 100]")]
        faults: Mapping[str, Annotated[float, In("[0, 1]")]]
        mode: Annotated[str, OneOf(("near", "far"))] = "near"

`load` makes it from a plain dictionary. Values keep their types: a whole number in a field of real ones stays
whole, so that files which settings are written to keep their bytes.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import cache
from numbers import Integral, Real
from types import NoneType, UnionType
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from pedpred.errors import ValueRuleError

Range = tuple[float, float]
"""Smallest and largest value."""

Kind = TypeVar("Kind")

LARGEST_SEED = 2**32 - 1
"""Of the generators of all random numbers."""


@dataclass(frozen=True)
class In:
    """Numbers lie in an interval, such as "(0, 1]".

    Rules of different kinds are not equal: of equal annotations, typing keeps the first.
    """

    interval: str

    def check(self, path: str, value: Any, what: str) -> None:
        """Check a number; `what` it is, for the error."""
        low, high = map(float, self.interval[1:-1].split(","))
        above = low <= value if self.interval[0] == "[" else low < value
        if not (above and (value <= high if self.interval[-1] == "]" else value < high)):
            raise ValueRuleError(path, value, f"it must be {what} in {self.interval}")


@dataclass(frozen=True)
class OneOf:
    """Texts are one of some names."""

    names: Collection[str]

    def check(self, path: str, value: Any, what: str) -> None:
        """Check a text."""
        check_choice(path, value, self.names)


class Settings:
    """Base of the classes of settings; each instance is checked when it is made."""

    def __post_init__(self) -> None:
        """Check every field.

        Raises:
            ValueRuleError: a field holds something that its annotation does not allow.
        """
        check_fields(self)


def check_fields(settings: Any) -> None:
    """Check the fields of a dataclass or named tuple by their annotations.

    Raises:
        ValueRuleError: a field holds something else.
    """
    kind: Any = type(settings)
    for name, hint in _hints(kind).items():
        _check(name, getattr(settings, name), hint)


@cache
def _hints(kind: Any) -> dict[str, Any]:
    """Field -> annotation."""
    hints = get_type_hints(kind, include_extras=True)
    names = [field.name for field in fields(kind)] if is_dataclass(kind) else kind._fields
    return {name: hints[name] for name in names}


def _check(path: str, value: Any, hint: Any, rules: Sequence[Any] = ()) -> None:
    """Check a value by an annotation and by rules around it; what is no number, text or collection passes."""
    origin, inside = get_origin(hint), get_args(hint)
    if origin is Annotated:
        _check(path, value, inside[0], [*rules, *inside[1:]])
    elif origin in (Union, UnionType):
        if value is not None or NoneType not in inside:
            others = [one for one in inside if one is not NoneType]
            if len(others) == 1:
                _check(path, value, others[0], rules)
    elif _is(origin, Mapping):
        check_mapping(path, value)
        for name, entry in value.items():
            _check(field_path(path, name), entry, inside[1], rules)
    elif _is(origin, Sequence):
        _check_list(path, value, inside, rules)
    elif hint in _KINDS:
        is_one, what = _KINDS[hint]
        if not is_one(value):
            raise ValueRuleError(path, value, f"it must be {what}")
        for rule in rules:
            rule.check(path, value, what)


def _is(origin: Any, kind: type) -> bool:
    return isinstance(origin, type) and issubclass(origin, kind)


def _is_number(kind: type) -> Callable[[Any], bool]:
    """Whether a value is a number of a kind, also one of numpy."""
    return lambda value: isinstance(value, kind) and not isinstance(value, bool)


_KINDS: dict[Any, tuple[Callable[[Any], bool], str]] = {
    bool: (lambda value: isinstance(value, bool), "true or false"),
    str: (lambda value: isinstance(value, str), "a text"),
    int: (_is_number(Integral), "a whole number"),
    float: (_is_number(Real), "a number"),
}
"""Type -> whether a value is of it, and what it is called."""


def _check_list(path: str, value: Any, kinds: Sequence[Any], rules: Sequence[Any]) -> None:
    """Check a list: two rising numbers, or entries of one kind; of numbers, at least one."""
    is_pair, kind = len(kinds) == 2 and kinds[1] is not Ellipsis, kinds[0]
    numbers = kind in (int, float) or (get_origin(kind) is Annotated and get_args(kind)[0] in (int, float))
    if not isinstance(value, (tuple, list)) or (numbers and not value):
        what = "two rising numbers" if is_pair else "some numbers" if numbers else "a list"
        raise ValueRuleError(path, value, f"it must be {what}")
    for number, entry in enumerate(value):
        _check(f"{path}[{number}]", entry, kind, rules)
    if is_pair and rules and (len(value) != 2 or not value[0] <= value[1]):
        raise ValueRuleError(path, value, "it must be two rising numbers")


def load(kind: type[Kind], plain: Any, path: str = "") -> Kind:
    """Make a dataclass from a dictionary of its fields.

    Fields that are dataclasses, and mappings and lists of such, are made likewise; lists become tuples where
    those are annotated. A field whose metadata hold a function `parse` is made by `parse(value, path)`.

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
    any_kind: Any = kind
    values, hints = dict(plain), _hints(any_kind)
    for name, field in known.items():
        if name not in plain:
            if field.default is MISSING and field.default_factory is MISSING:
                raise ValueRuleError(field_path(path, name), None, f"it is missing: {what}")
        elif "parse" in field.metadata:
            values[name] = field.metadata["parse"](plain[name], field_path(path, name))
        else:
            values[name] = _make(hints[name], plain[name], field_path(path, name))
    try:
        return kind(**values)
    except ValueRuleError as cause:
        raise ValueRuleError(field_path(path, cause.field), cause.value, cause.rule) from cause


def _make(hint: Any, plain: Any, path: str) -> Any:
    """Make what an annotation says of a plain value."""
    if get_origin(hint) is Annotated:
        return _make(get_args(hint)[0], plain, path)
    origin, inside = get_origin(hint), get_args(hint)
    if is_dataclass(hint):
        return plain if isinstance(plain, hint) else load(hint, plain, path)  # type: ignore[arg-type]
    if _is(origin, Mapping) and is_dataclass(inside[1]):
        return load_each(inside[1], plain, path)  # type: ignore[arg-type]
    if _is(origin, Sequence) and is_dataclass(inside[0]):
        if not isinstance(plain, list | tuple):
            raise ValueRuleError(path, plain, "a list is needed")
        return tuple(_make(inside[0], entry, f"{path}[{number}]") for number, entry in enumerate(plain))
    return tuple(plain) if origin is tuple and isinstance(plain, list) else plain


def load_together(kinds: Sequence[type], plain: Any) -> list[Any]:
    """Make several dataclasses from one dictionary that holds the fields of all of them.

    Args:
        kinds: dataclasses whose fields have different names; see `load`.
        plain: field name -> value.

    Raises:
        ValueRuleError: a field is unknown to all of them, missing or breaks its rule.
    """
    fields_of = [[field.name for field in fields(kind)] for kind in kinds]
    known = [name for names in fields_of for name in names]
    check_names(known, plain, "", f"the fields are {', '.join(known)}")
    parts = ({name: plain[name] for name in names if name in plain} for names in fields_of)
    return [load(kind, part) for kind, part in zip(kinds, parts, strict=True)]


def load_each(kind: type[Kind], plain: Any, path: str = "") -> dict[str, Kind]:
    """Make dataclasses from a dictionary whose names are free and whose entries are dictionaries of fields.

    Raises:
        ValueRuleError: it is not a dictionary, or an entry breaks a rule of `load`.
    """
    check_mapping(path, plain)
    return {name: _make(kind, entry, field_path(path, name)) for name, entry in plain.items()}


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


_LARGEST = 1e9


def finite(field: str, value: Any, shape: tuple[int | None, ...] = ()) -> np.ndarray:
    """Convert to finite numbers of some shape; None in it stands for any length.

    Raises:
        ValueRuleError: the value is something else.
    """
    rule = f"it must be finite numbers of shape {shape}" if shape else "it must be a finite number"
    try:
        numbers = np.asarray(value)
    except ValueError as cause:  # rows of different lengths
        raise ValueRuleError(field, value, rule) from cause
    fits = numbers.ndim == len(shape) and all(
        n in (None, length) for n, length in zip(shape, numbers.shape, strict=True)
    )
    is_number = numbers.dtype.kind in "iuf" and not _holds_truth(value)
    if not (fits and is_number and (np.abs(numbers) <= _LARGEST).all()):
        raise ValueRuleError(field, value, f"{rule}, at most {_LARGEST:g}")
    return numbers.astype(np.float64)


def _holds_truth(value: Any) -> bool:
    """Whether a number of nested lists is true or false, which numpy takes for 1 or 0."""
    return any(map(_holds_truth, value)) if isinstance(value, (list, tuple)) else isinstance(value, bool)


def positive(field: str, value: Any, shape: tuple[int | None, ...] = ()) -> np.ndarray:
    """Convert to positive finite numbers of some shape; see `finite`."""
    numbers = finite(field, value, shape)
    if not (numbers > 0).all():
        raise ValueRuleError(field, value, "it must be positive")
    return numbers
