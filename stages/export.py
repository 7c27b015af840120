"""export@phase: the LSTM of a training phase as model folders for robots (ONNX and a description)."""

from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import plain, stage, stage_key
from pedpred.models.encoding import load_encoder
from pedpred.models.export import export_int8, export_onnx
from pedpred.models.forecasting import load_motion_lstm
from pedpred.online.network import ModelDescription, write_description
from pedpred.storage.shards import read_manifest
from pedpred.tracking import KalmanSettings


@stage
def main(cfg: DictConfig) -> None:
    """Read models/{<phase>/lstm,autoencoder,lean}, write models/online/<phase> and <phase>_lean."""
    phase, options = stage_key(cfg), plain(cfg.online)
    out = Path(cfg.get("out", f"models/online/{phase}"))
    lean = out.with_name(f"{out.name}_lean")
    network = load_motion_lstm(Path("models", phase, "lstm"))
    features, _ = read_manifest(Path("data/features/main"))
    encoders = {out: load_encoder(Path("models/autoencoder")), lean: load_encoder(Path("models/lean"))}
    for folder, encoder in encoders.items():
        names = export_onnx(network, encoder, features.grid_cells, folder / "network.onnx")
    export_int8(lean / "network.onnx", lean / "network.onnx")
    tracker = KalmanSettings(**{k: v for k, v in options[phase]["tracker"].items() if k != "kind"})
    description = ModelDescription(
        **names, features=features, tracker=tracker, standstill_mps=options["standstill_mps"]
    )
    origin = {"phase": phase, "network": network.settings.plain()}
    write_description(out, description, {**origin, "weights": "float32"})
    narrow = "narrow convolutions, int8 in LSTMs and dense layers"
    write_description(lean, description, {**origin, "weights": narrow})


if __name__ == "__main__":
    main()
