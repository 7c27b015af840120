"""eth_ucy_train: networks for the protocol of ETH and UCY, in simulation or on folds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from pedpred.config import configured, one_of, stage
from pedpred.models import ARCHITECTURES
from pedpred.storage.checkpoints import write_checkpoint
from pedpred.storage.columns import count_rows
from pedpred.storage.shards import has_rows
from pedpred.storage.situations import read_situations_manifest
from pedpred.training import FitSettings, InstantSettings
from pedpred.training.distributed import distributed_context
from pedpred.training.fit import copy_phase, fit, load_rows, write_curve
from pedpred.workers import in_parallel
from stages.eth_ucy import MODELS, PHASES, TOP, Phase, phase_of
from stages.train import architecture_of, device_of

EMBEDDINGS, AUTOENCODER = TOP / "embeddings", Path("models/autoencoder")


def rows_of(cfg: DictConfig, name: str) -> Path:
    """Folder of the rows that a network reads."""
    return TOP / "rows" / ARCHITECTURES[cfg.methods.networks[name].settings.architecture].features


def simulated(phase: Phase) -> FitSettings:
    """How a network is trained in simulation."""
    settings, _ = phase
    if not isinstance(settings, InstantSettings):
        return settings
    return replace(settings, shares={f"simulated/{key}": share for key, share in settings.shares.items()})


def recorded(phase: Phase, recordings: Sequence[str], rows: Path) -> tuple[FitSettings, list[str]]:
    """How a network is trained on recordings, and the sets; none where no recording is available."""
    settings, share = simulated(phase), phase[1]
    sets = [f"recorded/{key}" for key in recordings]
    if share is None or not isinstance(settings, InstantSettings):
        return settings, [key for key in sets if has_rows(rows / key)]
    sizes = {}
    for key in sets:
        if names := read_situations_manifest(rows / key)[1]:
            sizes[key] = sum(count_rows(rows / key / f"{part}.parquet") for part in names)
    shares = share.mixed(settings.shares, sizes) if sizes else {}
    return replace(settings, shares=shares or settings.shares), list(shares)


def train(
    cfg: DictConfig,
    name: str,
    settings: FitSettings,
    sets: Sequence[str],
    previous: Path | None,
    out: Path,
    curve: Path,
) -> None:
    """Train network `name` on some sets; without any it is the one before. A job of one worker."""
    if not sets:
        assert previous is not None
        copy_phase(previous, out, curve)
        return
    architecture, device, rows = architecture_of(cfg, name), device_of(cfg), rows_of(cfg, name)
    folders, embeddings = ({key: top / key for key in sets} for top in (rows, EMBEDDINGS))
    with configured("training"), distributed_context(device.device, device.autocast) as here:
        loaded = load_rows(architecture, settings, folders, embeddings, AUTOENCODER)
        network, progress, about = fit(architecture, previous, loaded, settings, f"literature, {out}", here)
    if here.writes:
        write_checkpoint(out, network.state_dict(), about)
        write_curve(progress, curve)


def worlds(cfg: DictConfig, name: str) -> Iterator[tuple[Any, ...]]:
    """What trains a network in simulation; one with a memory starts from the auto-encoder."""
    settings = simulated(phase_of(cfg, name, "worlds"))
    if not isinstance(settings, InstantSettings):
        yield settings, ["simulated/worlds"], AUTOENCODER, name
    else:
        yield settings, list(settings.shares), None, name


def folds(cfg: DictConfig, name: str) -> Iterator[tuple[Any, ...]]:
    """What trains a network on the recordings of each fold, with each seed."""
    for key, fold in cfg.literature.folds.items():
        settings, sets = recorded(phase_of(cfg, name, "recorded"), fold.train, rows_of(cfg, name))
        for seed in cfg.literature.seeds:
            yield replace(settings, seed=seed), sets, MODELS / "worlds" / name, f"{name}/{key}/{seed}"


@stage("phase")
def main(cfg: DictConfig) -> None:
    """Write models/eth_ucy/<phase>/<network>: trained on `worlds`, or `recorded`, a folder per fold and seed.

    All trainings of a phase run beside each other.
    """
    top = Path(cfg.get("out", "."))
    trainings = one_of("phase", cfg.phase, dict(zip(PHASES, (worlds, folds), strict=True)))
    out, curves = top / MODELS / cfg.phase, top / "reports/curves/literature" / cfg.phase
    tasks = [
        (cfg, name, *how, out / key, curves / f"{key}.tsv")
        for name in cfg.literature.networks
        for *how, key in trainings(cfg, name)
    ]
    in_parallel(train, tasks, f"literature, {cfg.phase}", "training")


if __name__ == "__main__":
    main()
