"""eth_ucy_train@network: a network for the protocol of ETH and UCY, in simulation or on folds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import configured, one_of, stage, stage_key
from pedpred.models import ARCHITECTURES
from pedpred.storage.checkpoints import write_checkpoint
from pedpred.storage.columns import count_rows
from pedpred.storage.shards import has_rows
from pedpred.storage.situations import read_situations_manifest
from pedpred.training import InstantSettings, SequenceSettings
from pedpred.training.distributed import distributed_context
from pedpred.training.fit import copy_phase, fit, load_rows, write_curve
from pedpred.workers import in_parallel
from stages.eth_ucy import MODELS, TOP, Phase, phase_of
from stages.train import architecture_of, device_of

EMBEDDINGS, AUTOENCODER = TOP / "embeddings", Path("models/autoencoder")


def rows_of(cfg: DictConfig, name: str) -> Path:
    """Folder of the rows that a network reads."""
    return TOP / "rows" / ARCHITECTURES[cfg.methods.networks[name].settings.architecture].features


def simulated(phase: Phase) -> SequenceSettings | InstantSettings:
    """How a network is trained in simulation."""
    settings, _ = phase
    if isinstance(settings, SequenceSettings):
        return settings
    return replace(settings, shares={f"simulated/{key}": share for key, share in settings.shares.items()})


def recorded(
    phase: Phase, recordings: Sequence[str], rows: Path
) -> tuple[SequenceSettings | InstantSettings, list[str]]:
    """How a network is trained on recordings, and the sets; none where no recording is available."""
    settings, share = simulated(phase), phase[1]
    sets = [f"recorded/{key}" for key in recordings]
    if share is None or isinstance(settings, SequenceSettings):
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
    settings: SequenceSettings | InstantSettings,
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


def train_folds(cfg: DictConfig, name: str, out: Path, curves: Path) -> None:
    """Train a network per fold and seed on recordings, beside each other."""
    base, tasks = MODELS / name / "worlds", []
    for key, fold in cfg.literature.folds.items():
        settings, sets = recorded(phase_of(cfg, name, "recorded"), fold.train, rows_of(cfg, name))
        for seed in cfg.literature.seeds:
            ends = out / key / str(seed), curves / key / f"{seed}.tsv"
            tasks.append((cfg, name, replace(settings, seed=seed), sets, base, *ends))
    in_parallel(train, tasks, f"literature, {name}", "training")


@stage
def main(cfg: DictConfig) -> None:
    """Write models/eth_ucy/<name>/<phase>: trained on `worlds`, or `recorded`, a folder per fold and seed.

    A network with a memory starts from the auto-encoder.
    """
    name, top = stage_key(cfg), Path(cfg.get("out", "."))
    phase = one_of("phase", cfg.phase, {"worlds": "worlds", "recorded": "recorded"})
    out, curves = top / MODELS / name / phase, top / "reports/curves/literature"
    if phase == "recorded":
        train_folds(cfg, name, out, curves / name)
        return
    settings = simulated(phase_of(cfg, name, phase))
    curve = curves / f"worlds/{name}.tsv"
    if isinstance(settings, SequenceSettings):
        train(cfg, name, settings, ["simulated/worlds"], AUTOENCODER, out, curve)
    else:
        train(cfg, name, settings, list(settings.shares), None, out, curve)


if __name__ == "__main__":
    main()
