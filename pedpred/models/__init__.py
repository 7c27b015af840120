"""The learned models: what each reads, computes and is trained on, in a folder of its own."""

ARCHITECTURES = {
    "lstm": "pedpred.models.lstm.network.LstmSettings",
    "mixture": "pedpred.models.mixture.network.MixtureSettings",
}
"""`architecture`, in configuration and checkpoints, -> the class of its settings, which build the network.

It is imported where it is asked for, so that a change of one network concerns no other.
"""
