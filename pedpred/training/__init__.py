"""The training loop and what it trains: recurrent networks, the auto-encoder, a narrow encoder."""

from pedpred.training.pretraining import AutoencoderSettings, train_autoencoder
from pedpred.training.recurrent import TrainingSettings, train_motion

__all__ = ["AutoencoderSettings", "TrainingSettings", "train_autoencoder", "train_motion"]
