"""export@name: a network as model folders for robots (ONNX, description)."""

from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import row, stage, stage_key
from pedpred.networks.encoding import load_encoder
from pedpred.networks.export import export_int8, export_onnx
from pedpred.networks.registry import describe_network, load_network
from pedpred.online.network import ModelDescription, sensor_shapes, write_description
from pedpred.storage.shards import read_manifest
from pedpred.tracking import KalmanSettings


@stage
def main(cfg: DictConfig) -> None:
    """Read the network and both encoders, write models/online/<name> and <name>_distilled."""
    name = stage_key(cfg)
    out, about = Path(cfg.get("out", f"models/online/{name}")), cfg.online.exports[name]
    distilled = out.with_name(f"{out.name}_distilled")
    network = load_network(Path(about.networks, cfg.online.network))
    features, _ = read_manifest(Path("data/features/simulated/main"))
    encoders = {
        out: load_encoder(Path("models/autoencoder")),
        distilled: load_encoder(Path("models/distilled")),
    }
    for folder, encoder in encoders.items():
        ends = export_onnx(network, encoder, sensor_shapes(features), features.dt_s, folder / "network.onnx")
    export_int8(distilled / "network.onnx", distilled / "network.onnx")
    options = row(cfg, "trackers", about.tracker)
    options.pop("kind")
    tracker = KalmanSettings(**options)
    description = ModelDescription(
        **ends, features=features, tracker=tracker, standstill_mps=cfg.online.standstill_mps
    )
    origin = {"networks": about.networks, **describe_network(network)}
    write_description(out, description, {**origin, "weights": "float32"})
    narrow = "narrow convolutions, int8 in LSTMs and dense layers"
    write_description(distilled, description, {**origin, "weights": narrow})


if __name__ == "__main__":
    main()
