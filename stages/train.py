"""train_corridor, train_main, finetune and the like: one phase of the curriculum for one network."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, fields, replace
from pathlib import Path

import torch
from omegaconf import DictConfig

from pedpred.config import configured, one_of, plain, stage, stage_key
from pedpred.models.contract import NetworkSettings
from pedpred.models.registry import parse_settings
from pedpred.settings import load, load_together
from pedpred.storage.checkpoints import write_checkpoint
from pedpred.storage.shards import has_rows
from pedpred.storage.situations import read_situations_manifest
from pedpred.training import InstantSettings, SequenceSettings
from pedpred.training.distributed import DeviceSettings, distributed_context
from pedpred.training.fit import copy_phase, fit, load_rows, write_curve
from pedpred.training.instants import RealShare, mix_shares
from pedpred.training.sequences import NamedSets

SEQUENCES, INSTANTS = Path("data/features"), Path("data/situations")
GROUPS = {"networks": SEQUENCES, "memoryless": INSTANTS}
"""Of networks, as in conf/methods -> what those learn from."""


@dataclass(frozen=True)
class Phase:
    """What a row of `training` is.

    Attributes:
        previous: checkpoint of the phase before; {name}: the network. None starts with random weights.
        rows: folder of the sets that are read: sequences for networks with a memory, or instants.
        data: class of what the row says about its sets.
    """

    previous: str | None
    rows: Path
    data: type[NamedSets] | type[RealShare] | None = None


PHASES = {
    "corridor": Phase("models/autoencoder", SEQUENCES, NamedSets),
    "main": Phase("models/corridor/{name}", SEQUENCES, NamedSets),
    "finetune": Phase("models/main/{name}", SEQUENCES),
    "situations": Phase(None, INSTANTS),
    "adaptation": Phase("models/main/{name}", INSTANTS, RealShare),
}


def device_of(cfg: DictConfig) -> DeviceSettings:
    """Read where to train; sets the number of threads."""
    with configured("training"):
        values = {field.name: cfg.training[field.name] for field in fields(DeviceSettings)}
        device: DeviceSettings = load(DeviceSettings, values)
    torch.set_num_threads(device.threads)
    return device


def group_of(groups: Mapping[str, Mapping[str, object]], name: str) -> str:
    """Return which group a network belongs to; a `ConfigError` if it belongs to none."""
    networks = {key: group for group in GROUPS for key in groups.get(group, {})}
    group: str = one_of("name", name, networks)
    return group


def architecture_of(cfg: DictConfig, name: str) -> NetworkSettings:
    """Read the settings of a network."""
    group = group_of(cfg.methods, name)
    with configured(f"methods.{group}.{name}.settings"):
        return parse_settings(plain(cfg.methods[group][name].settings))


def settings_of(
    phase: str, options: Mapping[str, object]
) -> tuple[SequenceSettings | InstantSettings, NamedSets | RealShare | None]:
    """Read a row of `training`: how to train, and what it says about its sets."""
    how = SequenceSettings if PHASES[phase].rows == SEQUENCES else InstantSettings
    data = PHASES[phase].data
    settings, *about = load_together([how] if data is None else [how, data], options)
    return settings, about[0] if about else None


def sets_of(cfg: DictConfig, rows: Path) -> list[str]:
    """Names of the sets of `fold`, or of all places, that have people."""
    fold = cfg.get("fold")
    named = cfg.folds.real[fold].train if fold else [f"real/{place}" for place in cfg.places]
    if rows == SEQUENCES:
        return [key for key in named if has_rows(rows / key)]
    return [key for key in named if key.startswith("real/") and read_situations_manifest(rows / key)[1]]


@stage
def main(cfg: DictConfig) -> None:
    """Train network `name` in `phase` on the sets that its row names, on those of `fold`, or on all places.

    A phase that learns from instants adds its simulated sets. A sequence without any set is a copy of the
    phase before. Several processes: `torchrun -m stages.train`.
    """
    name = stage_key(cfg)
    rows = GROUPS[group_of(cfg.methods, name)]
    phase = one_of("phase", cfg.phase, {key: each for key, each in PHASES.items() if each.rows == rows})
    with configured(f"training.{cfg.phase}"):
        settings, data = settings_of(cfg.phase, plain(cfg.training[cfg.phase]))
    architecture, device = architecture_of(cfg, name), device_of(cfg)
    if isinstance(data, NamedSets):
        sets = list(data.sets)
    else:
        sets = [] if cfg.phase == "situations" else sets_of(cfg, phase.rows)
    title = f"{cfg.phase} of {name} on {', '.join(sets) or 'simulated situations'}"
    out, curve_path = outputs_of(cfg, name)
    previous = None if phase.previous is None else Path(phase.previous.format(name=name))
    if isinstance(settings, InstantSettings):
        shares = {f"simulated/{key}": share for key, share in settings.shares.items()}
        real_share = data.real_share if isinstance(data, RealShare) else 0.0
        settings = replace(settings, shares=mix_shares(shares, sets, real_share))
        sets = list(settings.shares)
    elif not sets:
        assert previous is not None
        copy_phase(previous, out, curve_path)
        return
    folders, embeddings = ({key: top / key for key in sets} for top in (phase.rows, Path("data/embeddings")))
    with ExitStack() as group:
        with configured("training"):
            here = group.enter_context(distributed_context(device.device, device.autocast))
        group.enter_context(configured(f"training.{cfg.phase}"))
        loaded = load_rows(architecture, settings, folders, embeddings, Path("models/autoencoder"))
        network, curve, about = fit(architecture, previous, loaded, settings, title, here)
    if here.writes:
        write_checkpoint(out, network.state_dict(), about)
        write_curve(curve, curve_path)


def outputs_of(cfg: DictConfig, name: str) -> tuple[Path, Path]:
    """Folder of the checkpoint, and file of the curve."""
    fold = cfg.get("fold")
    folder = f"models/folds/{fold}/{name}" if fold else f"models/{cfg.phase}/{name}"
    curve = f"real/finetune_{fold}_{name}" if fold else f"sim/{cfg.phase}_{name}"
    return Path(cfg.get("out", folder)), Path(cfg.get("curve", f"reports/curves/{curve}.tsv"))


if __name__ == "__main__":
    main()
