"""An untrained network as a model folder, for the tests of what runs on the robot."""

import torch

from pedpred.features import FeatureSettings
from pedpred.networks import GridAutoencoder, parse_settings
from pedpred.networks.export import export_onnx
from pedpred.networks.registry import describe_network
from pedpred.online.network import ModelDescription, sensor_shapes, write_description
from pedpred.storage.checkpoints import write_checkpoint
from pedpred.tracking import KalmanSettings

WIDTHS = {"state": 2, "grid": 392, "angular": 72}
TRACKER = KalmanSettings(acceleration_noise=0.05, position_noise_m=0.05)
NETWORK = parse_settings(
    {
        "architecture": "lstm",
        "channels": {
            "state": {"projection": 8, "lstm": 8},
            "grid": {"projection": 64, "lstm": 16},
            "angular": {"projection": 16, "lstm": 16},
        },
        "joint": 32,
        "head": 16,
        "residual": True,
        "uncertainty": "gaussian",
    }
)


def export(folder):
    """Write it, with large weights; the folder, the network and its encoder."""
    torch.manual_seed(0)
    network, encoder = NETWORK.build(WIDTHS, 10).eval(), GridAutoencoder(60, 64).encoder
    for weights in network.parameters():
        torch.nn.init.normal_(weights, std=0.3)
    sizes = FeatureSettings()
    ends = export_onnx(network, encoder, sensor_shapes(sizes), sizes.dt_s, folder / "network.onnx")
    description = ModelDescription(**ends, features=sizes, tracker=TRACKER, standstill_mps=0.2)
    write_description(folder, description, {"trained_on": "nothing"})
    return folder, network, encoder


def write_network(folder, network, about=()):
    """Write a network as a checkpoint; `about` adds to its description."""
    write_checkpoint(folder, network.state_dict(), describe_network(network) | dict(about))
