"""Rows of four tracks, or worlds, and settings of a training, for values by hand."""

from dataclasses import replace

import numpy as np
import torch

from pedpred.datasets.rows import Spans
from tests.exported import LSTM_ROWS, rows_of

DT_S = 0.4
STEPS = 3
EDGES = np.array([0, 6, 9, 16, 20])
SEQUENCES = np.stack([EDGES[:-1], EDGES[1:]], axis=-1)
FIT = {"steps": 5, "validate_every": 1, "lr": 0.25, "warmup_steps": 2, "seed": 11}
FIT |= {"clip_norm": 1e6, "weight_decay": 0.125}


def data_of(made_with=LSTM_ROWS, sets=("a",), part=(0, 0, 0, 0), **channels):
    """Four tracks, or worlds, of 6, 3, 7 and 4 rows, of which not all targets are known."""
    rng = np.random.default_rng(0)
    state = torch.from_numpy(rng.normal(size=(20, 2)).astype(np.float32))
    future = torch.from_numpy(rng.normal(size=(20, STEPS, 2)).astype(np.float32))
    known = torch.tensor([3, 3, 2, 3, 1, 0, 3, 0, 2, 3, 3, 3, 1, 3, 3, 3, 2, 3, 3, 0])
    spans = Spans(SEQUENCES, np.array(part), np.arange(4), np.arange(4))
    protocol = replace(made_with.protocol, dt_s=DT_S, horizon_steps=STEPS)
    made_with = replace(made_with, protocol=protocol)
    data = rows_of(state, future, 4, made_with, spans=spans, future_steps=known, **channels)
    return replace(data, sets=sets)
