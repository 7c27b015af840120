"""Many episodes, on several cores; each depends on the seed and its number only."""

from __future__ import annotations

import hashlib
import multiprocessing
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np

from pedpred.driving.episodes import DriveSettings, Place, draw_episode
from pedpred.driving.forecasters import HARD, forecaster_of
from pedpred.driving.loop import drive
from pedpred.driving.measures import measure
from pedpred.driving.table import Condition, Row
from pedpred.files import read_bytes
from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.scenes import Scene


def conditions(methods: Sequence[str], risks: Sequence[float]) -> list[Condition]:
    """Combine methods and limits of risk; forecasts without covariances get the limit 0 alone."""
    pairs = [Condition(m, r) for m in methods for r in ((0.0,) if m in HARD else risks)]
    return list(dict.fromkeys(pairs))


def checksum(scene: Scene, settings: DriveSettings, model: Path) -> str:
    """Identify everything that a row of the table depends on, besides its condition and episode."""
    people, ground = scene.trajectories, scene.occupancy
    found = hashlib.sha256(repr(replace(settings, planner=replace(settings.planner, risk=0.0))).encode())
    for values in (people.time_s, people.track_id, people.position, ground.occupied, ground.origin):
        found.update(np.ascontiguousarray(values).tobytes())
    found.update(repr((scene.name, ground.resolution_m)).encode())
    files = [*model.iterdir(), *Path(__file__).parent.glob("*.py")]
    for path in sorted(path for path in files if path.is_file()):
        found.update(read_bytes(path))
    return found.hexdigest()[:16]


class Runner:
    """Drives episodes at one place."""

    def __init__(self, scene: Scene, settings: DriveSettings, model: Path):
        """Prepare the place.

        Args:
            scene: whose people walk there.
            settings: of all drives; each condition replaces the limit of risk.
            model: folder of the network.
        """
        self.settings, self._sum = settings, checksum(scene, settings, model)
        self.place = Place.of(scene, settings.planner.dt_s)
        online = OnlineSettings(detection_noise_m=settings.sensor.noise_m)
        self.predictor = OnlinePredictor.load(model, online)

    def rows(self, number: int, wanted: Sequence[Condition]) -> tuple[list[Row], list[float]]:
        """Drive one episode under some conditions.

        Returns:
            A row of each; median time of a cycle of each, s.
        """
        own, place = self.settings, self.place
        episode = draw_episode(place, number, own.seed, own.robot, own.planner, own.episodes)
        rows, cycles = [], []
        for condition in wanted:
            settings = replace(own, planner=replace(own.planner, risk=condition.risk))
            forecaster = forecaster_of(condition.method, self.predictor, place.occupancy, episode.window)
            done = drive(episode, forecaster, place.occupancy, settings)
            found = measure(done, episode.route_m, own.robot, place.walls)
            rows.append(Row(place.name, own.robot.kind, condition, number, self._sum, found))
            cycles.append(float(np.median(done.cycle_s)))
        return rows, cycles


_runner: list[Runner] = []  # of a worker process


def _prepare(scene: Scene, settings: DriveSettings, model: Path) -> None:
    _runner[:] = [Runner(scene, settings, model)]


def _work(job: tuple[int, Sequence[Condition]]) -> tuple[list[Row], list[float]]:
    return _runner[0].rows(*job)


def run(
    scene: Scene,
    settings: DriveSettings,
    model: Path,
    wanted: Mapping[int, Sequence[Condition]],
    processes: int,
) -> Iterator[tuple[list[Row], list[float]]]:
    """Drive episodes and yield what `Runner.rows` returns, in their order, whatever the number of processes.

    Args:
        scene: whose people walk there.
        settings: of all drives.
        model: folder of the network.
        wanted: number of an episode -> conditions.
        processes: workers.
    """
    if processes == 1 or len(wanted) < 2:
        runner = Runner(scene, settings, model)
        yield from (runner.rows(*job) for job in wanted.items())
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(processes, context, _prepare, (scene, settings, model)) as workers:
        try:
            yield from workers.map(_work, wanted.items())
        finally:
            workers.shutdown(wait=True, cancel_futures=True)
