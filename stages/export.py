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
    """Read models/<phase>/lstm and models/autoencoder, write models/online/<phase> and <phase>_int8."""
    phase, options = stage_key(cfg), plain(cfg.online)
    out = Path(cfg.get("out", f"models/online/{phase}"))
    encoder = load_encoder(Path("models/autoencoder"))
    network = load_motion_lstm(Path("models", phase, "lstm"))
    features, _ = read_manifest(Path("data/features/main"))
    names = export_onnx(network, encoder, features.grid_cells, out / "network.onnx")
    tracker = KalmanSettings(**{k: v for k, v in options[phase]["tracker"].items() if k != "kind"})
    description = ModelDescription(
        **names, features=features, tracker=tracker, standstill_mps=options["standstill_mps"]
    )
    lean = out.with_name(f"{out.name}_int8")
    export_int8(out / "network.onnx", lean / "network.onnx")
    origin = {"phase": phase, "network": network.settings.plain()}
    write_description(out, description, {**origin, "weights": "float32"})
    write_description(lean, description, {**origin, "weights": "int8 in LSTMs and dense layers"})


if __name__ == "__main__":
    main()
