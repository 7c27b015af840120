"""Changes of what a planner reads, and drives with them; `benchmarks.driving` says what each one is."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from pedpred.driving.episodes import DriveSettings, Episode
from pedpred.driving.forecasters import Forecaster, PresentMotion
from pedpred.driving.loop import Drive, drive
from pedpred.driving.measures import find_contacts, measure
from pedpred.driving.risk import Steps, contact_m, expected, overlap
from pedpred.driving.runs import Places
from pedpred.driving.table import Condition, Row
from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.online.caution import YOUNG_S
from pedpred.scenes import Forecast, Predictions

_SHARE = 0.2
_WIDE_M = 0.15
_SEEN_AGAIN_S = 0.9
_KEPT_S = 2.0
_LEADS_S = (0.6, 1.2)


@dataclass(frozen=True)
class Changed:
    """A forecaster whose predictions are changed before the planner reads them."""

    forecaster: Forecaster
    change: Callable[[Predictions], Predictions]

    def update(self, time_s: float, track_id: np.ndarray, position: np.ndarray) -> Forecast:
        """See `pedpred.driving.forecasters.Forecaster`."""
        forecast = self.forecaster.update(time_s, track_id, position)
        return replace(forecast, predictions=self.change(forecast.predictions))


def widen(predictions: Predictions) -> Predictions:
    """Add the same variance to all steps."""
    assert predictions.covariance is not None
    return replace(predictions, covariance=predictions.covariance + _WIDE_M**2 * np.eye(2))


def bound(predictions: Predictions) -> Predictions:
    """Hold the covariance from a step on."""
    assert predictions.covariance is not None
    last = round(_SEEN_AGAIN_S / predictions.dt_s) - 1
    step = np.minimum(np.arange(predictions.steps), last)
    return replace(predictions, covariance=predictions.covariance[:, :, step])


class WithKalman:
    """The network's modes and, as one more mode, the forecast of a Kalman filter."""

    def __init__(self, predictor: OnlinePredictor, share: float, new: float):
        """Begin without people; `share` and `new`: weight of that mode, in general and for new people."""
        self._predictor, self._kalman = predictor, PresentMotion(predictor, moving=True, spread=True)
        self._share, self._new = share, new
        self._first_s: dict[int, float] = {}

    def update(self, time_s: float, track_id: np.ndarray, position: np.ndarray) -> Forecast:
        """See `pedpred.driving.forecasters.Forecaster`."""
        forecast = self._predictor.update(time_s, track_id, position)
        other = self._kalman.update(time_s, track_id, position).predictions
        known_s = np.array([time_s - self._first_s.setdefault(n, time_s) for n in forecast.track_id.tolist()])
        share = np.where(known_s < YOUNG_S, self._new, self._share)[:, None]
        if len(forecast) != len(other):  # the network has left somebody out
            return forecast
        modes = forecast.predictions
        weight = np.concatenate([(1.0 - share) * modes.weight, share], axis=1)
        order = np.argsort(-weight, axis=1, kind="stable")
        path, covariance = (
            np.take_along_axis(both, order.reshape(*order.shape, *(1,) * (both.ndim - 2)), axis=1)
            for both in (
                np.concatenate([modes.path, other.path], axis=1),
                np.concatenate([modes.covariance, other.covariance], axis=1),
            )
        )
        weight = np.take_along_axis(weight, order, axis=1)
        return replace(
            forecast, predictions=Predictions(forecast.position, path, weight, modes.dt_s, covariance)
        )


@dataclass(frozen=True)
class Variant:
    """What the planner reads.

    Attributes:
        forecaster: made of a predictor without people.
        instead_of: the variant that it changes; None: nothing is compared.
        shown: whether the forecaster is told where the robot is.
        kept_s: people whom somebody hides are kept for so long; None: as usual.
    """

    forecaster: Callable[[OnlinePredictor], Forecaster]
    instead_of: str | None = "modes"
    shown: bool = False
    kept_s: float | None = None


def _modes(predictor: OnlinePredictor) -> Forecaster:
    return predictor


def _kalman(predictor: OnlinePredictor) -> Forecaster:
    return PresentMotion(predictor, moving=True, spread=True)


VARIANTS = {
    "kalman": Variant(_kalman, None),
    "modes": Variant(_modes, "kalman"),
    "modes_shown": Variant(_modes, shown=True),
    "modes_wide": Variant(lambda predictor: Changed(predictor, widen)),
    "modes_bounded": Variant(lambda predictor: Changed(predictor, bound)),
    "kalman_bounded": Variant(lambda predictor: Changed(_kalman(predictor), bound), "kalman"),
    "modes_and_kalman": Variant(lambda predictor: WithKalman(predictor, _SHARE, _SHARE)),
    "kalman_first": Variant(lambda predictor: WithKalman(predictor, 0.0, 1.0)),
    "modes_hidden": Variant(_modes, kept_s=_KEPT_S),
}


@dataclass(frozen=True)
class Trial:
    """What is driven.

    Attributes:
        places: where.
        model: folder of the network.
        variants: names.
        risks: limits.
        causes: whether collisions are explained.
    """

    places: Places
    model: Path
    variants: Sequence[str]
    risks: Sequence[float]
    causes: bool


@cache
def _predictor(model: Path, settings: OnlineSettings) -> OnlinePredictor:
    return OnlinePredictor.load(model, settings)


def drive_episode(trial: Trial, number: int) -> tuple[list[Row], list[dict[str, Any]]]:
    """Drive an episode with all variants; the job of one worker.

    Returns:
        A row of each variant and limit; causes of collisions, if they are asked for.
    """
    usual = DriveSettings()
    place, episode = trial.places.draw(number, usual)
    rows, causes = [], []
    for name, risk in product(trial.variants, trial.risks):
        variant = VARIANTS[name]
        online = OnlineSettings(detection_noise_m=usual.sensor.noise_m, learn_trust=False)
        if variant.kept_s is not None:
            online = replace(online, max_age_s=variant.kept_s)
        predictor = _predictor(trial.model, online)
        predictor.reset()
        predictor.set_map(place.occupancy)
        settings = replace(usual, planner=replace(usual.planner, risk=risk), shown=variant.shown)
        forecaster, crowd = variant.forecaster(predictor), episode.crowd()
        done = drive(episode, crowd, forecaster, place.occupancy, settings, trial.causes)
        measures = measure(done, episode.route_m, settings.robot, place.walls)
        rows.append(Row(trial.places.name, settings.robot.kind, Condition(name, risk), number, "", measures))
        if trial.causes:
            about = {"variant": name, "limit": risk}
            causes += [about | cause for cause in explain(episode, done, settings)]
    return rows, causes


def explain(episode: Episode, done: Drive, settings: DriveSettings) -> Iterator[dict[str, Any]]:
    """What was known and forecast of each person who was hit at the robot's fault."""
    radius_m, noise_m = settings.robot.radius_m, settings.sensor.noise_m
    contacts = find_contacts(done, radius_m)
    ids = episode.crowd().track_id
    faults = (values[contacts.fault] for values in (contacts.time_s, contacts.person, contacts.speed_mps))
    for time_s, column, speed_mps in zip(*faults, strict=True):
        at = episode.watching + round(time_s / done.dt_s)
        seen = [tick for tick in range(at) if ids[column] in done.detections[tick][0]]
        row: dict[str, Any] = {
            "episode": episode.number,
            "known, s": (at - seen[0]) * done.dt_s if seen else 0.0,
            "seen in the last 1 s, %": 100 * sum(tick >= at - 10 for tick in seen) / 10,
            "relative, m/s": float(speed_mps),
        }
        robot = done.state[min(round(time_s / done.dt_s), len(done.state) - 1), :2]
        for lead_s in _LEADS_S:
            forecast = done.forecasts[max(at - round(lead_s / done.dt_s), 0)]
            which = np.flatnonzero(forecast.track_id == ids[column])
            risk = np.nan
            if len(which):
                people, n = expected(forecast, Steps(lead_s, 1), noise_m), which[0]
                away, spread = people.mean[n, :, 0] - robot, people.covariance[n, :, 0]
                each = zip(people.weight[n], away, spread, strict=True)
                risk = sum(w * overlap(*d, *c, contact_m(radius_m)) for w, d, c in each)
            row[f"probability {lead_s} s before"] = float(risk)
        yield row
