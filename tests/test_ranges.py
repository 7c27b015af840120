"""Every number in the settings of simulated worlds has a range; what lies outside is named."""

import importlib
import math
import pkgutil
from dataclasses import MISSING, fields, is_dataclass, replace

import pytest

import pedpred.worlds
from pedpred.errors import ValueRuleError


def settings():
    """All settings of `pedpred.worlds` with usual values."""
    names = [module.name for module in pkgutil.iter_modules(pedpred.worlds.__path__)]
    modules = [importlib.import_module(f"pedpred.worlds.{name}") for name in names]
    kinds = {kind for module in modules for kind in vars(module).values() if isinstance(kind, type)}
    ours = [kind for kind in kinds if kind.__module__.startswith("pedpred.worlds.") and is_dataclass(kind)]
    usual = [kind for kind in ours if all(_has_default(field) for field in fields(kind))]
    return [kind() for kind in sorted(usual, key=lambda kind: kind.__name__)]


def _has_default(field):
    return field.default is not MISSING or field.default_factory is not MISSING


def impossible(value):
    """What a number, or a pair of them, cannot be."""
    wrong = (-1e9, math.nan, math.inf, "1", None)
    if isinstance(value, (int, float)):
        return wrong
    falling = [value[::-1]] if len(value) == 2 and value[0] < value[1] else []
    return [(), value[0], *falling, *(tuple([one] * len(value)) for one in wrong)]


NUMBERS = {
    f"{type(own).__name__}.{field.name}": (own, field.name)
    for own in settings()
    for field in fields(own)
    if isinstance(value := getattr(own, field.name), (int, float))
    or (isinstance(value, tuple) and isinstance(value[0], (int, float)))
}
BEYOND_THE_MAP = ("cut_x_m", "cut_y_m")  # negative: the view goes beyond the map, however far


def test_there_are_numbers():
    assert len(NUMBERS) > 80


@pytest.mark.parametrize("name", NUMBERS)
def test_a_number_outside_its_range_is_named(name):
    own, field = NUMBERS[name]
    for value in impossible(getattr(own, field)):
        if field in BEYOND_THE_MAP and value == (-1e9, -1e9):
            continue
        with pytest.raises(ValueRuleError, match=field):
            replace(own, **{field: value})
