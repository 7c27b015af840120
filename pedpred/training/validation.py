"""How well a motion network forecasts the sequences that it does not learn from."""

from __future__ import annotations

import numpy as np
import torch

from pedpred.datasets.motion import MotionData
from pedpred.networks.gaussian import negative_log_density
from pedpred.networks.lstm import MotionLstm
from pedpred.networks.rolling import displacements, rolled
from pedpred.training.distributed import ALONE, DistributedContext
from pedpred.training.progress import Progress


def validate(
    network: MotionLstm,
    data: MotionData,
    sequences: np.ndarray,
    progress: Progress,
    train_loss: float,
    context: DistributedContext,
) -> float:
    """Add a row to the curve and keep the weights if they are the best so far; returns the error, m."""
    network.eval()
    found = validation(network, data, sequences, context)
    network.train()
    ade_m = found["validation_ade_m"]
    if ade_m < progress.best_ade_m:
        progress.best = {k: v.detach().clone() for k, v in network.state_dict().items()}
    row = {"epoch": len(progress.curve), "step": progress.step, "train_loss": train_loss}
    progress.curve.append(row | found)
    return ade_m


def validation(
    network: MotionLstm, data: MotionData, sequences: np.ndarray, context: DistributedContext = ALONE
) -> dict[str, float]:
    """Mean over all steps whose whole horizon is known; nan where there is none.

    The processes of a machine divide the sequences [S, 2] among them.

    Returns:
        validation_ade_m: average displacement error, m; and, where the network tells its uncertainty,
        validation_nll: negative log likelihood of the true positions, nats.
    """
    names = ["validation_ade_m"] + ["validation_nll"] * (network.uncertainty is not None)
    sums = torch.zeros(len(names) + 1, dtype=torch.float64, device=data.future.device)  # and how many
    for rows, motion in rolled(network, data, sequences[context.rank :: context.size]):
        known = data.known(rows).all(dim=-1)
        error = displacements(motion.velocities[known], data.future[rows[known]], data.dt_s)
        values = [torch.linalg.vector_norm(error, dim=-1)]
        if motion.spread is not None:
            values.append(negative_log_density(error, motion.spread[known]))
        counted = sums.new_tensor(values[0].numel())
        sums += torch.stack([*(value.double().sum() for value in values), counted])
    *totals, count = context.total(sums).tolist()
    return {name: total / count if count else float("nan") for name, total in zip(names, totals, strict=True)}
