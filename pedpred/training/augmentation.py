"""Augmentation of tracks: mirrored, scaled, with other obstacles, with sensor noise and dropout."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Annotated

import numpy as np
import torch
from torch import Tensor

from pedpred.datasets.lanes import LaneBatch
from pedpred.datasets.rows import TrainingRows
from pedpred.settings import In, Range, Settings

_STANDING = np.float32(0.1)
"""Largest factor on the velocities of a person made to stand: 0.13 m/s for an average walker."""


@dataclass(frozen=True)
class Augmentation(Settings):
    """How much the tracks of a training are augmented; nothing by default.

    One place has one map, its habits (most turn left at that door) and its pace; a network tuned there
    overfits to all three, and where nobody stands it learns that people never stand. A robot's tracker is
    noisy, loses people and drives beyond its map.

    Attributes:
        map_swap: share of the tracks that are mirrored about their heading and get the obstacles of the
            lane before.
        speed_scale: factor on all velocities of a track, uniform in (least, most).
        standing_share: share of the tracks whose velocities are divided by ten or more.
        velocity_noise_mps: standard deviation of the noise on each component of the input velocity, m/s.
        neighbour_dropout: share of the steps at which the input has no neighbour.
        map_dropout: share of the sub-sequences in which the input has no obstacle.
    """

    map_swap: Annotated[float, In("[0, 1]")] = 0.0
    speed_scale: Annotated[Range, In("(0, 100]")] = (1.0, 1.0)
    standing_share: Annotated[float, In("[0, 1]")] = 0.0
    velocity_noise_mps: Annotated[float, In("[0, 100]")] = 0.0
    neighbour_dropout: Annotated[float, In("[0, 1]")] = 0.0
    map_dropout: Annotated[float, In("[0, 1]")] = 0.0


@dataclass(frozen=True)
class AugmentedBatch:
    """One sub-sequence of every lane: the rows of its inputs, and how they are altered.

    Attributes:
        rows: rows of the data set; -1 pads behind the end of a track. [B, L]
        crowd: rows whose neighbours are the input; -1 for none. [B, L]
        scenery: rows whose obstacles are the input; -1 for none. [B, L]
        starts: a track starts here. [B] bool
        mirrored: left and right are exchanged. [B] bool
        pace: factor on all velocities. [B] float32
        noise_mps: added to the input velocity. [B, L, 2] float32
    """

    rows: Tensor
    crowd: Tensor
    scenery: Tensor
    starts: Tensor
    mirrored: Tensor
    pace: Tensor
    noise_mps: Tensor

    def part(self, lanes: slice, device: torch.device) -> AugmentedBatch:
        """Some of the lanes, on a device. Small enough that a copy to a GPU does not wait for it."""
        parts = {f.name: getattr(self, f.name)[lanes] for f in fields(self)}
        return AugmentedBatch(**{k: v.to(device, non_blocking=True) for k, v in parts.items()})


def augment(batch: LaneBatch, how: Augmentation, rng: np.random.Generator) -> AugmentedBatch:
    """Draw the augmentation of each lane; swap and pace are constant along a track."""
    rows, (least, most) = batch.rows, how.speed_scale
    swapped = batch.chance[:, 0] < how.map_swap
    scenery = np.where(swapped[:, None], np.roll(rows, 1, axis=0), rows)
    pace = least + (most - least) * batch.chance[:, 1]
    standing = batch.chance[:, 2] < how.standing_share
    unseen, unmapped = rng.random(rows.shape), rng.random((len(rows), 1))
    noise = rng.standard_normal((*rows.shape, 2), dtype=np.float32) * np.float32(how.velocity_noise_mps)
    return AugmentedBatch(
        rows=torch.from_numpy(rows),
        crowd=torch.from_numpy(np.where(unseen < how.neighbour_dropout, -1, rows)),
        scenery=torch.from_numpy(np.where(unmapped < how.map_dropout, -1, scenery)),
        starts=torch.from_numpy(batch.starts),
        mirrored=torch.from_numpy(swapped),
        pace=torch.from_numpy(np.where(standing, _STANDING * batch.chance[:, 1], pace)),
        noise_mps=torch.from_numpy(noise),
    )


def look_up(data: TrainingRows, batch: AugmentedBatch) -> tuple[dict[str, Tensor], Tensor]:
    """Inputs and targets of augmented tracks.

    Returns:
        Inputs, channel -> [B, L, width], and targets, agent frame, m/s. [B, L, P, 2]
    """
    inputs = data.inputs(batch.rows, {"angular": batch.crowd, "grid": batch.scenery})
    mirrored = batch.mirrored[:, None, None]
    pace = batch.pace[:, None, None]
    scale = torch.cat([pace, torch.where(mirrored, -pace, pace)], dim=-1)
    inputs["state"] = inputs["state"] * scale + batch.noise_mps
    # Cell k counts from the heading to the left, so its mirror image is K - 1 - k.
    inputs["angular"] = torch.where(mirrored, inputs["angular"].flip(-1), inputs["angular"])
    return inputs, data.future[batch.rows.clamp(min=0)] * scale[:, :, None]
