"""export@phase: the LSTM of a training phase as model folders for robots (ONNX and a description)."""

from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import plain, stage, stage_key
from pedpred.networks.encoding import load_encoder
from pedpred.networks.export import export_int8, export_onnx
from pedpred.networks.forecasting import load_motion_lstm
from pedpred.online.network import ModelDescription, write_description
from pedpred.storage.shards import read_manifest
from pedpred.tracking import KalmanSettings


@stage
def main(cfg: DictConfig) -> None:
    """Read models/{<phase>/lstm,autoencoder,lean}, write models/online/<phase> and <phase>_distilled."""
    phase, options = stage_key(cfg), plain(cfg.online)
    out = Path(cfg.get("out", f"models/online/{phase}"))
    distilled = out.with_name(f"{out.name}_distilled")
    network = load_motion_lstm(Path("models", phase, "lstm"))
    features, _ = read_manifest(Path("data/features/main"))
    encoders = {
        out: load_encoder(Path("models/autoencoder")),
        distilled: load_encoder(Path("models/distilled")),
    }
    for folder, encoder in encoders.items():
        names = export_onnx(network, encoder, features.grid_cells, folder / "network.onnx")
    export_int8(distilled / "network.onnx", distilled / "network.onnx")
    tracker = KalmanSettings(**{k: v for k, v in options[phase]["tracker"].items() if k != "kind"})
    description = ModelDescription(
        **names, features=features, tracker=tracker, standstill_mps=options["standstill_mps"]
    )
    origin = {"phase": phase, "network": network.settings.plain()}
    write_description(out, description, {**origin, "weights": "float32"})
    narrow = "narrow convolutions, int8 in LSTMs and dense layers"
    write_description(distilled, description, {**origin, "weights": narrow})


if __name__ == "__main__":
    main()
