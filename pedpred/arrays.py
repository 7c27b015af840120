"""Arguments as real numbers: they are taken exactly, or refused by name.

Conversion by numpy drops the mask of a masked array and the imaginary part of complex numbers, counts dates
in whatever unit they have, and reads text as numbers. Here these are errors; value types use these functions.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pedpred.errors import ValueRuleError

_REAL = "iuf"


def real_numbers(field: str, value: Any, kinds: str = _REAL) -> np.ndarray:
    """Take an argument as an array of real numbers of any width; it may be the argument itself.

    Args:
        field: its name, for errors.
        value: an array, nested lists, a table of pandas or anything else that numpy understands.
        kinds: of numpy's types (`numpy.dtype.kind`) that are allowed.

    Raises:
        ValueRuleError: it is not an array of real numbers, or some are masked.
    """
    if type(value) is np.ndarray and value.dtype.kind in kinds:
        return value
    try:
        array = np.asarray(value)
    except (OverflowError, RuntimeError, TypeError, ValueError) as cause:
        raise ValueRuleError(field, value, "it must be numbers, as many in each row") from cause
    if array.dtype.kind not in kinds:
        raise ValueRuleError(field, value, f"it must be real numbers, not {array.dtype}: convert it first")
    if np.ma.is_masked(value):
        raise ValueRuleError(field, value, "it must be numbers, none of them masked")
    return array


def real_number(field: str, value: Any) -> float:
    """Take an argument as one real number.

    Raises:
        ValueRuleError: it is something else, or masked.
    """
    if type(value) is float:
        return value
    try:
        array = real_numbers(field, value)
    except ValueRuleError as cause:
        raise ValueRuleError(field, value, "it must be one number") from cause
    if array.shape:
        raise ValueRuleError(field, value, "it must be one number")
    return float(array)


def read_only(values: np.ndarray, kind: type) -> np.ndarray:
    """Return values of a type, in C order, as an array that cannot be written; a copy unless they are one."""
    fixed = values.base is None and not values.flags.writeable
    if fixed and values.dtype == kind and values.flags.c_contiguous:
        return values
    array: np.ndarray = np.array(values, kind, order="C")
    array.flags.writeable = False
    return array
