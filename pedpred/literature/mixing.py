"""How recordings and simulated worlds share the rows of a training."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from pedpred.settings import In, Settings


@dataclass(frozen=True, kw_only=True)
class RecordingShare(Settings):
    """How much of a training is recorded.

    Attributes:
        real_share: share of the rows from recordings, which divide it in proportion to the square root of
            their sizes: long ones count more, short ones are not lost.
    """

    real_share: Annotated[float, In("[0, 1]")]

    def mixed(self, simulated: Mapping[str, float], rows: Mapping[str, int]) -> dict[str, float]:
        """Shares of all sets.

        Args:
            simulated: set -> its share of the simulated rows.
            rows: recorded set -> number of its rows.
        """
        whole, roots = sum(simulated.values()), {key: count**0.5 for key, count in rows.items()}
        shares = {key: (1 - self.real_share) * share / whole for key, share in simulated.items()}
        return shares | {key: self.real_share * root / sum(roots.values()) for key, root in roots.items()}
