"""How well a motion network forecasts the sequences that it does not learn from."""

from __future__ import annotations

import numpy as np
import torch

from pedpred.datasets.motion import MotionData
from pedpred.models.motion import MotionLstm
from pedpred.models.rolling import displacements, roll
from pedpred.models.uncertainty import negative_log_density
from pedpred.training.machine import ALONE, Machine
from pedpred.training.progress import Progress


def validate(
    network: MotionLstm,
    data: MotionData,
    sequences: np.ndarray,
    progress: Progress,
    train_loss: float,
    machine: Machine,
) -> float:
    """Add a row to the curve and keep the weights if they are the best so far; returns the error, m."""
    network.eval()
    found = validation(network, data, sequences, machine)
    network.train()
    ade_m = found["validation_ade_m"]
    if ade_m < progress.best_ade_m:
        progress.best = {k: v.detach().clone() for k, v in network.state_dict().items()}
    row = {"epoch": len(progress.curve), "step": progress.step, "train_loss": train_loss}
    progress.curve.append(row | found)
    return ade_m


def validation(
    network: MotionLstm, data: MotionData, sequences: np.ndarray, machine: Machine = ALONE
) -> dict[str, float]:
    """Mean over all steps whose whole horizon is known; nan where there is none.

    The processes of a machine divide the sequences [S, 2] among them.

    Returns:
        validation_ade_m: average displacement error, m; and, where the network tells its uncertainty,
        validation_nll: negative log likelihood of the true positions, nats.
    """
    mine = sequences[machine.rank :: machine.size]
    rows = np.concatenate([np.arange(a, b) for a, b in mine]) if len(mine) else np.zeros(0, np.int64)
    known = torch.from_numpy(rows).to(data.future.device)
    known = known[data.known(known).all(dim=-1)]
    motion = roll(network, data, mine)
    error = displacements(motion.velocities[known], data.future[known], data.dt_s)
    found = {"validation_ade_m": torch.linalg.vector_norm(error, dim=-1)}
    if motion.spread is not None:
        found["validation_nll"] = negative_log_density(error, motion.spread[known])
    sums = [value.double().sum() for value in found.values()]
    *totals, count = machine.total(
        torch.stack([*sums, sums[0].new_tensor(found["validation_ade_m"].numel())])
    ).tolist()
    return {name: total / count if count else float("nan") for name, total in zip(found, totals, strict=True)}
