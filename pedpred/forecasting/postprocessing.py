"""From what a network says of each person alone to forecasts: the same for replays, batches and robots.

In this order: world frame; paths move towards straight lines as far as earlier forecasts of the network were
worse than these (`pedpred.forecasting.trust`); people who are forecast together choose their modes together
(`pedpred.forecasting.selection`); regions of probability are scaled by what was learned from earlier
forecasts (`pedpred.forecasting.regions`). A robot then shortens the forecasts of people who have just
appeared (`pedpred.online.caution`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pedpred.forecasting.detections import NO_DETECTIONS, Detections, Instant
from pedpred.forecasting.regions import LATELY_S, Regions
from pedpred.forecasting.selection import choose_modes
from pedpred.forecasting.trust import LEFT_AFTER_S, Trust
from pedpred.scenes import Predictions


@dataclass(frozen=True)
class PlaceKnowledge:
    """What was learned at a place from earlier forecasts, and the detections of their time.

    Attributes:
        trust: in the network beside straight lines; None: it is trusted alone.
        regions: how large they are; None: as the network gives them.
        detections: of the last seconds.
        looked_s: when forecasts were last kept and compared, s.
    """

    trust: Trust | None
    regions: Regions | None
    detections: Detections = NO_DETECTIONS
    looked_s: float = -np.inf

    def without_people(self) -> PlaceKnowledge:
        """What was learned, with nobody to learn from."""
        trust, regions = self.trust, self.regions
        return PlaceKnowledge(trust and trust.without_people(), regions and regions.without_people())

    def plain(self) -> dict[str, Any]:
        """What was learned, as lists of numbers."""
        return {"trust": self.trust and self.trust.plain(), "regions": self.regions and self.regions.plain()}

    def restored(self, plain: Mapping[str, Any]) -> PlaceKnowledge:
        """With nobody there, and with what another one had learned, see `plain`; what is None stays None.

        Raises:
            ValueRuleError: a value breaks its rule.
        """
        trust, regions = self.trust, self.regions
        if regions is not None:
            regions = regions.restored(plain["regions"])
        if trust is not None and plain["trust"] is not None:
            trust = trust.restored(plain["trust"])
        return PlaceKnowledge(trust, regions)


@dataclass(frozen=True)
class Postprocessing:
    """Which steps follow a network.

    Attributes:
        joint: people choose their modes together.
        learning: regions learn from earlier forecasts.
        noise_m: standard deviation of a detection's coordinate, see `Regions`.
        trust: trust in the network beside straight lines is learned from earlier forecasts.
    """

    joint: bool = True
    learning: bool = True
    noise_m: float = 0.0
    trust: bool = False

    def initial(self, steps: int) -> PlaceKnowledge:
        """What is known before the first instant, for so many steps of the horizon."""
        regions = Regions.initial(steps, self.noise_m, self.trust) if self.learning else None
        return PlaceKnowledge(Trust.initial(steps) if self.trust else None, regions)

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
        trust, regions, forecasts = place.trust, place.regions, alone
        detections = place.detections.append(time_s, person[seen], detection[seen])
        now = Instant(time_s, person, seen, detections, place.looked_s)
        if trust is not None:
            trust, forecasts = trust.update(now, forecasts)
        if self.joint:
            forecasts = choose_modes(forecasts, position)
        if regions is not None:
            regions, forecasts = regions.update(now, forecasts)
        after = replace(place, trust=trust, regions=regions, detections=detections)
        if now.is_look:
            kept_s = max(alone.dt_s * alone.steps + LEFT_AFTER_S, LATELY_S)
            after = replace(after, detections=detections.since(time_s - kept_s), looked_s=time_s)
        return after, forecasts
