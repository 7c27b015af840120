"""Errors beside what makes forecasts harder: `python -m benchmarks.robustness STUDY [FILE ...] [--write]`.

* `other_people`: people of JuPedSim (`pip install 'pedpred[bench]'`), on whom no network was trained;
* `noise`: white noise on the detections of recordings, beside a Kalman filter that is fitted to each of them
  with its noise; `alone`: the same with each person alone and without obstacles;
* `curves`: lone walkers with three turn rates, beside the best Kalman filter of each case;
* `corridors`: distance that is forecast between walls, relative to the true one;
* `bias`: mean displacement along the heading by present speed, with and without the map;
* `rates`: detections at 0.5 to 100 Hz, for forecasts at the same instants.

Errors are ADE over 3 s, m. FILE: recordings that `pedpred evaluate` reads; by default the places in
data/scenes/real. `--write` puts the table into its page. The pages were written with the default options.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from itertools import pairwise, product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from benchmarks.people import (
    JUPEDSIM_MODELS,
    circling,
    corridor,
    geometries,
    straight,
    turning,
    write_jupedsim,
)
from benchmarks.tables import REPORT, check_options_of_page, show, write_tables
from pedpred.baselines.present_motion import PRESENT_MOTION, kalman_velocity
from pedpred.command.evaluation import isolating_shifts, shift_times
from pedpred.command.prediction import predictor_for
from pedpred.command.recordings import open_scene
from pedpred.errors import user_errors
from pedpred.evaluation import EvaluationSettings, find_windows
from pedpred.features import ForecastProtocol
from pedpred.features.perception import Perception, sensed
from pedpred.metrics import METRICS
from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.online.assessment import assess, forecasts_by_instants
from pedpred.online.predictor import NO_MAP
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from pedpred.simulation.sensor import SensorSettings
from pedpred.tracking import KalmanSettings
from tools.arguments import count, positive
from tools.places import add_recordings, recordings

NOISES_M = (0.0, 0.02, 0.05, 0.1)
TURNS_RADPS, TURN_RATES_HZ, TURN_NOISES_M = (0.0, 0.15, 0.4), (2.5, 10.0, 25.0), (0.0, 0.05, 0.1)
WIDTHS_M, SPEEDS_MPS, FROM_WALL_M = (0.9, 1.0, 1.2, 1.5, 2.0, 3.0), (0.9, 1.2, 1.5), 0.25
SPEED_EDGES_MPS, FEWEST_WINDOWS = (0.0, 0.2, 0.5, 1.0, 10.0), 30
RATES_HZ = (0.5, 1.0, 2.5, 5.0, 10.0, 25.0, 50.0, 100.0)
_EXACT_M, _LEAST_M = 0.002, 0.005
"""Noise that the filter assumes of exact detections; the least error to which a ratio is printed."""

Row = dict[str, Any]
Walk = Callable[[float], np.ndarray]
"""Positions of all people at a time (s), m, NaN for people who are not there. [N, 2]."""


def learning(max_age_s: float, learns: bool, **other: KalmanSettings) -> OnlineSettings:
    """Settings of a robot that learns at a place, or does not."""
    return OnlineSettings(max_age_s, learn_trust=learns, learn_local_errors=learns, **other)


def ade_m(
    scene: Scene, model: Path | None, settings: OnlineSettings, sensor: SensorSettings | None = None
) -> dict[str, float]:
    """Mean ADE in a scene of the network and of the simple methods, m.

    Args:
        scene: recorded or simulated people.
        model: a model folder; None: the shipped one.
        settings: of the network's predictor.
        sensor: between the scene and the tracker; None for a perfect one.
    """
    predictor, metrics = OnlinePredictor.load(model, settings), {"ade_m": METRICS["ade_m"]}
    scores = assess(scene, predictor, EvaluationSettings(), sensor, metrics=metrics)
    return {method: float(np.nanmean(each.values["ade_m"])) for method, each in scores.items()}


# People of another simulator


def other_people(options: argparse.Namespace) -> Iterator[Row]:
    """A row for each geometry and model of JuPedSim."""
    cases = product(geometries().items(), JUPEDSIM_MODELS)
    with TemporaryDirectory() as folder:
        for number, ((name, (ground, ways)), walking) in enumerate(cases):
            path = Path(folder, f"{number}.sqlite")
            write_jupedsim(walking, ground, ways, path, np.random.default_rng(number))
            scene = open_scene(path)
            trusting, error = (ade_m(scene, options.model, learning(0.125, trust)) for trust in (True, False))
            best = min(error["cv"], error["kalman_cv"])
            yield {
                "ground": name,
                "people": walking.removesuffix("Model"),
                "CV": error["cv"],
                "Kalman CV": error["kalman_cv"],
                "network": error["network"],
                "network / the better": error["network"] / best,
                "with trust": trusting["network"],
                "with trust / the better": trusting["network"] / best,
            }


# Noise of recordings


def noise(options: argparse.Namespace, alone: bool = False) -> Iterator[Row]:
    """A row for each recording: error of the network, and its ratio to the better simple method, by noise."""
    for scene in recordings(options.recording, options.rate):
        people = scene.trajectories
        people = people.select(people.time_s < people.time_s.min() + options.seconds)
        if alone:
            people = shift_times(people, isolating_shifts(people))
            scene = replace(scene, occupancy=OccupancyMap.free_around(people.position))
        scene = replace(scene, trajectories=people)
        rate_hz = options.detections if 1.0 / scene.detection_dt_s > options.detections else 0.0
        row: Row = {"place": scene.name}
        for noise_m in NOISES_M:
            sensor = SensorSettings(rate_hz=rate_hz, position_noise_m=noise_m)
            age_s = 1.25 * sensed(scene, sensor).detection_dt_s
            error = ade_m(scene, options.model, learning(age_s, options.trust), sensor)
            ratio = error["network"] / min(error["cv"], error["kalman_cv"])
            row[f"{100 * noise_m:g} cm"] = f"{error['network']:.3f} ({ratio:.2f})"
        yield row


def alone(options: argparse.Namespace) -> Iterator[Row]:
    """As `noise`, with each person alone and without obstacles."""
    return noise(options, alone=True)


# Turns of lone people


def curves(options: argparse.Namespace) -> Iterator[Row]:
    """A row for each turn rate and noise: network / best filter (ratio), by rate of the detections."""
    for turn_radps, noise_m in product(TURNS_RADPS, TURN_NOISES_M):
        scene = turning(turn_radps, options.people or 60)
        row: Row = {"turn rate, rad/s": f"{turn_radps:g}", "noise, m": f"{noise_m:g}"}
        for rate_hz in TURN_RATES_HZ:
            sensor = SensorSettings(rate_hz=rate_hz, position_noise_m=noise_m)
            settings = learning(1.25 / rate_hz, options.trust)
            network = ade_m(scene, options.model, settings, sensor)["network"]
            best = best_filter_m(scene, sensor)
            ratio = f" ({network / best:.2f})" if best > _LEAST_M else ""
            row[f"{rate_hz:g} Hz"] = f"{network:.3f} / {best:.3f}{ratio}"
        yield row


def best_filter_m(scene: Scene, sensor: SensorSettings) -> float:
    """Error of the Kalman filter with the best process noise of a grid, m."""
    sizes, noise_m = ForecastProtocol(), max(sensor.position_noise_m, _EXACT_M)
    errors = []
    for q in np.geomspace(1e-4, 3.0, 12):
        how = Perception(KalmanSettings(float(q), noise_m), 0.2, sensor)
        windows = find_windows(scene, how, sizes, memory=False)
        miss = kalman_velocity()(windows.request).mean - windows.truth
        errors.append(np.linalg.norm(miss, axis=-1).mean())
    return float(min(errors))


# Walls


def corridors(options: argparse.Namespace) -> Iterator[Row]:
    """A row for each width: forecast distance / true distance, by distance from the walls."""
    for width_m in WIDTHS_M:
        aside_m = {
            "in the middle": 0.0,
            f"{FROM_WALL_M} m from a wall": width_m / 2 - FROM_WALL_M,
            f"{FROM_WALL_M} m inside a wall": width_m / 2 + FROM_WALL_M,
        }
        walkers = list(product(range(options.people or 10), SPEEDS_MPS))
        row: Row = {"width, m": f"{width_m:g}"}
        for name, y in aside_m.items():
            shares = [
                walked_share(options.model, corridor(width_m), y, speed, np.random.default_rng(person))
                for person, speed in walkers
            ]
            row[name] = float(np.mean(shares))
        yield row


def walked_share(
    model: Path | None, ground: OccupancyMap, aside_m: float, speed_mps: float, rng: np.random.Generator
) -> float:
    """Forecast distance along x / true distance of a person who walks for 6 s at 10 Hz with 2 cm of noise."""
    predictor = OnlinePredictor.load(model)
    predictor.set_map(ground)
    for time_s in np.arange(60) / 10.0:
        here = np.array([[8.0 + speed_mps * time_s, aside_m]])
        forecast = predictor.update(float(time_s), np.array([1]), here + rng.normal(0, 0.02, (1, 2)))
    ahead_s = predictor.protocol.horizon_steps * predictor.protocol.dt_s
    return float((forecast.position[0, -1, 0] - here[0, 0]) / (speed_mps * ahead_s))


# Starts and stops


def bias(options: argparse.Namespace) -> Iterator[Row]:
    """A row for each recording and range of speeds; without the map only where it has obstacles."""
    for scene in recordings(options.recording, options.rate):
        along = ahead_m(scene, options.model)
        blind = np.full_like(along["network"], np.nan)
        if scene.occupancy.occupied.any():
            blind = ahead_m(replace(scene, occupancy=NO_MAP), options.model)["network"]
        columns = {name: along[name] for name in ("truth", "network", "cv")} | {"network, no map": blind}
        for low, high in pairwise(SPEED_EDGES_MPS):
            some = (along["speed"] >= low) & (along["speed"] < high)
            if some.sum() >= FEWEST_WINDOWS:
                row = {"place": scene.name, "speed, m/s": f"{low:g} to {high:g}", "windows": int(some.sum())}
                yield row | {name: float(values[some].mean()) for name, values in columns.items()}


def ahead_m(scene: Scene, model: Path | None) -> dict[str, np.ndarray]:
    """Displacement of each window along the heading at the horizon, m, and its speed, m/s. [W] each."""
    age_s = predictor_for(scene, None).settings.max_age_s
    predictor = OnlinePredictor.load(model, learning(age_s, False))
    how = Perception(predictor.filters, predictor.description.standstill_mps)
    windows = find_windows(scene, how, predictor.protocol, memory=False)
    request = replace(windows.request, tracker=None)
    asked = request.asked
    heading = np.stack([np.cos(asked.heading_rad), np.sin(asked.heading_rad)], axis=-1)
    network = np.empty((len(asked.time_s), 2))
    for which, forecast in forecasts_by_instants(predictor, request, scene):
        network[which] = forecast.mean[:, -1]
    ends = {"truth": windows.truth[:, -1], "network": network}
    ends["cv"] = PRESENT_MOTION["cv"]()(request).mean[:, -1]
    along = {name: ((end - asked.position) * heading).sum(axis=-1) for name, end in ends.items()}
    return along | {"speed": np.hypot(*asked.velocity.T)}


# Rates of the frames

_LENGTH_S, _SEEN_S, _EVERY_S, _RATE_NOISE_M = 20.0, 4.0, 2.0, 0.03
_AHEAD_S = 0.3 * np.arange(1, 11)


def rates(options: argparse.Namespace) -> Iterator[Row]:
    """A row for each rate; columns are straight, circling and recorded people, in the same windows."""
    walks: dict[str, Walk] = {"straight": straight, "curving": circling}
    for scene in recordings(options.recording, options.rate) if options.recording else ():
        walks[f"recorded ({scene.name})"] = between_detections(scene.trajectories)
    for rate_hz in RATES_HZ:
        row: Row = {"frames": f"{rate_hz:g} Hz"}
        for name, walk in walks.items():
            errors_m = errors_at_rate(walk, rate_hz, options.model)
            row[f"{name}, {len(errors_m)} windows"] = float(errors_m.mean())
        yield row


def between_detections(people: Trajectories) -> Walk:
    """Interpolate people linearly; time 0 is 10 s before the middle of the recording."""
    start_s = float(np.median(people.time_s)) - _LENGTH_S / 2
    own = [people.track_id == track for track in np.unique(people.track_id)]
    paths = [(people.time_s[rows] - start_s, people.position[rows].T) for rows in own]
    paths = [(time_s, xy) for time_s, xy in paths if time_s[-1] > 0 and time_s[0] < _LENGTH_S]
    return lambda now: np.array(
        [[np.interp(now, time_s, part, np.nan, np.nan) for part in xy] for time_s, xy in paths]
    )


def errors_at_rate(walk: Walk, rate_hz: float, model: Path | None) -> np.ndarray:
    """ADE every 2 s of people who have been seen for 4 s, with 3 cm of noise, m. [W]."""
    rng, robot, errors = np.random.default_rng(0), OnlinePredictor.load(model), []
    for frame in range(int(_LENGTH_S * rate_hz) + 1):
        now = frame / rate_hz
        here = walk(now)
        there = np.flatnonzero(np.isfinite(here).all(axis=1))
        forecast = robot.update(now, there, here[there] + rng.normal(0, _RATE_NOISE_M, (len(there), 2)))
        if now < _SEEN_S or now % _EVERY_S:
            continue
        known = np.isfinite(walk(now - _SEEN_S)[forecast.track_id]).all(axis=1)
        truth = np.stack([walk(now + ahead)[forecast.track_id] for ahead in _AHEAD_S], axis=1)
        known &= np.isfinite(truth).all(axis=(1, 2))
        errors.append(np.linalg.norm(forecast.position - truth, axis=-1).mean(axis=1)[known])
    return np.concatenate(errors)


class Study(NamedTuple):
    """A table of a page.

    Attributes:
        rows: measures them.
        model: that the page shows; None: the shipped one.
        page: with the table of this name.
    """

    rows: Callable[[argparse.Namespace], Iterator[Row]]
    model: Path | None = None
    page: Path = REPORT


_SIMULATED = Path("models/online/simulation_mixture")
STUDIES: Mapping[str, Study] = {
    "other_people": Study(other_people),
    "noise": Study(noise, _SIMULATED, Path("docs/robustness.md")),
    "alone": Study(alone, _SIMULATED),
    "curves": Study(curves, _SIMULATED),
    "corridors": Study(corridors),
    "bias": Study(bias, _SIMULATED),
    "rates": Study(rates, page=Path("docs/robot.md")),
}


@user_errors()
def main(arguments: list[str] | None = None) -> None:
    """Measure, print, and write the table if asked."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.robustness",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("study", choices=STUDIES)
    add_recordings(parser)
    parser.add_argument("--model", type=Path, help="a model folder (default: that of the page)")
    parser.add_argument("--people", type=count, help="lone people of each case (curves: 60, corridors: 10)")
    parser.add_argument("--seconds", type=positive, default=300.0, help="of each recording (%(default)s)")
    parser.add_argument(
        "--detections", type=positive, default=2.67, help="of recordings, at most, Hz (%(default)s)"
    )
    parser.add_argument(
        "--trust", action="store_true", help="learn how far to trust the network, as robots do"
    )
    parser.add_argument("--write", action="store_true", help="write the table into its page")
    options = parser.parse_args(arguments)
    check_options_of_page(parser, options, inputs=("study", "recording", "rate"))
    study = STUDIES[options.study]
    options.model = options.model or study.model
    rows = list(study.rows(options))
    show(options.study, rows)
    if options.write:
        write_tables(study.page, {options.study: rows})


if __name__ == "__main__":
    main()
