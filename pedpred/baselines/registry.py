"""All forecasters that need no training, by key, and how a row of `conf/methods` becomes one."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any

from pedpred.baselines.present_motion import PRESENT_MOTION
from pedpred.baselines.social_force import social_force
from pedpred.errors import ValueRuleError
from pedpred.forecasting import Forecaster
from pedpred.settings import check_choice, check_names

BASELINES: dict[str, Callable[..., Forecaster]] = {**PRESENT_MOTION, "social_force": social_force}
"""Name -> factory, called with the settings of a row. The row names it by its key or as `baseline`."""


def baseline(key: str, settings: Mapping[str, Any]) -> Forecaster:
    """Make the forecaster of a row.

    Args:
        key: of the row.
        settings: of the row.

    Raises:
        ValueRuleError: the row's baseline or one of its settings is unknown.
    """
    options = dict(settings)
    name = options.pop("baseline", key)
    check_choice(f"{key}.settings.baseline", name, sorted(BASELINES))
    known = [*inspect.signature(BASELINES[name]).parameters]
    rule = f"the settings are {', '.join(known)}" if known else f"{name} has no settings"
    check_names(known, options, f"{key}.settings", rule)
    try:
        return BASELINES[name](**options)
    except ValueRuleError as cause:
        raise ValueRuleError(f"{key}.settings.{cause.field}", cause.value, cause.rule) from cause
    except TypeError as cause:
        raise ValueRuleError(f"{key}.settings", dict(settings), str(cause)) from cause
