"""train_corridor, train_main, finetune: one phase of the curriculum for one model."""

from pathlib import Path

import torch
from omegaconf import DictConfig

from pedpred.config import plain, stage, stage_key
from pedpred.networks import MotionSettings
from pedpred.training.distributed import distributed_context
from pedpred.training.fit import fit, initialised, write_phase
from pedpred.training.recurrent import TrainingSettings

PREVIOUS = {
    "corridor": "models/autoencoder",
    "main": "models/corridor/{name}",
    "finetune": "models/main/{name}",
}


@stage
def main(cfg: DictConfig) -> None:
    """Train network `name` in `phase` on `data` or on the places of `fold`.

    Several processes: `torchrun -m stages.train`.
    """
    name = stage_key(cfg)
    torch.set_num_threads(cfg.training.threads)
    phase = plain(cfg.training[cfg.phase])
    split = (phase.pop("validation_by"), phase.pop("validation_share"))
    settings = TrainingSettings.parse(phase)
    sizes = plain(cfg.methods.networks[name].settings)
    sizes.pop("architecture")
    (data,) = [f"real/{place}" for place in cfg.folds.real[cfg.fold].train] if "fold" in cfg else [cfg.data]
    network = initialised(
        MotionSettings.parse(sizes | {"horizon_steps": cfg.protocol.horizon_steps}),
        Path(PREVIOUS[cfg.phase].format(name=name)),
        settings.seed,
    )
    title = f"{cfg.phase} of {name} on {data}"
    grid = (Path("data/embeddings") / data, Path("models/autoencoder"))
    with distributed_context(cfg.training.device, cfg.training.autocast) as here:
        curve, about = fit(network, Path("data/features") / data, grid, split, settings, title, here)
    if not here.writes:
        return
    real = cfg.phase == "finetune"
    label, kind = (f"{cfg.phase}_{cfg.fold}", "real") if real else (cfg.phase, "sim")
    out = Path(cfg.get("out", f"models/folds/{cfg.fold}/{name}" if real else f"models/{cfg.phase}/{name}"))
    write_phase(
        network, about, curve, out, Path(cfg.get("curve", f"reports/curves/{kind}/{label}_{name}.tsv"))
    )


if __name__ == "__main__":
    main()
