"""train_situations, finetune_situations, train_robot: a network without memory, on single situations."""

from contextlib import ExitStack
from pathlib import Path

import torch
from omegaconf import DictConfig

from pedpred.config import configured, plain, stage, stage_key
from pedpred.networks import parse_settings
from pedpred.storage.checkpoints import write_checkpoint
from pedpred.storage.situations import read_situations_manifest
from pedpred.training.distributed import distributed_context
from pedpred.training.fit import write_curve
from pedpred.training.situations import SituationSettings, fit_situations, mixed


def real_sets(cfg: DictConfig, on: str) -> list[str]:
    """Sets of a fold, or of all places, that have people: names below data/situations."""
    named = [f"real/{place}" for place in cfg.places] if on == "all" else cfg.folds.real[on].train
    real = [key for key in named if key.startswith("real/")]
    return [key for key in real if read_situations_manifest(Path("data/situations", key))[1]]


@stage
def main(cfg: DictConfig) -> None:
    """Train network `name` on simulated situations, or on those and real ones with `on` (a fold, or all).

    Several processes: `torchrun -m stages.train_situations`.
    """
    name, on = stage_key(cfg), cfg.get("on")
    torch.set_num_threads(cfg.training.threads)
    phase = plain(cfg.training["adaptation" if on else "situations"])
    shares = {f"simulated/{key}": share for key, share in phase["shares"].items()}
    real = real_sets(cfg, on) if on else []
    with configured(f"methods.memoryless.{name}.settings"):
        architecture = parse_settings(plain(cfg.methods.memoryless[name].settings))
    with configured("training.adaptation" if on else "training.situations"):
        phase["shares"] = mixed(shares, real, phase.pop("real_share", 0.0))
        settings = SituationSettings.parse(phase)
    folders = {key: Path("data/situations", key) for key in settings.shares}
    previous = Path("models/main", name) if on else None
    title = f"{name} on {', '.join(real) or 'simulated situations'}"
    with ExitStack() as group:
        with configured("training"):
            context = distributed_context(cfg.training.device, cfg.training.autocast)
            here = group.enter_context(context)
        network, curve, about = fit_situations(architecture, previous, folders, settings, title, here)
    if here.writes:
        write_checkpoint(Path(cfg.out), network.state_dict(), about)
        write_curve(curve, Path(cfg.curve))


if __name__ == "__main__":
    main()
