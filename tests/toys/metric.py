"""A toy metric: how far ahead of the truth a forecast ends."""

import numpy as np


def overshoot(predictions, truth, scene):
    """Distance at the last step along the true direction, m. [W]."""
    along = truth[:, -1] - truth[:, 0]
    along /= np.maximum(np.linalg.norm(along, axis=-1, keepdims=True), 1e-9)
    return ((predictions.point[:, -1] - truth[:, -1]) * along).sum(axis=-1)
