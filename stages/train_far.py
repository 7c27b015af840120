"""train_far, train_literature and the like: networks for the time step and horizon of the literature."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from pedpred.config import configured, one_of, part, stage, stage_key
from pedpred.literature.mixing import RecordingShare
from pedpred.settings import load, load_together
from pedpred.storage.checkpoints import write_checkpoint
from pedpred.storage.columns import count_rows
from pedpred.storage.shards import has_rows
from pedpred.storage.situations import read_situations_manifest
from pedpred.training import InstantSettings, SequenceSettings
from pedpred.training.distributed import distributed_context
from pedpred.training.fit import copy_phase, fit, load_rows, write_curve
from stages.train import architecture_of, device_of, group_of

INSTANTS, STEPS, EMBEDDINGS = Path("data/far"), Path("data/far/steps"), Path("data/far/embeddings")
AUTOENCODER = Path("models/autoencoder")
Phase = tuple[SequenceSettings | InstantSettings, RecordingShare | None]
"""How a network is trained; and, if it learns from instants beside simulated ones, how much is recorded."""


def phase_of(cfg: Mapping[str, Any], group: str, name: str, phase: str) -> Phase:
    """Read how a network is trained: in simulation (`worlds`) or on recordings (`recorded`)."""
    options = part(cfg, "literature", group, name, phase)
    with configured(f"literature.{group}.{name}.{phase}"):
        if group == "networks":
            return load(SequenceSettings, options), None
        classes = [InstantSettings, RecordingShare][: 1 if phase == "worlds" else 2]
        settings, *real_share = load_together(classes, options)
    shares = {f"simulated/{key}": share for key, share in settings.shares.items()}
    return replace(settings, shares=shares), real_share[0] if real_share else None


def recorded(phase: Phase, recordings: Sequence[str]) -> tuple[SequenceSettings | InstantSettings, list[str]]:
    """How a network is trained on recordings, and the sets; none where no recording is available."""
    settings, share = phase
    if share is None or isinstance(settings, SequenceSettings):
        sets = [f"recordings/{key}" for key in recordings]
        return settings, [key for key in sets if has_rows(STEPS / key)]
    sizes = {}
    for key in recordings:
        folder = INSTANTS / "windows" / key
        if names := read_situations_manifest(folder)[1]:
            sizes[f"windows/{key}"] = sum(count_rows(folder / f"{part}.parquet") for part in names)
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
    """Train network `name` on some sets."""
    architecture, device = architecture_of(cfg, name), device_of(cfg)
    top = STEPS if isinstance(settings, SequenceSettings) else INSTANTS
    folders, embeddings = ({key: folder / key for key in sets} for folder in (top, EMBEDDINGS))
    with configured("training"), distributed_context(device.device, device.autocast) as here:
        rows = load_rows(architecture, settings, folders, embeddings, AUTOENCODER)
        network, progress, about = fit(architecture, previous, rows, settings, f"literature, {out}", here)
    if here.writes:
        write_checkpoint(out, network.state_dict(), about)
        write_curve(progress, curve)


def train_fold(cfg: DictConfig, name: str, out: Path, curves: Path) -> None:
    """Train a network per seed on the recordings of a fold; without recordings all are that of the worlds."""
    fold = one_of("fold", cfg.fold, cfg.literature.folds)
    base = Path("models/far", name)
    settings, sets = recorded(phase_of(cfg, group_of(cfg.literature, name), name, "recorded"), fold.train)
    for seed in cfg.literature.seeds:
        folder, curve = out / str(seed), curves / f"{seed}.tsv"
        if sets:
            train(cfg, name, replace(settings, seed=seed), sets, base, folder, curve)
        else:
            copy_phase(base, folder, curve)


@stage
def main(cfg: DictConfig) -> None:
    """Write models/far/<name>, trained on worlds; with `fold` models/literature/<fold>/<name>/<seed>.

    A network with a memory starts from the auto-encoder.
    """
    name, top = stage_key(cfg), Path(cfg.get("out", "."))
    curves = top / "reports/curves/literature"
    if cfg.get("fold"):
        train_fold(cfg, name, top / "models/literature" / cfg.fold / name, curves / cfg.fold / name)
        return
    out, curve = top / "models/far" / name, curves / f"worlds/{name}.tsv"
    settings, _ = phase_of(cfg, group_of(cfg.literature, name), name, "worlds")
    if isinstance(settings, SequenceSettings):
        train(cfg, name, settings, ["worlds"], AUTOENCODER, out, curve)
    else:
        train(cfg, name, settings, list(settings.shares), None, out, curve)


if __name__ == "__main__":
    main()
