"""The grid auto-encoder and the recurrent motion networks."""

from pedpred.networks.autoencoder import GridAutoencoder, GridEncoder
from pedpred.networks.contract import RecurrentNetwork
from pedpred.networks.forecasting import NetworkForecaster, forecaster
from pedpred.networks.registry import ARCHITECTURES, load_network, parse_settings

__all__ = [
    "ARCHITECTURES",
    "GridAutoencoder",
    "GridEncoder",
    "NetworkForecaster",
    "RecurrentNetwork",
    "forecaster",
    "load_network",
    "parse_settings",
]
