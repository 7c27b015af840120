"""Small trainings that tests share: of sequences, whose targets need memory, and of instants."""

import dataclasses

import numpy as np
import torch

from pedpred.features import ForecastProtocol
from pedpred.models.features import RowFormat
from pedpred.models.mixture.features import MixtureFeatures
from pedpred.models.registry import parse_settings
from pedpred.rows.files import write_manifest, write_shard
from pedpred.training import SequenceSettings
from pedpred.training.augmentation import Augmentation
from pedpred.training.instants import InstantSettings
from tests.exported import lstm, rows_of, widths_of

WIDTHS = {"state": 2, "angular": 72}
SMALL = lstm(16, 16, {"state": (8, 8), "angular": (8, 8)}, uncertainty="gaussian")
QUICK = SequenceSettings(
    **{"steps": 6, "lanes": 4, "sub_sequence": 5, "longest_track": 15, "validate_every": 3},
    **{"lr": 1e-2, "warmup_steps": 2, "clip_norm": 1.0, "weight_decay": 1e-4, "seed": 0},
    **{"validation_by": "track", "validation_share": 0.3},
)
VARIED = dataclasses.replace(QUICK, augmentation=Augmentation(0.5, (0.8, 1.2), 0.1, 0.2, 0.2))

STEPS = 4
SIZES = MixtureFeatures(history_steps=3, neighbours=4, beams=16)
MADE_WITH = RowFormat(ForecastProtocol(horizon_steps=STEPS), "mixture", SIZES)
MIXTURE = parse_settings({"architecture": "mixture", "modes": 2, "units": 16})
INSTANTS = InstantSettings(
    **{"steps": 6, "validate_every": 3, "lr": 1e-2, "warmup_steps": 2, "seed": 3, "rows": 32},
    **{"shares": {"a": 0.75, "b": 0.25}, "validation_share": 0.25, "clip_norm": 1.0, "weight_decay": 1e-4},
)


def toy_data(rng, tracks=6, length=20):
    """Tracks whose speed is told at the first step only: later targets need memory."""
    speed = torch.from_numpy(rng.choice([-1.0, 1.0], tracks)).float()
    velocity, future = torch.zeros(tracks, length, 2), torch.zeros(tracks, length, 4, 2)
    velocity[:, 0, 0] = speed
    future[..., 0] = speed[:, None, None]
    return rows_of(velocity.flatten(0, 1), future.flatten(0, 1), tracks)


def write_situations(root):
    """Set `a` of eight worlds of ten rows, and `b` of four: people who stop where a wall is near."""
    rng = np.random.default_rng(0)
    for name, worlds in {"a": 8, "b": 4}.items():
        for world in range(worlds):
            columns = {k: rng.normal(size=(10, n)).astype(np.float32) for k, n in widths_of(SIZES).items()}
            near = rng.random(10) < 0.5
            columns["beams"] = np.where(near[:, None], 1.0, 10.0) * np.ones((10, SIZES.beams))
            columns["neighbours"][:] = 0.0
            going = np.where(near, 0.0, 1.0)[:, None, None] * np.ones((STEPS, 1))
            columns["future"] = columns["state"][:, None] * going
            write_shard([columns], root / name, f"w{world}", MADE_WITH)
        write_manifest(root / name, MADE_WITH, {f"w{world}": str(world) for world in range(worlds)})
    return {name: root / name for name in "ab"}
