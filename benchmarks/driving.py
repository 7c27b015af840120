"""What a planner should read: `python -m benchmarks.driving SCENE [--episodes N] [--risk P]`.

The same episodes are driven with the network's modes and with changes of what the planner reads of them:

* `unseen 2 s`: people who are not seen, because somebody hides them, are kept for 2 s instead of 0.5 s;
* `mixed`: one more mode of weight 0.2, the Kalman filter's forecast with its covariance;
* `new`: the Kalman filter's forecast in place of the network's while a person is known for less than 0.8 s.

A second table has a row for each collision at fault: for how long the person was known, and how likely the
robot's place at that moment seemed to overlap the person some time before it.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.timing import tell
from pedpred.command.arguments import parser as command_parser
from pedpred.command.conversion import read_given
from pedpred.driving.episodes import DriveSettings, Episode, Place, Recording
from pedpred.driving.forecasters import METHODS, PresentMotion
from pedpred.driving.loop import Drive
from pedpred.driving.measures import find_contacts, measure
from pedpred.driving.risk import Steps, contact_m, expected, overlap
from pedpred.driving.runs import Models, Runner
from pedpred.driving.table import Condition
from pedpred.online import OnlinePredictor
from pedpred.online.caution import YOUNG_S
from pedpred.online.shipped import default_model
from pedpred.scenes import Forecast, Predictions

_SHARE = 0.2
_LEADS_S = (0.6, 1.2)
_KEPT_S = 2.0
_VARIANTS = ("kalman", "modes", "unseen 2 s", "mixed", "new")


class WithKalman:
    """The network's modes and, as one more mode, the forecast of a Kalman filter."""

    def __init__(self, predictor: OnlinePredictor, share: float, new: float):
        """Begin without people; `share` and `new`: weight of that mode, in general and for new people."""
        self._predictor, self._kalman = predictor, PresentMotion(predictor, moving=True, spread=True)
        self._share, self._new = share, new
        self._first_s: dict[int, float] = {}

    def update(self, time_s: float, track_id: np.ndarray, position: np.ndarray) -> Forecast:
        """See `pedpred.driving.forecasters.Forecaster`."""
        own = self._predictor.update(time_s, track_id, position)
        other = self._kalman.update(time_s, track_id, position).predictions
        known_s = np.array([time_s - self._first_s.setdefault(n, time_s) for n in own.track_id.tolist()])
        share = np.where(known_s < YOUNG_S, self._new, self._share)[:, None]
        if len(own) != len(other):  # the network has left somebody out
            return own
        weight = np.concatenate([(1.0 - share) * own.predictions.weight, share], axis=1)
        order = np.argsort(-weight, axis=1, kind="stable")
        path, covariance = (
            np.take_along_axis(both, order.reshape(*order.shape, *(1,) * (both.ndim - 2)), axis=1)
            for both in (
                np.concatenate([own.predictions.path, other.path], axis=1),
                np.concatenate([own.predictions.covariance, other.covariance], axis=1),
            )
        )
        weight = np.take_along_axis(weight, order, axis=1)
        return replace(own, predictions=Predictions(own.position, path, weight, own.dt_s, covariance))


def drives(
    runner: Runner, numbers: range, risk: float, variant: str
) -> Iterator[tuple[Place, Episode, Drive]]:
    """Drive episodes with what the planner reads in a variant."""
    kept = replace(runner.predictor.settings, max_age_s=_KEPT_S)
    METHODS["mixed"] = lambda predictor: WithKalman(predictor, _SHARE, _SHARE)
    METHODS["new"] = lambda predictor: WithKalman(predictor, 0.0, 1.0)
    METHODS["unseen 2 s"] = lambda _: OnlinePredictor.load(default_model(), kept)
    for number in numbers:
        place, episode = runner.places.draw(number, runner.settings)
        yield place, episode, runner.driven(place, episode, Condition(variant, risk), keep=True)


def causes(episode: Episode, done: Drive, radius_m: float, noise_m: float) -> Iterator[dict[str, Any]]:
    """What was known and forecast of each person who was hit at the robot's fault."""
    found = find_contacts(done, radius_m)
    ids = episode.crowd().track_id
    faults = (values[found.fault] for values in (found.time_s, found.person, found.speed_mps))
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
                people = expected(forecast, Steps(lead_s, 1), noise_m)
                n = which[0]
                away, spread, weight = (
                    people.mean[n, :, 0] - robot,
                    people.covariance[n, :, 0],
                    people.weight[n],
                )
                each = zip(weight, away, spread, strict=True)
                risk = sum(w * overlap(*d, *c, contact_m(radius_m)) for w, d, c in each)
            row[f"probability {lead_s} s before"] = float(risk)
        yield row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("scene", type=Path)
    parser.add_argument("--episodes", type=int, default=60)
    parser.add_argument("--risk", type=float, default=0.1)
    parser.add_argument("--variant", choices=_VARIANTS, action="append")
    given = parser.parse_args()
    runner = Runner(
        Recording(read_given(command_parser().parse_args(["drive", str(given.scene)]))),
        DriveSettings(),
        Models(default_model()),
    )
    rows, hits = [], []
    for variant in given.variant or _VARIANTS:
        figures = []
        for place, episode, done in drives(runner, range(given.episodes), given.risk, variant):
            robot, noise_m = runner.settings.robot, runner.settings.sensor.noise_m
            figures.append(measure(done, episode.route_m, robot, place.walls))
            hits += [{"variant": variant} | row for row in causes(episode, done, robot.radius_m, noise_m)]
        row = {"variant": variant, "at fault, %": 100 * np.mean([own.faults > 0 for own in figures])}
        row["collisions, %"] = 100 * np.mean([own.contacts > 0 for own in figures])
        row["reached, %"] = 100 * np.mean([own.reached for own in figures])
        rows.append(row | {"time, s": np.mean([own.time_s for own in figures])})
    tell(f"{given.episodes} episodes, limit {given.risk:g}", rows)
    if hits:
        tell("collisions at fault", hits)


if __name__ == "__main__":
    main()
