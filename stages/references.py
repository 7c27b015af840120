"""Names that parts of the configuration use for rows of other parts: each of them must be there."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import fields
from typing import Any

from pedpred.config import SETS, one_of, part
from pedpred.driving.places import KINDS
from pedpred.driving.study import NO_WORLD
from pedpred.models import ARCHITECTURES
from pedpred.scenes import VARIANTS
from pedpred.sources import SOURCES
from pedpred.training.distributed import DeviceSettings
from stages.export import GROUPS
from stages.folds import OTHER_PLACES, OTHERS, SENSED
from stages.simulate import LAYOUTS

Params = Mapping[str, Any]
"""A whole configuration."""

WHERE = {field.name for field in fields(DeviceSettings)}
"""Keys of `training` that are no phases."""


def layout_names() -> list[str]:
    """Names of the drawn rooms."""
    return sorted(file.stem for file in LAYOUTS.glob("*.yaml"))


def method_names(cfg: Params) -> list[str]:
    """Names of all methods."""
    return [key for group in part(cfg, "methods") for key in part(cfg, "methods", group)]


def set_names(cfg: Params, *kinds: str) -> list[str]:
    """Names of all sets of scenes of some kinds, kind/name."""
    return [f"{kind}/{name}" for kind in kinds for name in part(cfg, SETS[kind])]


def exported_names(cfg: Params) -> list[str]:
    """Names of all rows `exports`."""
    return [name for group in GROUPS for name in part(cfg, group).get("exports", {})]


def _rows(*keys: str) -> Callable[[Params], Iterable[str]]:
    """Names of the rows of a group."""
    return lambda cfg: part(cfg, *keys)


def _folders(cfg: Params) -> list[str]:
    """Model folders that are exported, and the one that is shipped."""
    return [f"models/online/{name}" for name in (*exported_names(cfg), "default")]


REFERENCES: dict[str, Callable[[Params], Iterable[str]]] = {
    "simulations.*.drawn": lambda cfg: layout_names(),
    "places.*.source": lambda cfg: SOURCES,
    **{f"{kind}.*.variants": lambda cfg: VARIANTS for kind in SETS.values()},
    **{
        f"{kind}.*.{name}": _rows(f"{name}s")
        for kind in SETS.values()
        for name in ("tracker", "sensor", "social_force")
    },
    "folds.*.*.test": lambda cfg: set_names(cfg, *SETS),
    "folds.*.*.train": lambda cfg: [*set_names(cfg, *SETS), SENSED, OTHERS, OTHER_PLACES],
    "sequences.scenes": _rows("simulations"),
    "training.*.shares": _rows("situations", "simulated"),
    "training.*.sets": lambda cfg: [*set_names(cfg, "simulated"), SENSED],
    "trainings.*.architecture": lambda cfg: ARCHITECTURES,
    "trainings.*.phase": lambda cfg: [phase for phase in part(cfg, "training") if phase not in WHERE],
    "trainings.*.folds": lambda cfg: [*part(cfg, "folds"), ""],
    "comparison.reference": _rows("methods", "baselines"),
    "online.promises.*.method": method_names,
    **{f"{group}.exports.*.network": _rows("methods", "networks") for group in GROUPS},
    **{f"{group}.exports.*.tracker": _rows("trackers") for group in GROUPS},
    "recording.methods": method_names,
    "recording.animation.method": method_names,
    "recording.scenes.*.networks": lambda cfg: ["main", *part(cfg, "folds", "real")],
    "driving.places.*.world": lambda cfg: [NO_WORLD, *KINDS],
    "driving.places.*.model": _folders,
    "driving.places.*.lstm": _folders,
    "networks": _rows("methods", "networks"),
    "scenes.*": _rows("places"),
}
"""Path of names, * for any key -> which there are. A list holds names, a mapping has them as keys."""


def check_references(cfg: Params, tables: Params | None = None) -> None:
    """Look up all names of a configuration, or of some tables of it.

    Raises:
        ConfigError: one is unknown; it names the key.
    """
    for pattern, known in REFERENCES.items():
        for path, value in found(tables or cfg, pattern.split(".")):
            for name in [value] if isinstance(value, str) else value:
                one_of(path, name, dict.fromkeys(known(cfg)))


def found(node: Any, pattern: list[str], path: tuple[str, ...] = ()) -> Iterator[tuple[str, Any]]:
    """Yield path and value of every text, list or mapping that matches a pattern."""
    if not pattern:
        if isinstance(node, (str, list, tuple, Mapping)):
            yield ".".join(path), node
    elif isinstance(node, Mapping):
        for key in node if pattern[0] == "*" else node.keys() & {pattern[0]}:
            yield from found(node[key], pattern[1:], (*path, str(key)))
