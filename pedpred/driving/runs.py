"""Many episodes, on several cores; each depends on the seed and its number only."""

from __future__ import annotations

import hashlib
import multiprocessing
import re
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path

import numpy as np

from pedpred.driving.episodes import DriveSettings, Episode, Place
from pedpred.driving.forecasters import HARD, NAMES, forecaster_of
from pedpred.driving.intentions import published_forces
from pedpred.driving.loop import Drive, drive
from pedpred.driving.measures import measure
from pedpred.driving.places import Places
from pedpred.driving.table import NETWORK, Condition, Row
from pedpred.errors import ValueRuleError
from pedpred.files import read_bytes
from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.online.network import read_description


@dataclass(frozen=True)
class Models:
    """Folders of networks.

    Attributes:
        default: whose tracker and network the named methods use.
        others: networks that are compared with it, by their names in tables.
    """

    default: Path
    others: Mapping[str, Path] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in self.others:
            if name in NAMES or not re.fullmatch(NETWORK, name):
                rule = f"the name of another network has the letters a to z, 0 to 9, _, and is not {NAMES}"
                raise ValueRuleError("compare", name, rule)

    def of(self, method: str) -> Path:
        """Folder that a method depends on."""
        return self.others.get(method, self.default)

    def conditions(self, methods: Sequence[str], risks: Sequence[float]) -> list[Condition]:
        """Combine all methods and limits of risk; forecasts without covariances get the limit 0 alone."""
        outputs = {name: read_description(folder).outputs for name, folder in self.others.items()}
        certain = (*HARD, *(name for name, output in outputs.items() if "covariance" not in output))
        every = dict.fromkeys((*methods, *self.others))
        return [Condition(m, r) for m in every for r in ((0.0,) if m in certain else dict.fromkeys(risks))]


def checksum(places: Places, settings: DriveSettings, model: Path) -> str:
    """Identify everything that a row of the table depends on, besides its condition and episode.

    Code of other packages, such as the tracker's, is known by the version of the installation alone.
    """
    digest = hashlib.sha256(repr(replace(settings, planner=replace(settings.planner, risk=0.0))).encode())
    digest.update(import_module("pedpred").__version__.encode())  # the root is no layer to import from
    digest.update(places.digest())
    digest.update(repr(published_forces()).encode())
    files = [*sorted(model.iterdir()), *sorted(Path(__file__).parent.glob("*.py"))]
    for path in filter(Path.is_file, files):
        digest.update(read_bytes(path))
    return digest.hexdigest()[:16]


class Runner:
    """Drives episodes."""

    def __init__(self, places: Places, settings: DriveSettings, models: Models):
        """Load the networks.

        Args:
            places: where.
            settings: of all drives; each condition replaces the limit of risk.
            models: the networks.
        """
        self.settings, self.places, self._models = settings, places, models
        noise_m = settings.sensor.noise_m
        online = OnlineSettings(  # an episode is short
            detection_noise_m=noise_m, learn_trust=False, learn_local_errors=False
        )
        folders = {folder: None for folder in (models.default, *models.others.values())}
        self._sums = {folder: checksum(places, settings, folder) for folder in folders}
        self._predictors = {folder: OnlinePredictor.load(folder, online) for folder in folders}

    @property
    def predictor(self) -> OnlinePredictor:
        """Of the network that is not compared with."""
        return self._predictors[self._models.default]

    def rows(self, number: int, wanted: Sequence[Condition]) -> tuple[list[Row], list[float]]:
        """Drive one episode under some conditions.

        Returns:
            A row of each; median time of a cycle of each, s.
        """
        place, episode = self.places.draw(number, self.settings)
        rows, cycles, settings = [], [], self.settings
        for condition in wanted:
            done = self.driven(place, episode, condition)
            measures = measure(done, episode.route_m, settings.robot, place.walls)
            known = self._sums[self._models.of(condition.method)]
            rows.append(Row(self.places.name, settings.robot.kind, condition, number, known, measures))
            cycles.append(float(np.median(done.cycle_s)))
        return rows, cycles

    def driven(self, place: Place, episode: Episode, condition: Condition, keep: bool = False) -> Drive:
        """Drive one episode under one condition; `keep`: with its forecasts."""
        settings = replace(self.settings, planner=replace(self.settings.planner, risk=condition.risk))
        crowd = episode.crowd()
        predictor = self._predictors[self._models.of(condition.method)]
        forecaster = forecaster_of(condition.method, predictor, place.occupancy, crowd)
        return drive(episode, crowd, forecaster, place.occupancy, settings, keep)


_runner: list[Runner] = []  # of a worker process


def _prepare(places: Places, settings: DriveSettings, models: Models) -> None:
    _runner[:] = [Runner(places, settings, models)]


def _work(job: tuple[int, Sequence[Condition]]) -> tuple[list[Row], list[float]]:
    return _runner[0].rows(*job)


def run(
    places: Places,
    settings: DriveSettings,
    models: Models,
    wanted: Mapping[int, Sequence[Condition]],
    processes: int,
) -> Iterator[tuple[list[Row], list[float]]]:
    """Drive episodes and yield what `Runner.rows` returns, in their order, whatever the number of processes.

    Args:
        places: where.
        settings: of all drives.
        models: the networks.
        wanted: number of an episode -> conditions.
        processes: workers.
    """
    if processes == 1 or len(wanted) < 2:
        runner = Runner(places, settings, models)
        yield from (runner.rows(*job) for job in wanted.items())
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(processes, context, _prepare, (places, settings, models)) as workers:
        try:
            yield from workers.map(_work, wanted.items())
        finally:
            workers.shutdown(wait=True, cancel_futures=True)
