"""The grid auto-encoder and the recurrent motion network."""

from pedpred.networks.autoencoder import EMBEDDING_WIDTH, GridAutoencoder, GridEncoder
from pedpred.networks.lstm import MotionLstm, MotionSettings, MotionState

__all__ = ["EMBEDDING_WIDTH", "GridAutoencoder", "GridEncoder", "MotionLstm", "MotionSettings", "MotionState"]
