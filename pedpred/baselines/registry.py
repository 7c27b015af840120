"""All forecasters that need no training, by key, and how a row of `conf/methods` becomes one."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from pedpred.baselines.present_motion import PRESENT_MOTION
from pedpred.baselines.social_force import social_force
from pedpred.errors import ValueRuleError
from pedpred.fields import check_choice
from pedpred.forecasting import Forecaster, Method

BASELINES: dict[str, Callable[..., Forecaster]] = {**PRESENT_MOTION, "social_force": social_force}
"""Name -> factory, called with the settings of a row. The row names it by its key or as `baseline`."""


def baselines(rows: Iterable[Method]) -> dict[str, Forecaster]:
    """Make the forecasters of some rows, in their order.

    Raises:
        ValueRuleError: a row's baseline or one of its settings is unknown.
    """
    return {row.key: _made(row) for row in rows}


def _made(row: Method) -> Forecaster:
    settings = dict(row.settings)
    name = settings.pop("baseline", row.key)
    check_choice(f"{row.key}.settings.baseline", name, sorted(BASELINES))
    try:
        return BASELINES[name](**settings)
    except ValueRuleError as cause:
        raise ValueRuleError(f"{row.key}.settings.{cause.field}", cause.value, cause.rule) from cause
    except TypeError as cause:
        raise ValueRuleError(f"{row.key}.settings", dict(row.settings), str(cause)) from cause
