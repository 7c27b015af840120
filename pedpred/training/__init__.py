"""Losses and the training loops."""

from pedpred.training.loss import velocity_loss
from pedpred.training.pretraining import AutoencoderSettings, train_autoencoder
from pedpred.training.recurrent import TrainingSettings, train_motion

__all__ = ["AutoencoderSettings", "TrainingSettings", "train_autoencoder", "train_motion", "velocity_loss"]
