"""What the stages of the comparison with the literature share: recordings, scenes, folds and networks."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from pedpred.config import configured, part
from pedpred.literature.settings import ComparisonSettings
from pedpred.settings import load


def comparison_of(cfg: Mapping[str, Any]) -> ComparisonSettings:
    """Read what is compared, all of it; `networks` and `memoryless` say how those are trained."""
    values, names = part(cfg, "literature"), [setting.name for setting in fields(ComparisonSettings)]
    with configured("literature"):
        settings: ComparisonSettings = load(ComparisonSettings, {k: values[k] for k in names if k in values})
    return settings


def networks_of(cfg: Mapping[str, Any]) -> list[str]:
    """Names of the networks that are compared, of both groups of conf/methods."""
    return [*cfg["literature"]["networks"], *cfg["literature"]["memoryless"]]
