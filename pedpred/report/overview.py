"""The few figures that commands compare: `dvc metrics` and `dvc plots` read these, people read the pages."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd

from pedpred.report.measures import LEAKY, MethodMetrics
from pedpred.report.methods import ordered
from pedpred.report.pages import POOLED


def overall(scenes: Mapping[str, MethodMetrics]) -> dict[str, MethodMetrics]:
    """The test sets as wholes, under the honest protocol: single rooms of the pooled one are left out."""
    return {name: methods for name, methods in scenes.items() if not name.startswith((f"{POOLED}_", LEAKY))}


def errors_m(methods: MethodMetrics) -> dict[str, float]:
    """ADE of every method, m."""
    return {name: methods[name]["ade_m"] for name in ordered(methods)}


def horizon_table(methods: MethodMetrics, step_s: float = 0.3) -> pd.DataFrame:
    """Mean error over the horizon, m: a row per step, a column per method, and `horizon_s`."""
    columns = {name: methods[name]["per_step_m"] for name in ordered(methods)}
    steps = len(next(iter(columns.values()), []))
    return pd.DataFrame({"horizon_s": [f"{step_s * (k + 1):.1f}" for k in range(steps)], **columns})
