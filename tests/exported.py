"""Untrained networks, their folders, and tracks to train them on."""

import numpy as np
import torch

from pedpred.datasets import MotionData
from pedpred.features import FeatureSettings
from pedpred.features.situation import channel_widths
from pedpred.networks import GridAutoencoder, parse_settings
from pedpred.networks.export import export_onnx
from pedpred.networks.registry import describe_network
from pedpred.networks.rolling import rolled
from pedpred.online.network import ModelDescription, sensor_shapes, write_description
from pedpred.storage.checkpoints import write_checkpoint
from pedpred.tracking import KalmanSettings

WIDTHS = {"state": 2, "grid": 392, "angular": 72}
TRACKER = KalmanSettings(acceleration_noise=0.05, position_noise_m=0.05)


def lstm(joint, head, channels, **changes):
    """Settings of an LSTM; `channels`: name -> (projection, units)."""
    sizes = {name: {"projection": width, "lstm": units} for name, (width, units) in channels.items()}
    plain = {"architecture": "lstm", "channels": sizes, "joint": joint, "head": head, "residual": True}
    return parse_settings(plain | changes)


NETWORK = lstm(32, 16, {"state": (8, 8), "grid": (64, 16), "angular": (16, 16)}, uncertainty="gaussian")


def write_model(folder, network, encoder, sizes):
    """Export a network for the robot; its description."""
    ends = export_onnx(network, encoder, sensor_shapes(sizes), sizes.dt_s, folder / "network.onnx")
    description = ModelDescription(**ends, features=sizes, tracker=TRACKER, standstill_mps=0.2)
    write_description(folder, description, {"trained_on": "nothing"})
    return description


def export(folder):
    """Write a network with large weights; the folder, the network and its encoder."""
    torch.manual_seed(0)
    network, encoder = NETWORK.build(WIDTHS, 10).eval(), GridAutoencoder(60, 64).encoder
    for weights in network.parameters():
        torch.nn.init.normal_(weights, std=0.3)
    write_model(folder, network, encoder, FeatureSettings())
    return folder, network, encoder


def export_mixture(folder):
    """Write a network without memory, with large weights; the folder, the network and no encoder."""
    torch.manual_seed(0)
    sizes, settings = FeatureSettings(), parse_settings({"architecture": "mixture", "modes": 4, "units": 32})
    network = settings.build(channel_widths(sizes), 10).eval()
    for weights in network.parameters():
        torch.nn.init.normal_(weights, std=0.1)
    write_model(folder, network, GridAutoencoder(60, 64).encoder, sizes)
    return folder, network, None


def write_network(folder, network, about=()):
    """Write a network as a checkpoint; `about` adds to its description."""
    write_checkpoint(folder, network.state_dict(), describe_network(network) | dict(about))


def write_autoencoder(folder, latent=64, tied=True):
    """Write an untrained auto-encoder as a checkpoint, and return it."""
    network = GridAutoencoder(60, latent, tied)
    about = {"kind": "autoencoder", "settings": {"latent": latent}, "cells": 60}
    write_checkpoint(folder, network.state_dict(), about)
    return network


def roll(network, data, sequences):
    """Outputs at every row of some sequences; 0 elsewhere."""
    whole = {}
    for rows, outputs in rolled(network, data, sequences):
        for name, values in outputs.items():
            whole.setdefault(name, values.new_zeros(len(data.future), *values.shape[1:]))[rows] = values
    return whole


def same_weights(one, other):
    return all(torch.equal(a, b) for a, b in zip(one.parameters(), other.parameters(), strict=True))


def motion_data(velocity, future, tracks, **given):
    """Tracks of equal length, one behind the other, with nobody near."""
    edges = np.linspace(0, len(velocity), tracks + 1, dtype=int)
    sequences, track = np.stack([edges[:-1], edges[1:]], axis=-1), np.arange(tracks)
    usual = {"sequences": sequences, "scene": track // 2, "track": track, "embedding": None, "dt_s": 0.3}
    usual |= {"angular": torch.zeros(len(velocity), 72)}
    usual |= {"future_steps": torch.full((len(velocity),), future.shape[1])}
    return MotionData(velocity=velocity, future=future, **usual | given)
