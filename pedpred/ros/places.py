"""Whether the places in messages can be those of people on the ground."""

from __future__ import annotations

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.scenes import Trajectories


def check_several(people: Trajectories) -> None:
    """Check that not everybody is always at one place, as where a detector fills in another field.

    Raises:
        ValueRuleError: several people are.
    """
    if len(np.unique(people.track_id)) > 1 and not np.ptp(people.position, axis=0).any():
        rule = "everybody is always there: do the messages say in another field where people are?"
        raise ValueRuleError("position", people.position[0].tolist(), rule)
