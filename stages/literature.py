"""What the stages of the comparison with the literature share: which recordings, folds and network."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from pedpred.config import configured, part
from pedpred.fields import parsed
from pedpred.literature.settings import ComparisonSettings


def comparison_of(cfg: Mapping[str, Any]) -> ComparisonSettings:
    """Read what is compared; other keys of `literature` say how networks are trained."""
    given, names = part(cfg, "literature"), [own.name for own in fields(ComparisonSettings)]
    with configured("literature"):
        settings: ComparisonSettings = parsed(ComparisonSettings, {k: given[k] for k in names if k in given})
    return settings
