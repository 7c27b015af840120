"""The training loop and what it trains: networks on sequences or instants, and the auto-encoder."""

from pedpred.training.instants import InstantLearner, InstantSettings
from pedpred.training.loop import train
from pedpred.training.pretraining import AutoencoderLearner, AutoencoderSettings
from pedpred.training.sequences import SequenceLearner, SequenceSettings

__all__ = [
    "AutoencoderLearner",
    "AutoencoderSettings",
    "InstantLearner",
    "InstantSettings",
    "SequenceLearner",
    "SequenceSettings",
    "train",
]
