"""train_corridor, train_main, finetune: one phase of the curriculum for one network."""

from contextlib import ExitStack
from dataclasses import fields
from pathlib import Path

import torch
from omegaconf import DictConfig

from pedpred.config import configured, one_of, plain, stage, stage_key
from pedpred.datasets.lanes import SplitSettings
from pedpred.networks import parse_settings
from pedpred.simulation.fields import parsed, parsed_together
from pedpred.storage.checkpoints import write_checkpoint
from pedpred.storage.shards import has_rows
from pedpred.training.distributed import DeviceSettings, distributed_context
from pedpred.training.fit import PhaseData, copy_phase, fit, write_curve
from pedpred.training.recurrent import TrainingSettings

PREVIOUS = {
    "corridor": "models/autoencoder",
    "main": "models/corridor/{name}",
    "finetune": "models/main/{name}",
}


def device_of(cfg: DictConfig) -> DeviceSettings:
    """Read where to train; sets the number of threads."""
    with configured("training"):
        own = {field.name: cfg.training[field.name] for field in fields(DeviceSettings)}
        device: DeviceSettings = parsed(DeviceSettings, own)
    torch.set_num_threads(device.threads)
    return device


@stage
def main(cfg: DictConfig) -> None:
    """Train network `name` in `phase` on the set `data` or on those of `fold` that have people; else copy it.

    Several processes: `torchrun -m stages.train`.
    """
    name = stage_key(cfg)
    start = one_of("phase", cfg.phase, PREVIOUS)
    with configured(f"training.{cfg.phase}"):
        split, settings = parsed_together([SplitSettings, TrainingSettings], plain(cfg.training[cfg.phase]))
    with configured(f"methods.networks.{name}.settings"):
        architecture = parse_settings(plain(cfg.methods.networks[name].settings))
    device = device_of(cfg)
    folded = "fold" in cfg
    named = cfg.folds.real[cfg.fold].train if folded else []
    sets = [part for part in named if has_rows(Path("data/features", part))] if folded else [cfg.data]
    data = PhaseData(
        [Path("data/features", part) for part in sets],
        [Path("data/embeddings", part) for part in sets],
        Path("models/autoencoder"),
        split,
    )
    label, kind = (f"{cfg.phase}_{cfg.fold}", "real") if folded else (cfg.phase, "sim")
    out = Path(cfg.get("out", f"models/folds/{cfg.fold}/{name}" if folded else f"models/{cfg.phase}/{name}"))
    curve_path = Path(cfg.get("curve", f"reports/curves/{kind}/{label}_{name}.tsv"))
    previous = Path(start.format(name=name))
    if not sets:
        copy_phase(previous, out, curve_path)
        return
    title = f"{cfg.phase} of {name} on {', '.join(sets)}"
    with ExitStack() as group:
        with configured("training"):
            here = group.enter_context(distributed_context(device.device, device.autocast))
        group.enter_context(configured(f"training.{cfg.phase}"))
        network, curve, about = fit(architecture, previous, data, settings, title, here)
    if here.writes:
        write_checkpoint(out, network.state_dict(), about)
        write_curve(curve, curve_path)


if __name__ == "__main__":
    main()
