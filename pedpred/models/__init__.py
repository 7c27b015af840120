"""The learned models: what each reads and computes, in a folder of its own."""

from typing import NamedTuple


class Architecture(NamedTuple):
    """A kind of network.

    Attributes:
        settings: class of its settings, which build the network; imported where it is asked for, so that a
            change of one network concerns no other.
        features: what it reads, a key of `pedpred.models.features.FEATURES`.
    """

    settings: str
    features: str


ARCHITECTURES = {
    "lstm": Architecture("pedpred.models.lstm.network.LstmSettings", "lstm"),
    "mixture": Architecture("pedpred.models.mixture.network.MixtureSettings", "mixture"),
}
"""`architecture`, in configuration and checkpoints -> the network."""
