"""Tracks as they could have been elsewhere: what one place alone must not teach."""

from __future__ import annotations

import torch
from torch import Tensor


def varied(
    inputs: dict[str, Tensor],
    future: Tensor,
    chance: Tensor,
    strange_share: float,
    pace_range: tuple[float, float],
) -> tuple[dict[str, Tensor], Tensor]:
    """Move the tracks of some lanes to another world, and let each walk at another pace.

    A place has one map, habits (most turn left at that door) and a pace of its own; a network tuned there
    would learn all three by heart. So some lanes are strange: mirrored at their heading, and beside the
    obstacles that the next lane sees. And all velocities of a lane are multiplied by one factor.

    Args:
        inputs: channel -> [B, L, width].
        future: target velocities, agent frame, m/s. [B, L, P, 2]
        chance: two uniform numbers in [0, 1) per lane, the same all along a track. [B, 2]
        strange_share: share of strange lanes.
        pace_range: the factor, (least, most).

    Returns:
        Inputs and targets of the varied tracks; their shapes stay.
    """
    strange = (chance[:, 0] < strange_share)[:, None, None]
    least, most = pace_range
    pace = (least + (most - least) * chance[:, 1])[:, None, None]
    side = torch.where(strange, -1.0, 1.0)
    scale = torch.cat([pace, pace * side], dim=-1)
    other = {"state": inputs["state"] * scale}
    if "angular" in inputs:  # cell k counts from the heading to the left, so its mirror image is K - 1 - k
        other["angular"] = torch.where(strange, inputs["angular"].flip(-1), inputs["angular"])
    if "grid" in inputs:
        other["grid"] = torch.where(strange, inputs["grid"].roll(1, dims=0), inputs["grid"])
    return other, future * scale[:, :, None]
