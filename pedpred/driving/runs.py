"""Many episodes, on several cores; each depends on the seed and its number only."""

from __future__ import annotations

import hashlib
import multiprocessing
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import numpy as np

from pedpred.driving.episodes import DriveSettings, Episode, Place
from pedpred.driving.forecasters import HARD, forecaster_of
from pedpred.driving.loop import Drive, drive
from pedpred.driving.measures import measure
from pedpred.driving.table import Condition, Row
from pedpred.files import read_bytes
from pedpred.online import OnlinePredictor, OnlineSettings


def conditions(methods: Sequence[str], risks: Sequence[float]) -> list[Condition]:
    """Combine methods and limits of risk; forecasts without covariances get the limit 0 alone."""
    pairs = [Condition(m, r) for m in methods for r in ((0.0,) if m in HARD else risks)]
    return list(dict.fromkeys(pairs))


class Places(Protocol):
    """Where episodes take place: a `Recording` or `Worlds`."""

    @property
    def name(self) -> str:
        """For tables."""
        ...  # pragma: no cover

    def digest(self) -> bytes:
        """Bytes that identify it."""
        ...  # pragma: no cover

    def draw(self, number: int, settings: DriveSettings) -> tuple[Place, Episode]:
        """Draw an episode, and the place where it is, from (seed, number) alone."""
        ...  # pragma: no cover


def checksum(places: Places, settings: DriveSettings, model: Path) -> str:
    """Identify everything that a row of the table depends on, besides its condition and episode."""
    found = hashlib.sha256(repr(replace(settings, planner=replace(settings.planner, risk=0.0))).encode())
    found.update(places.digest())
    files = [*model.iterdir(), *Path(__file__).parent.glob("*.py")]
    for path in sorted(path for path in files if path.is_file()):
        found.update(read_bytes(path))
    return found.hexdigest()[:16]


class Runner:
    """Drives episodes."""

    def __init__(self, places: Places, settings: DriveSettings, model: Path):
        """Load the network.

        Args:
            places: where.
            settings: of all drives; each condition replaces the limit of risk.
            model: folder of the network.
        """
        self.settings, self.places = settings, places
        self._sum = checksum(places, settings, model)
        online = OnlineSettings(detection_noise_m=settings.sensor.noise_m)
        self.predictor = OnlinePredictor.load(model, online)

    def rows(self, number: int, wanted: Sequence[Condition]) -> tuple[list[Row], list[float]]:
        """Drive one episode under some conditions.

        Returns:
            A row of each; median time of a cycle of each, s.
        """
        place, episode = self.places.draw(number, self.settings)
        rows, cycles, own = [], [], self.settings
        for condition in wanted:
            done = self.driven(place, episode, condition)
            found = measure(done, episode.route_m, own.robot, place.walls)
            rows.append(Row(self.places.name, own.robot.kind, condition, number, self._sum, found))
            cycles.append(float(np.median(done.cycle_s)))
        return rows, cycles

    def driven(self, place: Place, episode: Episode, condition: Condition, keep: bool = False) -> Drive:
        """Drive one episode under one condition; `keep`: with its forecasts and detections."""
        settings = replace(self.settings, planner=replace(self.settings.planner, risk=condition.risk))
        crowd = episode.crowd()
        forecaster = forecaster_of(condition.method, self.predictor, place.occupancy, crowd)
        return drive(episode, crowd, forecaster, place.occupancy, settings, keep)


_runner: list[Runner] = []  # of a worker process


def _prepare(places: Places, settings: DriveSettings, model: Path) -> None:
    _runner[:] = [Runner(places, settings, model)]


def _work(job: tuple[int, Sequence[Condition]]) -> tuple[list[Row], list[float]]:
    return _runner[0].rows(*job)


def run(
    places: Places,
    settings: DriveSettings,
    model: Path,
    wanted: Mapping[int, Sequence[Condition]],
    processes: int,
) -> Iterator[tuple[list[Row], list[float]]]:
    """Drive episodes and yield what `Runner.rows` returns, in their order, whatever the number of processes.

    Args:
        places: where.
        settings: of all drives.
        model: folder of the network.
        wanted: number of an episode -> conditions.
        processes: workers.
    """
    if processes == 1 or len(wanted) < 2:
        runner = Runner(places, settings, model)
        yield from (runner.rows(*job) for job in wanted.items())
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(processes, context, _prepare, (places, settings, model)) as workers:
        try:
            yield from workers.map(_work, wanted.items())
        finally:
            workers.shutdown(wait=True, cancel_futures=True)
