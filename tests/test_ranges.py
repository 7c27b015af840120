"""Every number in the settings of simulated worlds has a range; what lies outside is named."""

import math
from dataclasses import fields, is_dataclass, replace

import pytest

from pedpred.errors import ValueRuleError
from pedpred.fields import parsed
from pedpred.situations import RowSettings
from tests.simulated import SENSING, WORLDS, read

ROWS = parsed(RowSettings, read("situations/varied")["rows"])


def settings(top):
    """Settings, and all that are nested in them."""
    yield top
    for value in (getattr(top, field.name) for field in fields(top)):
        for inner in value.values() if isinstance(value, dict) else [value]:
            if is_dataclass(inner):
                yield from settings(inner)


def impossible(value):
    """What a number, or a pair of them, cannot be."""
    wrong = (-1e9, math.nan, math.inf, "1", None)
    if isinstance(value, (int, float)):
        return wrong
    falling = [value[::-1]] if len(value) == 2 and value[0] < value[1] else []
    return [(), value[0], *falling, *(tuple([one] * len(value)) for one in wrong)]


NUMBERS = {
    f"{type(own).__name__}.{field.name}": (own, field.name)
    for top in (WORLDS, SENSING, ROWS)
    for own in settings(top)
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
