"""The training loop and what it trains: networks on sequences or instants, and the auto-encoder."""

from pedpred.training.instants import InstantSettings
from pedpred.training.learner import FitSettings, NetworkLearner
from pedpred.training.loop import train
from pedpred.training.pretraining import AutoencoderLearner, AutoencoderSettings
from pedpred.training.sequences import SequenceSettings

__all__ = [
    "AutoencoderLearner",
    "AutoencoderSettings",
    "FitSettings",
    "InstantSettings",
    "NetworkLearner",
    "SequenceSettings",
    "train",
]
