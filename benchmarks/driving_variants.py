"""What a planner should read: `python -m benchmarks.driving_variants [--world KIND] [--variant NAME ...]`.

The same episodes are driven with changes of what the planner reads, over several limits of risk:

* `modes`, `kalman`: what `pedpred drive` calls so;
* `modes_shown`: the network gets the robot as one more person;
* `modes_wide`: 0.15 m more deviation at every step;
* `modes_bounded`, `kalman_bounded`: covariances do not grow after 0.9 s, because the robot will have seen
  people again by then (Du Toit and Burdick 2012, partially closed-loop planning);
* `modes_and_kalman`: one more mode of weight 0.2, the Kalman filter's forecast with its covariance;
* `kalman_first`: the Kalman filter's forecast while a person is known for less than 0.8 s;
* `modes_hidden`: occluded people are kept for 2 s instead of 0.5 s.

Each variant is compared with `modes`, or its `kalman` one with `kalman`, at equal time to the goal. The first
table also has the processor time of a drive and of its cycles, without that of drawing the episode.
"""

from __future__ import annotations

import argparse
import logging
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.tables import REPORT, check_options_of_page, show, write_tables
from pedpred.driving.episodes import DriveSettings
from pedpred.driving.figures import Episodes, equal_time, share_interval
from pedpred.driving.forecasters import Forecaster, PresentMotion
from pedpred.driving.loop import drive
from pedpred.driving.measures import measure
from pedpred.driving.places import KINDS, REACTIONS, Worlds
from pedpred.driving.table import Condition, Row
from pedpred.errors import user_errors
from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.online.caution import YOUNG_S
from pedpred.scenes import Forecast, Predictions
from pedpred.workers import in_parallel
from tools.arguments import count, probability

_SHARE = 0.2
_WIDE_M = 0.15
_SEEN_AGAIN_S = 0.9
_KEPT_S = 2.0


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
        if len(forecast) != len(other):  # the network has left out a person
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
        shown: whether the forecaster gets the robot as a person.
        kept_s: how long occluded people are kept; None: the default.
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
        worlds: where.
        model: folder of the network.
        variants: names.
        risks: limits.
    """

    worlds: Worlds
    model: Path
    variants: Sequence[str]
    risks: Sequence[float]


class Times(NamedTuple):
    """Processor time of drawing an episode, s; of driving it, s; and number of cycles, per condition."""

    draw_s: float
    drive_s: dict[Condition, float]
    cycles: dict[Condition, int]


@cache
def _predictor(model: Path, settings: OnlineSettings) -> OnlinePredictor:
    return OnlinePredictor.load(model, settings)


def drive_episode(trial: Trial, number: int) -> tuple[list[Row], Times]:
    """Drive an episode with all variants; the job of one worker."""
    usual, begun_s = DriveSettings(), time.process_time()
    place, episode = trial.worlds.draw(number, usual)
    rows, times = [], Times(time.process_time() - begun_s, {}, {})
    for name, risk in product(trial.variants, trial.risks):
        variant, condition = VARIANTS[name], Condition(name, risk)
        online = OnlineSettings(
            detection_noise_m=usual.sensor.noise_m, learn_trust=False, learn_local_errors=False
        )
        if variant.kept_s is not None:
            online = replace(online, max_age_s=variant.kept_s)
        predictor = _predictor(trial.model, online)
        predictor.reset()
        predictor.set_map(place.occupancy)
        settings = replace(usual, planner=replace(usual.planner, risk=risk), shown=variant.shown)
        forecaster, crowd = variant.forecaster(predictor), episode.crowd()
        begun_s = time.process_time()
        done = drive(episode, crowd, forecaster, place.occupancy, settings)
        times.drive_s[condition] = time.process_time() - begun_s
        times.cycles[condition] = len(done.state) - 1 + episode.watching
        measures = measure(done, episode.route_m, settings.robot, place.walls)
        rows.append(Row(trial.worlds.name, settings.robot.kind, condition, number, "", measures))
    return rows, times


def condition_rows(episodes: Episodes, times: Sequence[Times]) -> Iterator[dict[str, Any]]:
    """Shares and means of each variant and limit."""
    for condition in episodes.conditions:
        fault, value = episodes.at_fault(condition), {k: v[condition] for k, v in episodes.value.items()}
        low, high = share_interval(fault)
        drive_s = np.array([each.drive_s[condition] for each in times])
        cycles = np.array([each.cycles[condition] for each in times])
        yield {
            "variant": condition.method,
            "limit": condition.risk,
            "at fault, %": 100 * float(fault.mean()),
            "95 % interval": f"{100 * low:.1f} to {100 * high:.1f}",
            "collisions, %": 100 * float((value["contacts"] > 0).mean()),
            "reached, %": 100 * float(value["reached"].mean()),
            "time, s": float(value["time_s"].mean()),
            "CPU, s": float(np.median(drive_s)),
            "CPU of a cycle, ms": 1e3 * float(np.median(drive_s / cycles)),
        }


def comparisons(episodes: Episodes) -> Iterator[dict[str, Any]]:
    """Each variant against the one that it changes, at equal time to the goal."""
    names = list(dict.fromkeys(condition.method for condition in episodes.conditions))
    for name in names:
        usual = VARIANTS[name].instead_of
        comparison = equal_time(episodes, name, usual) if usual in names else None
        if comparison is not None:
            middle, low, high = (100 * x for x in (comparison["at_fault"], *comparison["at_fault_ci95"]))
            yield {
                "variant": name,
                "minus": usual,
                "at, s": f"{comparison['time_s']:.1f}",
                "at fault, % (95 % interval)": f"{middle:+.1f} ({low:+.1f} to {high:+.1f})",
            }


@user_errors()
def main(arguments: list[str] | None = None) -> None:
    """Drive, print, and write the comparison if asked."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.driving_variants",
        description=__doc__,
        formatter_class=argparse.RawTextHelpFormatter,
    )
    parser.add_argument("--world", choices=KINDS, default="corridor")
    parser.add_argument("--people", choices=REACTIONS, default=REACTIONS[0])
    parser.add_argument("--model", type=Path, default=Path("models/online/simulation_mixture"))
    parser.add_argument("--episodes", type=count, default=120)
    parser.add_argument("--risk", type=probability, nargs="+", default=[0.1, 0.3, 0.6])
    parser.add_argument("--variant", choices=list(VARIANTS), action="append")
    parser.add_argument("--write", action="store_true", help=f"write the comparison into {REPORT}")
    options = parser.parse_args(arguments)
    check_options_of_page(parser, options)
    worlds = Worlds(options.world, options.people == REACTIONS[0])
    trial = Trial(worlds, options.model, options.variant or list(VARIANTS), options.risk)
    jobs = [(trial, number) for number in range(options.episodes)]
    done = in_parallel(drive_episode, jobs, f"drive {worlds.name}", "episode")
    episodes, times = Episodes.of([row for rows, _ in done for row in rows]), [each for _, each in done]
    draw_s = float(np.median([each.draw_s for each in times]))
    title = f"{worlds.name}, {options.episodes} episodes; drawing one takes {draw_s:.2f} s of CPU time"
    show(title, list(condition_rows(episodes, times)))
    compared = list(comparisons(episodes))
    show("at equal time to the goal", compared)
    if options.write:
        write_tables(REPORT, {"variants": compared})


if __name__ == "__main__":
    logging.disable(logging.WARNING)  # about people who are drawn inside obstacles
    main()
