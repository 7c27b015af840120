"""export@name: a network as a model folder for robots (ONNX, description)."""

from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import configured, one_of, stage, stage_key
from pedpred.features.perception import Standstill
from pedpred.networks.encoding import load_encoder
from pedpred.networks.export import export_onnx, store_half
from pedpred.networks.registry import describe_network, load_network
from pedpred.online.network import ModelDescription, sensor_shapes, write_description
from pedpred.simulation.fields import parsed
from pedpred.storage.shards import read_manifest
from stages.features import kalman_of


@stage
def main(cfg: DictConfig) -> None:
    """Read a network and, if it reads the grid, the encoder; write models/online/<name>."""
    name = stage_key(cfg)
    out, about = Path(cfg.get("out", f"models/online/{name}")), one_of("name", name, cfg.online.exports)
    kalman = kalman_of(cfg, about.tracker)
    with configured("online"):
        standstill = parsed(Standstill, {"standstill_mps": cfg.online.standstill_mps})
    network = load_network(Path(about.networks, about.network))
    features, _ = read_manifest(Path("data/features/simulated/main"))
    encoder = None
    if "grid" in network.settings.channels_read:
        encoder = load_encoder(Path("models/distilled" if about.distilled else "models/autoencoder"))
    ends = export_onnx(network, encoder, sensor_shapes(features), features.dt_s, out / "network.onnx")
    store_half(out / "network.onnx")
    description = ModelDescription(
        **ends,
        features=features,
        tracker=kalman,
        standstill_mps=standstill.standstill_mps,
    )
    origin = {"networks": about.networks, "method": about.network, "tracker": about.tracker}
    origin |= {"distilled": about.distilled, "weights": "half precision", **describe_network(network)}
    write_description(out, description, origin)


if __name__ == "__main__":
    main()
