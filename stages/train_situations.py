"""train_situations, finetune_situations, train_robot: a network without memory, on single situations."""

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import configured, plain, stage, stage_key
from pedpred.networks import parse_settings
from pedpred.simulation.fields import parsed_together
from pedpred.storage.checkpoints import write_checkpoint
from pedpred.storage.situations import read_situations_manifest
from pedpred.training.distributed import distributed_context
from pedpred.training.fit import write_curve
from pedpred.training.situations import RealShare, SituationSettings, fit_situations, mixed
from stages.train import device_of


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
    phase, device = "adaptation" if on else "situations", device_of(cfg)
    with configured(f"training.{phase}"):
        kinds = [SituationSettings, RealShare] if on else [SituationSettings]
        settings, *real_share = parsed_together(kinds, plain(cfg.training[phase]))
    with configured(f"methods.memoryless.{name}.settings"):
        architecture = parse_settings(plain(cfg.methods.memoryless[name].settings))
    real = real_sets(cfg, on) if on else []
    shares = {f"simulated/{key}": share for key, share in settings.shares.items()}
    settings = replace(settings, shares=mixed(shares, real, real_share[0].real_share if on else 0.0))
    folders = {key: Path("data/situations", key) for key in settings.shares}
    previous = Path("models/main", name) if on else None
    title = f"{name} on {', '.join(real) or 'simulated situations'}"
    with ExitStack() as group:
        with configured("training"):
            here = group.enter_context(distributed_context(device.device, device.autocast))
        group.enter_context(configured(f"training.{phase}"))
        network, curve, about = fit_situations(architecture, previous, folders, settings, title, here)
    if here.writes:
        write_checkpoint(Path(cfg.out), network.state_dict(), about)
        write_curve(curve, Path(cfg.curve))


if __name__ == "__main__":
    main()
