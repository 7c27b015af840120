"""The training loop and what it trains: recurrent networks, the auto-encoder, a narrow encoder."""

from pedpred.training.loop import train
from pedpred.training.pretraining import AutoencoderLearner, AutoencoderSettings
from pedpred.training.recurrent import RecurrentLearner, TrainingSettings

__all__ = ["AutoencoderLearner", "AutoencoderSettings", "RecurrentLearner", "TrainingSettings", "train"]
