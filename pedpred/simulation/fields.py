"""From plain dictionaries to values that check themselves; an error names the key and what it holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields
from typing import Any

import numpy as np

from pedpred.errors import ConfigError, ValueRuleError


def built(kind: type, plain: Any, key: str) -> Any:
    """An instance of a dataclass from a dictionary of its fields.

    A field whose metadata hold a function `each` is a list; `each(entry, key)` makes its entries.

    Args:
        kind: a dataclass that raises `ValueRuleError` when a field breaks its rule.
        plain: field name -> value.
        key: where the dictionary stands in the configuration.

    Raises:
        ConfigError: a field is unknown, missing or breaks its rule.
    """
    known = {field.name: field for field in fields(kind)}
    what = f"the fields of a {kind.__name__.lower()} are {', '.join(known)}"
    if not isinstance(plain, Mapping):
        raise ConfigError(key, plain, what)
    for name in plain:
        if name not in known:
            raise ConfigError(f"{key}.{name}", plain[name], f"there is no such field: {what}")
    values = dict(plain)
    for name, field in known.items():
        if name not in plain and field.default is MISSING:
            raise ConfigError(f"{key}.{name}", None, f"it is missing: {what}")
        if name in plain and "each" in field.metadata:
            if not isinstance(plain[name], Sequence) or isinstance(plain[name], str):
                raise ConfigError(f"{key}.{name}", plain[name], "a list is needed")
            entries = enumerate(plain[name])
            values[name] = tuple(field.metadata["each"](e, f"{key}.{name}[{n}]") for n, e in entries)
    try:
        return kind(**values)
    except ValueRuleError as cause:
        raise ConfigError(f"{key}.{cause.field}", cause.value, cause.rule) from cause


def finite(field: str, value: Any, shape: tuple[int | None, ...] = ()) -> np.ndarray:
    """The value as finite numbers of some shape; None in it stands for any length.

    Raises:
        ValueRuleError: it holds something else.
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
    """The value as positive finite numbers of some shape.

    Raises:
        ValueRuleError: it holds something else.
    """
    numbers = finite(field, value, shape)
    if not (numbers > 0).all():
        raise ValueRuleError(field, value, "it must be positive")
    return numbers
