"""Value types of the kernel: the state of a crowd, and its time steps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Crowd(NamedTuple):
    """State of all pedestrians at one instant; row n of every field is pedestrian n.

    Attributes:
        position: world frame, m. [N, 2]
        velocity: m/s. [N, 2]
        desired_speed: v0, m/s. [N]
        plan: targets to visit in order, indices into `Routes.target`; at least one per person, padded
            with -1. [N, G] int64
        leg: index of the current target in each plan. [N] int64
        group: people with equal numbers walk together; -1: alone. [N] int64
    """

    position: np.ndarray
    velocity: np.ndarray
    desired_speed: np.ndarray
    plan: np.ndarray
    leg: np.ndarray
    group: np.ndarray


class Clock(NamedTuple):
    """Time steps of a simulation.

    Attributes:
        dt_s: integration step, s.
        steps: number of steps.
        every: steps between two records.
        hold: steps per noise sample.
    """

    dt_s: float
    steps: int
    every: int
    hold: int


def crowd_of(
    position: np.ndarray,
    velocity: np.ndarray,
    desired_speed: np.ndarray,
    plan: np.ndarray,
    group: np.ndarray | None = None,
) -> Crowd:
    """Make a crowd at the start of its plans; copies the arrays, which the kernel changes in place.

    Args:
        position: world frame, m. [N, 2]
        velocity: m/s. [N, 2]
        desired_speed: m/s. [N]
        plan: see `Crowd`. [N, G]
        group: see `Crowd`; None: everybody walks alone. [N]
    """
    plan = np.array(plan, dtype=np.int64)
    return Crowd(
        np.array(position, dtype=np.float64),
        np.array(velocity, dtype=np.float64),
        np.array(desired_speed, dtype=np.float64),
        plan,
        np.zeros(len(plan), dtype=np.int64),
        np.full(len(plan), -1) if group is None else np.array(group, dtype=np.int64),
    )
