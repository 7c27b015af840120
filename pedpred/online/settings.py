"""How a stream of detections is treated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pedpred.errors import ValueRuleError
from pedpred.settings import In, Settings
from pedpred.tracking import KalmanSettings

MOST_PEOPLE = 100_000
"""Largest limit of people: for recordings, which wait for nobody."""


@dataclass(frozen=True)
class OnlineSettings(Settings):
    """How a stream of detections is treated.

    Attributes:
        max_age_s: a person is present while the last detection is at most this old, s.
        snap_s: a step that became due at most this long before a frame is taken with the frame, s.
        tracker: noise of the detections and of walking; None: what the model folder says.
        learn_noise: learn the noise of each person's detections, see `pedpred.tracking.noise`; None: no
            if there is a `tracker`, otherwise what the model folder says.
        detection_noise_m: standard deviation of a detection's coordinate, m. Regions of probability learn
            from detections, and without it they become large enough to hold the detector's noise, too.
        learn_trust: learn from earlier forecasts how far to trust the network beside lines, see
            `pedpred.forecasting.trust`.
        learn_local_errors: correct forecasts by the errors of earlier ones nearby, see
            `pedpred.forecasting.local_errors`; not for a world frame that drifts or turns with the robot.
        most_people: people to follow; of more, those who came first. An update for 1000 takes up to 0.3 s.
    """

    max_age_s: Annotated[float, In("[0, inf)")] = 0.5
    snap_s: Annotated[float, In("[0, inf)")] = 0.05
    tracker: KalmanSettings | None = None
    learn_noise: bool | None = None
    detection_noise_m: Annotated[float, In("[0, 100]")] = 0.0
    learn_trust: bool = True
    learn_local_errors: bool = True
    most_people: Annotated[int, In("[1, 100000]")] = 1000

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.tracker is not None and not isinstance(self.tracker, KalmanSettings):
            raise ValueRuleError("tracker", self.tracker, "it must be KalmanSettings or None")
