"""The input sets of networks, and what rows for them are made with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from pedpred.features import ForecastProtocol, ModelFeatures
from pedpred.models.lstm.features import LstmFeatures
from pedpred.models.mixture.features import MixtureFeatures
from pedpred.settings import check_choice, load

FEATURES: dict[str, type[ModelFeatures]] = {"lstm": LstmFeatures, "mixture": MixtureFeatures}
"""Input set ("model" in row files), also a row of conf/features -> its settings.

An architecture reads one input set; several may read the same.
"""


def parse_features(model: str, plain: Mapping[str, Any], path: str = "") -> ModelFeatures:
    """Build the settings of a model's inputs from a plain dictionary.

    Raises:
        ValueRuleError: the model is unknown, or a setting breaks its rule.
    """
    check_choice("model", model, FEATURES)
    features: ModelFeatures = load(FEATURES[model], plain, path)
    return features


def plain_features(features: ModelFeatures) -> dict[str, Any]:
    """The inverse of `parse_features`."""
    return dict(vars(features))


@dataclass(frozen=True)
class RowFormat:
    """What the rows of a folder were made with.

    Attributes:
        protocol: time step and horizon.
        model: the input set that they hold, a key of `FEATURES`.
        features: its settings.
    """

    protocol: ForecastProtocol
    model: str
    features: ModelFeatures

    def plain(self) -> dict[str, Any]:
        """The inverse of `parse`."""
        protocol, features = asdict(self.protocol), plain_features(self.features)
        return {"protocol": protocol, "model": self.model, "features": features}

    @classmethod
    def parse(cls, plain: Mapping[str, Any]) -> RowFormat:
        """Build from plain dictionaries.

        Raises:
            ValueRuleError: the model is unknown, or a size breaks its rule.
        """
        model = plain["model"]
        return cls(ForecastProtocol(**plain["protocol"]), model, parse_features(model, plain["features"]))
