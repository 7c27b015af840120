"""The grid auto-encoder and the recurrent motion network."""

from pedpred.models.autoencoder import CODE_WIDTH, GridAutoencoder, GridEncoder
from pedpred.models.motion import MotionLstm, MotionSettings, MotionState

__all__ = ["CODE_WIDTH", "GridAutoencoder", "GridEncoder", "MotionLstm", "MotionSettings", "MotionState"]
