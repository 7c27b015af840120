"""What a forecaster is asked, and what it answers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.features import (
    FeatureTable,
    ForecastProtocol,
    ModelFeatures,
    Steps,
    Surroundings,
    neighbours_at,
)
from pedpred.features.surroundings import present_rows
from pedpred.scenes import Predictions, Scene
from pedpred.simulation.settings import SocialForceSettings
from pedpred.tracking import KalmanSettings, Tracks


@dataclass(frozen=True)
class ForecastRequest:
    """Forecast some rows of a scene's feature table.

    A causal forecaster uses rows up to each asked instant only. Those that use more (oracles) say so in
    their label in `conf/report/methods.yaml`.

    Attributes:
        scene: trajectories and obstacles.
        table: states and true futures at all detections of the scene, sorted by track and time.
        sizes: protocol that the table was made with: time step, horizon, ages.
        rows: which rows to forecast. [W]
        tracker: noise of the filter that the tracked states come from; None where states are true.
        detection_interval_s: time between two detections of a track, s.
        social_force: the model of walking at this place; None where there is none.
        clock: instants every `dt_s` from each life's first detection on, when recurrent memories advance;
            sorted by track and step. None where nobody keeps one.
        tracks: the tracker's states, row by row those of `table`; None where nobody reads the past.
        detection_noise_m: declared standard deviation of a detection's coordinate, m.
    """

    scene: Scene
    table: FeatureTable
    sizes: ForecastProtocol
    rows: np.ndarray
    tracker: KalmanSettings | None
    detection_interval_s: float
    social_force: SocialForceSettings | None = None
    clock: Steps | None = None
    tracks: Tracks | None = None
    detection_noise_m: float = 0.0

    @property
    def ahead_s(self) -> np.ndarray:
        """Time from the present to each step of the horizon, s. [P]."""
        return self.sizes.ahead_s

    @property
    def asked(self) -> FeatureTable:
        """The rows to forecast. [W]."""
        return self.table.select(self.rows)

    @property
    def walking_model(self) -> SocialForceSettings:
        """The model of walking at this place.

        Raises:
            ValueRuleError: there is none.
        """
        if self.social_force is None:
            raise ValueRuleError("social_force", None, "joint rollouts need a model of walking")
        return self.social_force

    @property
    def steps(self) -> Steps:
        """The instants at which recurrent memories advance.

        Raises:
            ValueRuleError: there are none.
        """
        if self.clock is None:
            raise ValueRuleError("clock", None, "a recurrent forecaster needs the instants of its own steps")
        return self.clock

    @property
    def max_age_s(self) -> float:
        """People are present while their last detection is at most this old, s."""
        return self.sizes.max_age_intervals * self.detection_interval_s

    @property
    def past(self) -> Tracks:
        """The tracker's states.

        Raises:
            ValueRuleError: there are none.
        """
        if self.tracks is None:
            raise ValueRuleError("tracks", None, "a network without memory needs the past of the people")
        return self.tracks

    def inputs(self, features: ModelFeatures, row: np.ndarray, time_s: np.ndarray) -> dict[str, np.ndarray]:
        """Compute a model's inputs.

        Args:
            features: of the model.
            row: last detections of some people, as rows of `tracks`. [Q]
            time_s: instants; equal ones must be equal to the last bit, s. [Q]
        """
        around = neighbours_at(self.past, time_s, self.max_age_s)
        seen = Surroundings.of(self.past, row, time_s, around, self.scene.occupancy)
        return features.compute(seen, self.sizes.dt_s)

    def present(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Find everybody who is present at each instant of the scene up to the last one of a row to forecast.

        Returns:
            Their last detections, as rows of `tracks` [C]; the instants, s [C]; and where in them the rows
            to forecast are [W].
        """
        asked_s = self.table.time_s[self.rows]
        now_s = np.unique(self.table.time_s[self.table.time_s <= asked_s.max(initial=-np.inf)])
        instant = np.searchsorted(now_s, asked_s)
        row, at = present_rows(self.past.track_id, self.past.time_s, now_s, self.max_age_s)
        order = np.lexsort((row, at))
        row, at = row[order], at[order]
        count = len(self.past.time_s)
        return row, now_s[at], np.searchsorted(at * count + row, instant * count + self.rows)


Forecaster = Callable[[ForecastRequest], Predictions]
"""A method: the world-frame predictions of the rows asked for, in their order."""
