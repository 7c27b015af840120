"""export_simulated, export_real: a fold's network as model folders for robots (ONNX, description)."""

from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import row, stage
from pedpred.networks.encoding import load_encoder
from pedpred.networks.export import export_int8, export_onnx
from pedpred.networks.forecasting import load_motion_lstm
from pedpred.online.network import ModelDescription, write_description
from pedpred.storage.shards import read_manifest
from pedpred.tracking import KalmanSettings


@stage
def main(cfg: DictConfig) -> None:
    """Read the network and both encoders, write models/online/<fold> and <fold>_distilled."""
    out = Path(cfg.get("out", f"models/online/{cfg.fold}"))
    distilled = out.with_name(f"{out.name}_distilled")
    network = load_motion_lstm(Path(cfg.networks, cfg.online.network))
    features, _ = read_manifest(Path("data/features/simulated/main"))
    encoders = {
        out: load_encoder(Path("models/autoencoder")),
        distilled: load_encoder(Path("models/distilled")),
    }
    for folder, encoder in encoders.items():
        names = export_onnx(network, encoder, features.grid_cells, folder / "network.onnx")
    export_int8(distilled / "network.onnx", distilled / "network.onnx")
    options = row(cfg, "trackers", cfg.folds[cfg.kind][cfg.fold].tracker)
    options.pop("kind")
    tracker = KalmanSettings(**options)
    description = ModelDescription(
        **names, features=features, tracker=tracker, standstill_mps=cfg.online.standstill_mps
    )
    origin = {"fold": cfg.fold, "network": network.settings.plain()}
    write_description(out, description, {**origin, "weights": "float32"})
    narrow = "narrow convolutions, int8 in LSTMs and dense layers"
    write_description(distilled, description, {**origin, "weights": narrow})


if __name__ == "__main__":
    main()
