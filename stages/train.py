"""train@training: the networks of an architecture in a phase of the curriculum, beside each other."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from itertools import product
from pathlib import Path
from typing import Any

import torch
from omegaconf import DictConfig

from pedpred.config import configured, one_of, part, row, stage, stage_key
from pedpred.models.contract import NetworkSettings
from pedpred.models.registry import parse_settings
from pedpred.rows.files import count_rows_of
from pedpred.settings import Settings, load, load_together
from pedpred.storage.checkpoints import write_checkpoint
from pedpred.training import FitSettings, InstantSettings, SequenceSettings
from pedpred.training.distributed import DeviceSettings, distributed_context
from pedpred.training.fit import copy_phase, fit, load_training_rows, write_curve
from pedpred.training.sets import NamedSets, RealShare
from pedpred.workers import in_parallel
from stages.folds import trained_sets
from stages.sets import tables_of

NONE = "data/config.checked"
"""Where a row of `trainings` names a folder that its training does not read."""


@dataclass(frozen=True)
class Training(Settings):
    """A row of conf/trainings, where its fields are described."""

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
        return load(Training, part(cfg, "trainings", name))


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
    options = row(cfg, "training", phase)
    how = InstantSettings if "shares" in options else SequenceSettings
    with configured(f"training.{phase}"):
        kinds = [kind for kind, name in ((NamedSets, "sets"), (RealShare, "real_share")) if name in options]
        settings, *data = load_together([how, *kinds], options)
    return settings, data[0] if data else None


def sets_of(phase: Phase, real: Mapping[str, int]) -> tuple[FitSettings, list[str]]:
    """How and on which sets a network is trained, of the phase and of `real` ones with so many rows."""
    settings, data = phase
    if isinstance(settings, InstantSettings):
        shares = {f"simulated/{key}": share for key, share in settings.shares.items()}
        share = data if isinstance(data, RealShare) else RealShare()
        settings = replace(settings, shares=share.mix(shares, real))
        return settings, list(settings.shares)
    return settings, list(data.sets if isinstance(data, NamedSets) else real)


def count_real(rows: Path, sets: Iterable[str]) -> dict[str, int]:
    """Number of rows of those real sets that have some."""
    counts = {key: count_rows_of(rows / key) for key in sets}
    return {key: count for key, count in counts.items() if count}


def networks_of(cfg: Mapping[str, Any], architecture: str) -> list[str]:
    """Names of the networks of an architecture; a study has the names of its own in `networks`."""
    rows = cfg["methods"]["networks"]
    named = cfg.get("networks", rows)
    return [name for name in named if rows[name]["settings"]["architecture"] == architecture]


def seeds_of(cfg: Mapping[str, Any], training: Training) -> list[str]:
    """Seeds of a training on folds, if a study has some; no name stands for that of the phase."""
    return [str(seed) for seed in cfg.get("seeds", [""])] if training.folds else [""]


def top_of(folder: str) -> Path:
    """Folder of the sets by kind and name; trainings in simulation name the one of the simulated sets."""
    return Path(folder).parent if Path(folder).name == "simulated" else Path(folder)


def previous_of(training: Training, network: str) -> Path | None:
    """Checkpoint of the weights to start from, or of the encoder; None: random weights."""
    if training.previous in (NONE, training.encoder):
        return None if training.previous == NONE else Path(training.encoder)
    return Path(training.previous, network)


def real_sets(cfg: DictConfig, training: Training, fold: Mapping[str, Any] | None, steps: bool) -> list[str]:
    """Names of the sets that a training may read beside those of its phase: of a fold, or of all places."""
    if Path(training.rows).name == "simulated":
        return []
    named = [f"real/{key}" for key in cfg.places] if fold is None else trained_sets(fold, cfg.places)
    return [key for key in named if steps or key.startswith("real/")]


def train(
    cfg: DictConfig,
    network: str,
    training: Training,
    settings: FitSettings,
    sets: list[str],
    out: Path,
    curve: Path,
) -> None:
    """Train a network on some sets; without any it is the one before. A job of one worker."""
    previous = previous_of(training, network)
    if not sets:
        assert previous is not None
        copy_phase(previous, out, curve)
        return
    architecture, device = architecture_of(cfg, network), device_of(cfg)
    title = f"{curve.parent.name}, {curve.stem}"
    tops = top_of(training.rows), top_of(training.embeddings)
    rows, embeddings = ({key: top / key for key in sets} for top in tops)
    with configured("training"), distributed_context(device.device, device.autocast) as here:
        loaded = load_training_rows(architecture, rows, embeddings, Path(training.encoder))
        trained, progress, about = fit(architecture, previous, loaded, settings, title, here)
        if here.writes:
            write_checkpoint(out, trained.state_dict(), about)
            write_curve(progress, curve)


@stage("name", "network", "fold", "curve", "study")
def main(cfg: DictConfig) -> None:
    """Train row `name` of conf/trainings: models/<name>, a folder per network, in it one per fold and seed.

    `network` and `fold` choose one. Several processes: `torchrun -m stages.train`.
    """
    cfg = tables_of(cfg)
    name = stage_key(cfg)
    training, tasks = training_of(cfg, name), []
    out, curves = Path(cfg.get("out", f"models/{name}")), Path(cfg.get("curve", training.curves))
    networks = chosen("network", cfg.get("network"), networks_of(cfg, training.architecture))
    if training.folds:
        folds = one_of(f"trainings.{name}.folds", training.folds, cfg.folds)
        named = [(f"finetune_{key}", folds[key], key) for key in chosen("fold", cfg.get("fold"), list(folds))]
    else:
        named = [(name.removeprefix(f"{training.architecture}_"), None, "")]
    phase = phase_of(cfg, training.phase)
    for title, fold, key in named:
        real = real_sets(cfg, training, fold, isinstance(phase[0], SequenceSettings))
        settings, sets = sets_of(phase, count_real(top_of(training.rows), real))
        for network, seed in product(networks, seeds_of(cfg, training)):
            how = replace(settings, seed=int(seed)) if seed else settings
            curve = curves / f"{'_'.join(filter(None, (title, network, seed)))}.tsv"
            tasks.append((cfg, network, training, how, sets, out / network / key / seed, curve))
    in_parallel(train, tasks, name, "training")


def chosen(key: str, value: str | None, known: list[str]) -> list[str]:
    """Return one of some names, or all of them if none is given."""
    return known if value is None else [one_of(key, value, {name: name for name in known})]


if __name__ == "__main__":
    main()
