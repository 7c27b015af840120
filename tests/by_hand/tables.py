"""Tables of features, for values by hand."""

import numpy as np

from pedpred.features import FeatureTable


def table_of(rows, steps, **given):
    """A feature table with the given columns, and zeros in the others."""
    usual = {name: np.zeros(rows) for name in ("track_id", "phase", "step", "time_s", "heading_rad")}
    pairs = ("position", "velocity", "last_position", "last_velocity", "last_acceleration")
    usual |= {name: np.zeros((rows, 2)) for name in pairs}
    usual |= {"future": np.zeros((rows, steps, 2), np.float32), "future_steps": np.zeros(rows, np.int8)}
    return FeatureTable(**usual | {name: np.asarray(values) for name, values in given.items()})
