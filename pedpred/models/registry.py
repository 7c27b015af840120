"""How a network of any architecture is built, written and read."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, cast

import torch

from pedpred.errors import InputError
from pedpred.files import translate_errors
from pedpred.models import ARCHITECTURES
from pedpred.models.contract import ForecastNetwork, NetworkSettings
from pedpred.models.features import RowFormat
from pedpred.settings import check_choice, check_mapping
from pedpred.storage.checkpoints import load_weights, read_checkpoint

_KIND = "motion"


def settings_class(architecture: str) -> type[NetworkSettings]:
    """Import the class of an architecture's settings."""
    module, _, name = ARCHITECTURES[architecture].settings.rpartition(".")
    return cast(type[NetworkSettings], getattr(import_module(module), name))


def parse_settings(plain: Mapping[str, Any]) -> NetworkSettings:
    """Settings of a network from plain dictionaries; the key `architecture` chooses their type.

    Raises:
        ValueRuleError: the architecture is unknown, or a setting breaks its rule.
    """
    check_mapping("settings", plain)
    fields = dict(plain)
    name = fields.pop("architecture", None)
    check_choice("architecture", name, ARCHITECTURES)
    return settings_class(name).parse(fields)


def plain_settings(settings: NetworkSettings) -> dict[str, Any]:
    """The inverse of `parse_settings`."""
    kind = type(settings)
    alike = (name for name, it in ARCHITECTURES.items() if it.settings.rpartition(".")[2] == kind.__name__)
    name = next(name for name in alike if settings_class(name) is kind)  # a package may export it again
    return {"architecture": name, **settings.plain()}


def describe_network(network: ForecastNetwork, made_with: RowFormat) -> dict[str, Any]:
    """What `about.json` must hold so that `load_network` can read it again."""
    return {
        "kind": _KIND,
        "network": plain_settings(network.settings),
        "widths": network.widths,
        "horizon_steps": network.horizon_steps,
        "rows": made_with.plain(),
    }


def is_network(about: Mapping[str, Any]) -> bool:
    """Whether a checkpoint's description is that of a network which forecasts."""
    return about["kind"] == _KIND


def load_network(folder: Path) -> tuple[ForecastNetwork, RowFormat]:
    """The network of a checkpoint, ready to forecast, and what the rows were made with that trained it.

    Raises:
        InputError: the checkpoint is missing or damaged.
    """
    weights, about = read_checkpoint(folder)
    wording = partial(InputError, folder / "about.json", remedy="Train the network again")
    with translate_errors(partial(wording, "network")):
        settings = parse_settings(about["network"])
        with torch.device("meta"):  # no memory until the weights are known to fit
            network = settings.build(about["widths"], int(about["horizon_steps"]))
    with translate_errors(partial(wording, "rows")):
        made_with = RowFormat.parse(about["rows"])
    load_weights(network, weights, folder)
    return network.eval(), made_with
