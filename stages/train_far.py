"""train_far, train_literature: a network for the time step and horizon of the literature."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from pedpred.config import configured, one_of, part, stage
from pedpred.fields import parsed, parsed_together
from pedpred.literature.mixing import RecordingShare
from pedpred.literature.settings import ComparisonSettings
from pedpred.storage.checkpoints import write_checkpoint
from pedpred.storage.columns import count_rows
from pedpred.storage.situations import read_situations_manifest
from pedpred.training import InstantSettings
from pedpred.training.distributed import distributed_context
from pedpred.training.fit import copy_phase, fit, load_rows, write_curve
from stages.literature import comparison_of
from stages.train import architecture_of, device_of

ROWS = Path("data/far")


def worlds_of(cfg: Mapping[str, Any]) -> InstantSettings:
    """Read how the network is trained in simulation."""
    with configured("literature.worlds"):
        settings: InstantSettings = parsed(InstantSettings, part(cfg, "literature", "worlds"))
    return replace(settings, shares={f"simulated/{key}": share for key, share in settings.shares.items()})


def recordings_of(cfg: Mapping[str, Any]) -> tuple[InstantSettings, RecordingShare]:
    """Read how it is trained on recordings, beside simulated worlds."""
    with configured("literature.recorded"):
        settings, share = parsed_together(
            [InstantSettings, RecordingShare], part(cfg, "literature", "recorded")
        )
    return replace(settings, shares={f"simulated/{key}": own for key, own in settings.shares.items()}), share


def train(
    cfg: DictConfig,
    name: str,
    settings: InstantSettings,
    previous: Path | None,
    out: Path,
    curve: Path,
    title: str,
) -> None:
    """Train network `name` on the sets of `settings.shares`."""
    architecture, device = architecture_of(cfg, name), device_of(cfg)
    folders = {key: ROWS / key for key in settings.shares}
    with configured("training"), distributed_context(device.device, device.autocast) as here:
        rows = load_rows(architecture, settings, folders, {}, Path("models/autoencoder"))
        network, progress, about = fit(architecture, previous, rows, settings, title, here)
    if here.writes:
        write_checkpoint(out, network.state_dict(), about)
        write_curve(progress, curve)


def train_fold(cfg: DictConfig, comparison: ComparisonSettings, name: str, out: Path, curves: Path) -> None:
    """Train a network per seed on the recordings of a fold; without recordings all are that of the worlds."""
    fold = one_of("fold", cfg.fold, comparison.folds)
    settings, share = recordings_of(cfg)
    base = Path("models/far", name)
    sizes: dict[str, int] = {}
    for key in fold.train:
        folder = ROWS / "windows" / key
        if names := read_situations_manifest(folder)[1]:
            sizes[f"windows/{key}"] = sum(count_rows(folder / f"{part}.parquet") for part in names)
    for seed in comparison.seeds:
        folder, curve = out / str(seed), curves / cfg.fold / f"{seed}.tsv"
        if sizes:
            own = replace(settings, seed=seed, shares=share.mixed(settings.shares, sizes))
            train(cfg, name, own, base, folder, curve, f"literature, fold {cfg.fold}, seed {seed}")
        else:
            copy_phase(base, folder, curve)


@stage
def main(cfg: DictConfig) -> None:
    """Write models/far/<network>, trained on worlds; with `fold` models/literature/<fold>/<seed>."""
    comparison = comparison_of(cfg)
    name, top = comparison.network, Path(cfg.get("out", "."))
    curves = top / "reports/curves/literature"
    if cfg.get("fold"):
        train_fold(cfg, comparison, name, top / "models/literature" / cfg.fold, curves)
    else:
        out, title = top / "models/far" / name, f"worlds, {name} on simulated worlds"
        train(cfg, name, worlds_of(cfg), None, out, curves / "worlds.tsv", title)


if __name__ == "__main__":
    main()
