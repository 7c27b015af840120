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
    """Train model `name` in `phase` on the data set `data`; several processes: `torchrun -m stages.train`."""
    name = stage_key(cfg)
    torch.set_num_threads(cfg.training.threads)
    phase = plain(cfg.training[cfg.phase])
    split = (phase.pop("validation_by"), phase.pop("validation_share"))
    settings = TrainingSettings.parse(phase)
    network = initialised(
        MotionSettings.parse(plain(cfg.models[name]) | {"horizon_steps": cfg.protocol.horizon_steps}),
        Path(PREVIOUS[cfg.phase].format(name=name)),
        settings.seed,
    )
    title = f"{cfg.phase} of {name} on {cfg.data}"
    grid = (Path("data/embeddings") / cfg.data, Path("models/autoencoder"))
    with distributed_context(cfg.training.device, cfg.training.autocast) as here:
        curve, about = fit(network, Path("data/features") / cfg.data, grid, split, settings, title, here)
    if not here.writes:
        return
    real = cfg.phase == "finetune"
    label, kind = (f"{cfg.phase}_{cfg.data}", "real") if real else (cfg.phase, "sim")
    out = Path(cfg.get("out", f"models/{label}/{name}"))
    write_phase(
        network, about, curve, out, Path(cfg.get("curve", f"reports/curves/{kind}/{label}_{name}.tsv"))
    )


if __name__ == "__main__":
    main()
