"""export@name: a network as a model folder for robots (ONNX, description)."""

from dataclasses import fields
from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import configured, one_of, stage, stage_key
from pedpred.features.perception import Following
from pedpred.models.export import export_onnx, store_half
from pedpred.models.lstm.encoding import load_encoder
from pedpred.models.registry import describe_network, load_network
from pedpred.online.network import ModelDescription, write_description
from pedpred.settings import load
from stages.perception import kalman_of

GROUPS = ("online", "driving", "literature")
"""Parts of the configuration with rows `exports`."""


@stage("name")
def main(cfg: DictConfig) -> None:
    """Read a network and, if it reads the grid, the encoder; write models/online/<name>."""
    name = stage_key(cfg)
    tables = [cfg[group].exports for group in GROUPS if group in cfg and "exports" in cfg[group]]
    rows = {key: row for table in tables for key, row in table.items()}
    out, about = Path(cfg.get("out", f"models/online/{name}")), one_of("name", name, rows)
    kalman = kalman_of(cfg, about.tracker)
    with configured("online"):
        how = load(Following, {field.name: cfg.online[field.name] for field in fields(Following)})
    checkpoint = Path(about.weights)
    network, made_with = load_network(checkpoint)
    encoder = None
    if "grid" in network.settings.channels_read:
        encoder = load_encoder(Path("models/autoencoder"))
    shapes, dt_s = made_with.features.shapes(), made_with.protocol.dt_s
    ends = export_onnx(network, encoder, shapes, dt_s, out / "network.onnx")
    store_half(out / "network.onnx")
    description = ModelDescription(
        **ends,
        made_with=made_with,
        tracker=kalman,
        standstill_mps=how.standstill_mps,
        learn_noise=how.learn_noise,
    )
    origin = {"networks": str(checkpoint.parent), "method": about.network, "tracker": about.tracker}
    if checkpoint.name != about.network:
        origin["fold"] = checkpoint.name
    origin |= {"weights": "half precision", **describe_network(network, made_with)}
    write_description(out, description, origin)


if __name__ == "__main__":
    main()
