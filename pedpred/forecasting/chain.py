"""From what a network says of each person alone to forecasts: the same for replays, batches and robots.

In this order: world frame; paths move towards straight lines as far as earlier forecasts of the network were
worse than these (`pedpred.forecasting.trust`); people who are forecast together choose their modes together
(`pedpred.forecasting.selection`); regions of probability are scaled by what was learned from earlier
forecasts (`pedpred.forecasting.regions`). A robot then shortens the forecasts of people who have just
appeared (`pedpred.online.caution`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from pedpred.features import ModelFeatures
from pedpred.forecasting.regions import Regions
from pedpred.forecasting.request import ForecastRequest
from pedpred.forecasting.selection import choose_modes
from pedpred.forecasting.trust import Trust
from pedpred.scenes import Predictions
from pedpred.tracking.tracks import TIME_TOLERANCE_S

_ROWS_AT_ONCE = 2048

Infer = Callable[[np.ndarray, Mapping[str, np.ndarray]], Predictions]
"""Agent-frame predictions of some people, from the rows of their last detections and a model's inputs."""


@dataclass(frozen=True)
class Place:
    """What was learned at a place from earlier forecasts.

    Attributes:
        trust: in the network beside straight lines; None: it is trusted alone.
        regions: how large they are; None: as the network gives them.
    """

    trust: Trust | None
    regions: Regions | None

    def without_people(self) -> Place:
        """What was learned, with nobody to learn from."""
        trust, regions = self.trust, self.regions
        return Place(trust and trust.without_people(), regions and regions.without_people())

    def plain(self) -> dict[str, Any]:
        """What was learned, as lists of numbers."""
        return {"trust": self.trust and self.trust.plain(), "regions": self.regions and self.regions.plain()}

    def relearned(self, plain: Mapping[str, Any]) -> Place:
        """Of an unlearned one: with what another one had learned; what is None stays None.

        Raises:
            ValueRuleError: a value breaks its rule.
        """
        trust, regions = self.trust, self.regions
        if regions is not None:
            regions = regions.relearned(plain["regions"])
        if trust is not None and plain["trust"] is not None:
            trust = trust.relearned(plain["trust"])
        return Place(trust, regions)


@dataclass(frozen=True)
class Chain:
    """Which links there are.

    Attributes:
        together: people choose their modes together.
        learning: regions learn from earlier forecasts.
        noise_m: standard deviation of a detection's coordinate, see `Regions`.
        trust: trust in the network beside straight lines is learned from earlier forecasts.
    """

    together: bool = True
    learning: bool = True
    noise_m: float = 0.0
    trust: bool = False

    def unlearned(self, steps: int) -> Place:
        """What is known before the first instant, for so many steps of the horizon."""
        regions = Regions.unlearned(steps, self.noise_m, self.trust) if self.learning else None
        return Place(Trust.unlearned(steps) if self.trust else None, regions)

    def apply(
        self,
        place: Place,
        alone: Predictions,
        position: np.ndarray,
        time_s: float,
        person: np.ndarray,
        detection: np.ndarray,
        seen: np.ndarray,
    ) -> tuple[Place, Predictions]:
        """Apply all links to the people of one instant.

        Args:
            place: what was learned before.
            alone: world frame. [N]
            position: where people are, world frame, m. [N, 2]
            time_s: the instant, s.
            person: see `Regions.after`. [N]
            detection: see there. [N, 2]
            seen: see there. [N]

        Returns:
            What is learned afterwards, and the forecasts.
        """
        (trust, regions), forecasts = (place.trust, place.regions), alone
        if trust is not None:
            trust, forecasts = trust.after(time_s, person, detection, seen, forecasts)
        if self.together:
            forecasts = choose_modes(forecasts, position)
        if regions is not None:
            regions, forecasts = regions.after(time_s, person, detection, seen, forecasts)
        return Place(trust, regions), forecasts


def forecast_blocks(
    request: ForecastRequest,
    features: ModelFeatures,
    infer: Infer,
    chain: Chain,
    progress: Callable[[list[tuple[int, int]]], Iterable[tuple[int, int]]] = iter,
) -> Iterator[tuple[np.ndarray, Predictions]]:
    """Forecast the rows of a request at their instants, block by block, which bounds the memory.

    Everybody present is forecast, not only who is asked for, because people choose together.

    Args:
        request: about tracked people.
        features: of the model.
        infer: the model, without memory.
        chain: which links there are.
        progress: shows how far the blocks are.

    Yields:
        Which of the rows to forecast, at whole instants, in the order of time [B]; their predictions, world
        frame [B].
    """
    row, time_s, asked = request.present()
    order = np.argsort(asked, kind="stable")
    tracks, lost_s = request.past, request.sizes.lost_after_s + TIME_TOLERANCE_S
    position, kept = tracks.position_at(row, time_s), tracks.kept()
    place, before_s = chain.unlearned(request.sizes.horizon_steps), np.inf
    for at, end in progress(instant_blocks(time_s)):
        block, now_s = row[at:end], time_s[at:end]
        alone = infer(block, request.inputs(features, block, now_s)).in_world(
            position[at:end], tracks.heading_rad[block]
        )
        seen = (tracks.time_s[block] > now_s - TIME_TOLERANCE_S) & kept[block]
        parts = []
        for rows in _instants(now_s):
            if now_s[rows[0]] - before_s > lost_s:
                place = place.without_people()
            own, before_s = block[rows], now_s[rows[-1]]
            known = float(now_s[rows[0]]), tracks.life[own], tracks.detection[own], seen[rows]
            place, forecasts = chain.apply(place, alone.select(rows), position[at:end][rows], *known)
            parts.append(forecasts)
        which = order[slice(*np.searchsorted(asked, [at, end], sorter=order))]
        if len(which):
            yield which, Predictions.join(parts).select(asked[which] - at)


def instant_blocks(time_s: np.ndarray) -> list[tuple[int, int]]:
    """First row and end of blocks of whole instants: the people of one choose together. [C], rising."""
    starts = np.flatnonzero(np.diff(time_s, prepend=-np.inf) > TIME_TOLERANCE_S)
    edges = starts[np.diff(starts // _ROWS_AT_ONCE, prepend=-1) > 0].tolist()
    return list(pairwise([*edges, len(time_s)]))


def _instants(time_s: np.ndarray) -> list[np.ndarray]:
    """Rows of each instant; times never fall. [C]."""
    later = np.flatnonzero(np.diff(time_s) > TIME_TOLERANCE_S) + 1
    return np.split(np.arange(len(time_s)), later)
