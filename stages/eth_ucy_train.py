"""eth_ucy_train: networks for the protocol of ETH and UCY, in simulation or on folds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from pedpred.config import one_of, part, row, stage
from pedpred.models import ARCHITECTURES
from pedpred.training import SequenceSettings
from pedpred.workers import in_parallel
from stages.eth_ucy import MODELS, TOP
from stages.train import Inputs, Phase, count_real, read_phase, sets_of, train

EMBEDDINGS, AUTOENCODER = TOP / "embeddings", Path("models/autoencoder")
PHASES = ("worlds", "recorded")
"""Of a training: in simulation, then on the recordings of a fold."""


def phase_of(cfg: Mapping[str, Any], name: str, phase: str) -> Phase:
    """Read how a network is trained in a phase: as in a row of `training`, but for what is given."""
    one_of("name", name, cfg["literature"]["networks"])
    key = f"literature.networks.{name}.{phase}"
    phases = part(cfg, "training") | {key: part(cfg, "literature", "networks", name, phase)}
    return read_phase(key, row({"training": phases}, "training", key))


def rows_of(cfg: DictConfig, network: str) -> Path:
    """Folder of the rows that a network reads."""
    return TOP / "rows" / ARCHITECTURES[cfg.methods.networks[network].settings.architecture].features


def worlds(cfg: DictConfig, network: str) -> Iterator[tuple[Any, ...]]:
    """What trains a network in simulation; one with a memory starts from the auto-encoder."""
    settings, sets = sets_of(phase_of(cfg, network, "worlds"), {})
    previous = AUTOENCODER if isinstance(settings, SequenceSettings) else None
    yield settings, sets, Inputs(rows_of(cfg, network), EMBEDDINGS, AUTOENCODER, previous), network


def folds(cfg: DictConfig, network: str) -> Iterator[tuple[Any, ...]]:
    """What trains a network on the recordings of each fold, with each seed."""
    rows, phase = rows_of(cfg, network), phase_of(cfg, network, "recorded")
    given = Inputs(rows, EMBEDDINGS, AUTOENCODER, MODELS / "worlds" / network)
    for key, fold in cfg.literature.folds.items():
        settings, sets = sets_of(phase, count_real(rows, [f"recorded/{name}" for name in fold.train]))
        for seed in cfg.literature.seeds:
            yield replace(settings, seed=seed), sets, given, f"{network}/{key}/{seed}"


@stage("phase")
def main(cfg: DictConfig) -> None:
    """Write models/eth_ucy/<phase>/<network>: trained on `worlds`, or `recorded`, a folder per fold and seed.

    All trainings of a phase run beside each other.
    """
    top = Path(cfg.get("out", "."))
    trainings = one_of("phase", cfg.phase, dict(zip(PHASES, (worlds, folds), strict=True)))
    out, curves = top / MODELS / cfg.phase, top / "reports/curves/literature" / cfg.phase
    tasks = [
        (cfg, network, *how, out / key, curves / f"{key}.tsv")
        for network in cfg.literature.networks
        for *how, key in trainings(cfg, network)
    ]
    in_parallel(train, tasks, f"literature, {cfg.phase}", "training")


if __name__ == "__main__":
    main()
