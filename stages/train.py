"""train_corridor, train_main, finetune: one phase of the curriculum for one network."""

from contextlib import ExitStack
from pathlib import Path

import torch
from omegaconf import DictConfig

from pedpred.config import configured, one_of, plain, stage, stage_key
from pedpred.networks import parse_settings
from pedpred.storage.checkpoints import write_checkpoint
from pedpred.storage.shards import has_rows
from pedpred.training.distributed import distributed_context
from pedpred.training.fit import PhaseData, copy_phase, fit, write_curve
from pedpred.training.recurrent import TrainingSettings

PREVIOUS = {
    "corridor": "models/autoencoder",
    "main": "models/corridor/{name}",
    "finetune": "models/main/{name}",
}


@stage
def main(cfg: DictConfig) -> None:
    """Train network `name` in `phase` on the set `data` or on those of `fold` that have people; else copy it.

    Several processes: `torchrun -m stages.train`.
    """
    name = stage_key(cfg)
    torch.set_num_threads(cfg.training.threads)
    start, phase = one_of("phase", cfg.phase, PREVIOUS), plain(cfg.training[cfg.phase])
    folded = "fold" in cfg
    named = cfg.folds.real[cfg.fold].train if folded else []
    sets = [part for part in named if has_rows(Path("data/features", part))] if folded else [cfg.data]
    data = PhaseData(
        [Path("data/features", part) for part in sets],
        [Path("data/embeddings", part) for part in sets],
        Path("models/autoencoder"),
        phase.pop("validation_by"),
        phase.pop("validation_share"),
    )
    label, kind = (f"{cfg.phase}_{cfg.fold}", "real") if folded else (cfg.phase, "sim")
    out = Path(cfg.get("out", f"models/folds/{cfg.fold}/{name}" if folded else f"models/{cfg.phase}/{name}"))
    curve_path = Path(cfg.get("curve", f"reports/curves/{kind}/{label}_{name}.tsv"))
    previous = Path(start.format(name=name))
    if not sets:
        copy_phase(previous, out, curve_path)
        return
    with configured(f"methods.networks.{name}.settings"):
        architecture = parse_settings(plain(cfg.methods.networks[name].settings))
    title = f"{cfg.phase} of {name} on {', '.join(sets)}"
    with configured(f"training.{cfg.phase}"):
        settings = TrainingSettings.parse(phase)
    with ExitStack() as group:
        with configured("training"):
            context = distributed_context(cfg.training.device, cfg.training.autocast)
            here = group.enter_context(context)
        network, curve, about = fit(architecture, previous, data, settings, title, here)
    if here.writes:
        write_checkpoint(out, network.state_dict(), about)
        write_curve(curve, curve_path)


if __name__ == "__main__":
    main()
