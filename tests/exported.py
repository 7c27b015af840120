"""Untrained networks, their folders, and tracks to train them on."""

from dataclasses import replace

import numpy as np
import torch

from pedpred.datasets import TrainingRows
from pedpred.datasets.rows import Spans
from pedpred.features import ForecastProtocol
from pedpred.models.export import export_onnx
from pedpred.models.features import RowFormat
from pedpred.models.forecaster import NetworkForecaster
from pedpred.models.lstm.autoencoder import GridAutoencoder
from pedpred.models.lstm.features import LstmFeatures
from pedpred.models.mixture.features import MixtureFeatures
from pedpred.models.registry import describe_network, parse_settings
from pedpred.online.network import ModelDescription, write_description
from pedpred.online.settings import MOST_PEOPLE, OnlineSettings
from pedpred.storage.checkpoints import write_checkpoint
from pedpred.tracking import KalmanSettings
from pedpred.tracking.tracks import TIME_TOLERANCE_S
from pedpred.training import NetworkLearner
from pedpred.training.distributed import ALONE
from pedpred.training.sequences import SequenceSampler, run_over_sequences

WIDTHS = {"state": 2, "grid": 392, "angular": 72}
TRACKER = KalmanSettings(acceleration_noise=0.05, position_noise_m=0.05)
PROTOCOL = ForecastProtocol()
LSTM_ROWS = RowFormat(PROTOCOL, "lstm", LstmFeatures())
MIXTURE_ROWS = RowFormat(PROTOCOL, "mixture", MixtureFeatures())


def as_offline(protocol, detection_dt_s):
    """What makes a replay give the pipeline's forecasts, for detections `detection_dt_s` apart."""
    return OnlineSettings(
        protocol.max_age_intervals * detection_dt_s, TIME_TOLERANCE_S, most_people=MOST_PEOPLE
    )


def widths_of(features):
    """Channel -> numbers per person."""
    return {name: shape[0] for name, shape in features.shapes().items()}


def lstm(joint, head, channels, **changes):
    """Settings of an LSTM; `channels`: name -> (projection, units)."""
    sizes = {name: {"projection": width, "lstm": units} for name, (width, units) in channels.items()}
    plain = {"architecture": "lstm", "channels": sizes, "joint": joint, "head": head, "residual": True}
    return parse_settings(plain | changes)


NETWORK = lstm(32, 16, {"state": (8, 8), "grid": (64, 16), "angular": (16, 16)}, uncertainty="gaussian")


def write_model(folder, network, encoder, made_with):
    """Export a network for the robot; its description."""
    shapes, dt_s = made_with.features.shapes(), made_with.protocol.dt_s
    ends = export_onnx(network, encoder, shapes, dt_s, folder / "network.onnx")
    description = ModelDescription(**ends, made_with=made_with, tracker=TRACKER, standstill_mps=0.2)
    write_description(folder, description, {"trained_on": "nothing"})
    return description


def export(folder):
    """Write a network with large weights; the folder, the network and its encoder."""
    torch.manual_seed(0)
    network, encoder = NETWORK.build(WIDTHS, 10).eval(), GridAutoencoder(60, 64).encoder
    for weights in network.parameters():
        torch.nn.init.normal_(weights, std=0.3)
    write_model(folder, network, encoder, LSTM_ROWS)
    return folder, network, encoder


def export_mixture(folder, protocol=PROTOCOL):
    """Write a network without memory, with large weights; the folder, the network and no encoder."""
    torch.manual_seed(0)
    settings = parse_settings({"architecture": "mixture", "modes": 4, "units": 32})
    network = settings.build(widths_of(MIXTURE_ROWS.features), protocol.horizon_steps).eval()
    for weights in network.parameters():
        torch.nn.init.normal_(weights, std=0.1)
    write_model(folder, network, GridAutoencoder(60, 64).encoder, replace(MIXTURE_ROWS, protocol=protocol))
    return folder, network, None


def forecaster_of(network, encoder, **choices):
    """The network as a forecaster, with the inputs of its kind."""
    rows = LSTM_ROWS if network.state_shapes else MIXTURE_ROWS
    return NetworkForecaster(network, rows.features, encoder, **choices)


def write_network(folder, network, made_with=LSTM_ROWS):
    """Write a network as a checkpoint."""
    write_checkpoint(folder, network.state_dict(), describe_network(network, made_with))


def write_autoencoder(folder, latent=64, tied=True):
    """Write an untrained auto-encoder as a checkpoint, and return it."""
    network = GridAutoencoder(60, latent, tied)
    about = {"kind": "autoencoder", "settings": {"latent": latent}, "cells": 60}
    write_checkpoint(folder, network.state_dict(), about)
    return network


def roll(network, data, sequences):
    """Outputs at every row of some sequences; 0 elsewhere."""
    whole = {}
    for rows, outputs in run_over_sequences(network, data, sequences):
        for name, values in outputs.items():
            whole.setdefault(name, values.new_zeros(len(data.future), *values.shape[1:]))[rows] = values
    return whole


def train_on(network, data, training, validation, how, context=ALONE):
    """The learner of a network on some sequences of its rows."""
    sampler = SequenceSampler(data, training, validation, how, context)
    return NetworkLearner(network, data, sampler, how, context)


def same_weights(one, other):
    return all(torch.equal(a, b) for a, b in zip(one.parameters(), other.parameters(), strict=True))


def rows_of(state, future, tracks, made_with=LSTM_ROWS, **given):
    """Tracks of equal length, one behind the other, with nobody near; `given`: other channels, or fields."""
    edges = np.linspace(0, len(state), tracks + 1, dtype=int)
    track = np.arange(tracks)
    spans = Spans(np.stack([edges[:-1], edges[1:]], axis=-1), np.zeros(tracks, int), track // 2, track)
    usual = {"spans": spans, "future_steps": torch.full((len(state),), future.shape[1])}
    fields = {name: given.pop(name) for name in ("spans", "future_steps", "empty") if name in given}
    channels = {"state": state, "angular": torch.zeros(len(state), 72)} | given
    return TrainingRows(channels, future, sets=("tracks",), row_format=made_with, **usual | fields)
