"""From what a network says of each person alone to forecasts: the same for replays, batches and robots.

In this order: world frame; paths move towards straight lines as far as earlier forecasts of the network were
worse than these (`pedpred.forecasting.trust`); they are corrected by the errors of earlier forecasts nearby
(`pedpred.forecasting.local_errors`); people who are forecast together choose their modes together
(`pedpred.forecasting.selection`); regions of probability are scaled by what was learned from earlier
forecasts (`pedpred.forecasting.regions`). A robot then shortens the forecasts of people who have just
appeared (`pedpred.online.caution`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pedpred.forecasting.detections import LEFT_AFTER_S, NO_DETECTIONS, Detections, Instant
from pedpred.forecasting.local_errors import LocalErrors
from pedpred.forecasting.regions import LATELY_S, Regions
from pedpred.forecasting.selection import choose_modes
from pedpred.forecasting.trust import Trust
from pedpred.scenes import Predictions


@dataclass(frozen=True)
class PlaceKnowledge:
    """What was learned at a place from earlier forecasts, and the detections of their time.

    Attributes:
        trust: in the network beside straight lines; None: it is trusted alone.
        regions: how large they are; None: as the network gives them.
        local_errors: of earlier forecasts nearby; None: forecasts are not corrected.
        detections: of the last seconds.
        looked_s: when forecasts were last kept and compared, s.
    """

    trust: Trust | None
    regions: Regions | None
    local_errors: LocalErrors | None = None
    detections: Detections = NO_DETECTIONS
    looked_s: float = -np.inf

    def without_people(self) -> PlaceKnowledge:
        """What was learned, with nobody to learn from."""
        return PlaceKnowledge(
            self.trust and self.trust.without_people(),
            self.regions and self.regions.without_people(),
            self.local_errors and self.local_errors.without_people(),
        )

    def plain(self) -> dict[str, Any]:
        """What was learned, as lists of numbers."""
        learned = {"trust": self.trust, "regions": self.regions, "local_errors": self.local_errors}
        return {name: one and one.plain() for name, one in learned.items()}

    def restored(self, plain: Mapping[str, Any]) -> PlaceKnowledge:
        """With nobody there, and with what another one had learned, see `plain`; what is None stays None.

        Raises:
            ValueRuleError: a value breaks its rule.
        """
        trust, regions, errors = self.trust, self.regions, self.local_errors
        if regions is not None:
            regions = regions.restored(plain["regions"])
        if trust is not None and plain["trust"] is not None:
            trust = trust.restored(plain["trust"])
        if errors is not None and plain["local_errors"] is not None:
            errors = errors.restored(plain["local_errors"])
        return PlaceKnowledge(trust, regions, errors)


@dataclass(frozen=True)
class Postprocessing:
    """Which steps follow a network.

    Attributes:
        together: people choose their modes together.
        learning: regions learn from earlier forecasts.
        noise_m: standard deviation of a detection's coordinate, see `Regions`.
        trust: trust in the network beside straight lines is learned from earlier forecasts.
        local_errors: forecasts are corrected by the errors of earlier ones nearby.
    """

    together: bool = True
    learning: bool = True
    noise_m: float = 0.0
    trust: bool = False
    local_errors: bool = False

    def initial(self, steps: int) -> PlaceKnowledge:
        """What is known before the first instant, for so many steps of the horizon."""
        regions = Regions.initial(steps, self.noise_m, self.trust) if self.learning else None
        trust = Trust.initial(steps) if self.trust else None
        return PlaceKnowledge(trust, regions, LocalErrors.initial(steps) if self.local_errors else None)

    def apply(
        self,
        place: PlaceKnowledge,
        alone: Predictions,
        position: np.ndarray,
        time_s: float,
        person: np.ndarray,
        detection: np.ndarray,
        seen: np.ndarray,
    ) -> tuple[PlaceKnowledge, Predictions]:
        """Apply all steps to the people of one instant.

        Args:
            place: what was learned before.
            alone: of the network, world frame. [N]
            position: where people are, world frame, m. [N, 2]
            time_s: the instant, later than all before, s.
            person: see `Instant`. [N]
            detection: the last one of each, world frame, m. [N, 2]
            seen: see `Instant`. [N]

        Returns:
            What is learned afterwards, and the forecasts.
        """
        trust, regions, errors, forecasts = place.trust, place.regions, place.local_errors, alone
        detections = place.detections.append(time_s, person[seen], detection[seen])
        now = Instant(time_s, person, seen, detections, place.looked_s)
        if trust is not None:
            trust, forecasts = trust.update(now, forecasts)
        if errors is not None:
            errors, forecasts = errors.update(now, forecasts, position)
        if self.together:
            forecasts = choose_modes(forecasts, position)
        if regions is not None:
            regions, forecasts = regions.update(now, forecasts)
        after = PlaceKnowledge(trust, regions, errors, detections, place.looked_s)
        if now.is_look:
            kept_s = max(alone.dt_s * alone.steps + LEFT_AFTER_S, LATELY_S)
            after = replace(after, detections=detections.since(time_s - kept_s), looked_s=time_s)
        return after, forecasts
