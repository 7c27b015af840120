"""train@training: the networks of an architecture in a phase of the curriculum, beside each other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import torch
from omegaconf import DictConfig

from pedpred.config import configured, one_of, part, stage, stage_key
from pedpred.models.contract import NetworkSettings
from pedpred.models.registry import parse_settings
from pedpred.settings import Settings, load, load_together
from pedpred.storage.checkpoints import write_checkpoint
from pedpred.storage.shards import has_rows
from pedpred.storage.situations import read_situations_manifest
from pedpred.training import FitSettings, InstantSettings, SequenceSettings
from pedpred.training.distributed import DeviceSettings, distributed_context
from pedpred.training.fit import copy_phase, fit, load_rows, write_curve
from pedpred.training.sets import NamedSets, RealShare
from pedpred.workers import in_parallel
from stages.folds import trained_sets

NONE = "data/config.checked"
"""Where a row of `trainings` names a folder that its training does not read."""


@dataclass(frozen=True)
class Training(Settings):
    """A row of conf/trainings, see there.

    Attributes:
        architecture: whose networks are trained.
        phase: row of conf/training.
        rows: folder of the sets.
        embeddings: the frozen encoder's outputs for them.
        encoder: its checkpoint.
        previous: folder of the weights to start from; the encoder itself, or `NONE`.
        curves: folder of the validation scores over the steps.
        folds: group of conf/folds; empty: none.
    """

    architecture: str
    phase: str
    rows: str
    embeddings: str
    encoder: str
    previous: str
    curves: str
    folds: str = ""


Phase = tuple[FitSettings, NamedSets | RealShare | None]
"""How a network is trained, and what the phase says about its sets."""


def training_of(cfg: Mapping[str, Any], name: str) -> Training:
    """Read a row of `trainings`."""
    one_of("name", name, cfg["trainings"])
    with configured(f"trainings.{name}"):
        row: Training = load(Training, part(cfg, "trainings", name))
    return row


def device_of(cfg: DictConfig) -> DeviceSettings:
    """Read where to train; sets the number of threads."""
    with configured("training"):
        values = {field.name: cfg.training[field.name] for field in fields(DeviceSettings)}
        device: DeviceSettings = load(DeviceSettings, values)
    torch.set_num_threads(device.threads)
    return device


def architecture_of(cfg: Mapping[str, Any], name: str) -> NetworkSettings:
    """Read the settings of a network."""
    one_of("network", name, cfg["methods"]["networks"])
    with configured(f"methods.networks.{name}.settings"):
        return parse_settings(part(cfg, "methods", "networks", name, "settings"))


def phase_of(cfg: Mapping[str, Any], phase: str) -> Phase:
    """Read a row of `training`: how to train, and what it says about its sets."""
    options = part(cfg, "training", phase)
    how = InstantSettings if "shares" in options else SequenceSettings
    with configured(f"training.{phase}"):
        kinds = [kind for kind, name in ((NamedSets, "sets"), (RealShare, "real_share")) if name in options]
        settings, *data = load_together([how, *kinds], options)
    return settings, data[0] if data else None


def recorded_sets(cfg: DictConfig, fold: Mapping[str, Any] | None, rows: Path, steps: bool) -> list[str]:
    """Names of the sets of a fold, or of all places, that have people: kind/name."""
    named = [f"real/{key}" for key in cfg.places] if fold is None else trained_sets(fold, cfg.places)
    if steps:
        return [key for key in named if has_rows(rows / key)]
    return [key for key in named if key.startswith("real/") and read_situations_manifest(rows / key)[1]]


def networks_of(cfg: Mapping[str, Any], architecture: str) -> list[str]:
    """Names of the networks of an architecture."""
    rows = cfg["methods"]["networks"].items()
    return [name for name, row in rows if row["settings"]["architecture"] == architecture]


def previous_of(row: Training, network: str) -> Path | None:
    """Checkpoint that a network starts from."""
    if row.previous == NONE:
        return None
    return Path(row.previous) if row.previous == row.encoder else Path(row.previous, network)


def train(
    cfg: DictConfig, row: Training, network: str, fold: Mapping[str, Any] | None, out: Path, curve: Path
) -> None:
    """Train a network on the sets of its phase, of a fold or of all places. A job of one worker."""
    settings, data = phase_of(cfg, row.phase)
    architecture, device, previous = architecture_of(cfg, network), device_of(cfg), previous_of(row, network)
    simulation = Path(row.rows).name == "simulated"
    rows, embedded = (Path(top).parent if simulation else Path(top) for top in (row.rows, row.embeddings))
    if isinstance(data, NamedSets):
        sets = list(data.sets)
    else:
        sets = [] if simulation else recorded_sets(cfg, fold, rows, isinstance(settings, SequenceSettings))
    if isinstance(settings, InstantSettings):
        shares = {f"simulated/{key}": share for key, share in settings.shares.items()}
        share = data if isinstance(data, RealShare) else RealShare()
        settings = replace(settings, shares=share.mixed(shares, dict.fromkeys(sets, 1)))
        sets = list(settings.shares)
    elif not sets:
        assert previous is not None
        copy_phase(previous, out, curve)
        return
    folders, embeddings = ({key: top / key for key in sets} for top in (rows, embedded))
    with configured("training"), distributed_context(device.device, device.autocast) as here:
        loaded = load_rows(architecture, settings, folders, embeddings, Path(row.encoder))
        trained, progress, about = fit(architecture, previous, loaded, settings, curve.stem, here)
        if here.writes:
            write_checkpoint(out, trained.state_dict(), about)
            write_curve(progress, curve)


@stage("name", "network", "fold", "curve")
def main(cfg: DictConfig) -> None:
    """Train row `name` of conf/trainings: models/<name>, a folder per network, and in it one per fold.

    `network` and `fold` choose one. Several processes: `torchrun -m stages.train`.
    """
    name = stage_key(cfg)
    row = training_of(cfg, name)
    out, curves = Path(cfg.get("out", f"models/{name}")), Path(cfg.get("curve", row.curves))
    networks = chosen("network", cfg.get("network"), networks_of(cfg, row.architecture))
    if row.folds:
        folds = one_of(f"trainings.{name}.folds", row.folds, cfg.folds)
        named = [(f"finetune_{key}", folds[key], key) for key in chosen("fold", cfg.get("fold"), list(folds))]
    else:
        named = [(name.removeprefix(f"{row.architecture}_"), None, "")]
    tasks = [
        (cfg, row, network, fold, out / network / key, curves / f"{title}_{network}.tsv")
        for network in networks
        for title, fold, key in named
    ]
    in_parallel(train, tasks, name, "training")


def chosen(key: str, value: str | None, known: list[str]) -> list[str]:
    """Return one of some names, or all of them if none is given."""
    return known if value is None else [one_of(key, value, {name: name for name in known})]


if __name__ == "__main__":
    main()
