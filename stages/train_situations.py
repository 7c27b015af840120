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


@stage
def main(cfg: DictConfig) -> None:
    """Train network `name` on simulated situations, or with `places` (a fold, or all) on real ones besides.

    Several processes: `torchrun -m stages.train_situations`.
    """
    name, places = stage_key(cfg), cfg.get("places")
    torch.set_num_threads(cfg.training.threads)
    phase = plain(cfg.training["adaptation" if places else "situations"])
    shares = {f"simulated/{key}": share for key, share in phase["shares"].items()}
    named = (
        [f"real/{p}" for p in cfg.places]
        if places == "all"
        else cfg.folds.real[places].train
        if places
        else []
    )
    real = [
        key
        for key in named
        if key.startswith("real/") and read_situations_manifest(Path("data/situations", key))[1]
    ]
    with configured(f"methods.memoryless.{name}.settings"):
        architecture = parse_settings(plain(cfg.methods.memoryless[name].settings))
    with configured("training.adaptation" if places else "training.situations"):
        phase["shares"] = mixed(shares, real, phase.pop("real_share", 0.0))
        settings = SituationSettings.parse(phase)
    folders = {key: Path("data/situations", key) for key in settings.shares}
    previous = Path("models/main", name) if places else None
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
