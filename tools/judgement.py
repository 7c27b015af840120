"""Measure one model folder; see `tools.judge`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml
from omegaconf import DictConfig

from pedpred.baselines.present_motion import STRONGEST
from pedpred.command.prediction import predictor_for
from pedpred.config import LOCK, plain, row
from pedpred.evaluation import EvaluationSettings, Scores, pool_scores, summarise_methods
from pedpred.features.perception import sensed
from pedpred.models.forecaster import ForecasterChoices
from pedpred.online.assessment import NETWORK, assess
from pedpred.online.network import read_origin
from pedpred.report.results import metrics_now
from pedpred.scenes import Scene
from pedpred.settings import load_each, load_together
from pedpred.simulation.sensor import SensorSettings
from pedpred.storage.scenes import read_scene, scene_folders
from stages.folds import trained_sets
from stages.row_types import PromiseRow
from tools.compare import metrics_at
from tools.programs import git
from tools.verdicts import (
    ROOMS,
    SENSED,
    TRUE_STATES,
    Verdict,
    at_most,
    latency_verdicts,
    law_verdicts,
    no_worse,
    place_verdicts,
    region_verdicts,
    room_verdicts,
)

REAL, SIMULATED = Path("data/scenes/real"), Path("data/scenes/simulated/sim_test")
REPORTED = Path("reports/metrics")
YARDSTICK = Path("models/online/simulation")
"""The paper's network, where it is exported."""
_ROBOT = "robot"  # the row of conf/sensors for simulated rooms


def scores_in(
    scene: Scene, folder: Path, sensor: SensorSettings, settings: EvaluationSettings
) -> dict[str, Scores]:
    """Scores of a model folder and of simple methods in a scene that a sensor looks at."""
    robot = predictor_for(sensed(scene, sensor), folder, detection_noise_m=sensor.position_noise_m)
    return assess(scene, robot, settings, sensor)


def _git(*arguments: str) -> str:
    """Output of a git command, empty if it fails."""
    return git(*arguments).stdout.decode().strip()


def exports(lock: str) -> dict[str, str]:
    """Checksums of the model folders that a run exported, by folder, from the text of its dvc.lock."""
    stages = (yaml.load(lock, yaml.CSafeLoader) or {}).get("stages", {})
    outputs = (stage["outs"] for name, stage in stages.items() if name.startswith("export@"))
    return {out["path"]: out["md5"] for outs in outputs for out in outs}


def metrics_of(folder: Path) -> dict[str, Any]:
    """Metric files about a model: the latest ones of a run that exported the same as the run that made it.

    So a model is judged by the evaluation of today as long as the pipeline still makes it; one that is not
    committed is judged by the present files.
    """
    path = folder.as_posix()
    made = _git("log", "-1", "--format=%H", "--", path)
    if not made or _git("status", "--porcelain", path):
        return metrics_now(REPORTED)
    exported = exports(_git("show", f"{made}:{LOCK}"))
    if exported and exported.items() <= exports(Path(LOCK).read_text()).items():
        return metrics_now(REPORTED)
    later = _git("log", "--format=%H", f"{made}..HEAD", "--", REPORTED.as_posix()).split()
    locks = ((commit, _git("show", f"{commit}:{LOCK}")) for commit in later)
    same = (commit for commit, lock in locks if exported and exported.items() <= exports(lock).items())
    return metrics_at(next(same, made), REPORTED)


class Judgement:
    """What one model folder is judged by.

    Attributes:
        folder: the model.
        params: of the project.
        origin: where the network comes from.
        settings: thresholds of the metrics.
        promises: by place.
    """

    def __init__(self, folder: Path, params: DictConfig):
        self.folder, self.params = folder, params
        self.origin = read_origin(folder)
        resampling = {key: params.comparison[key] for key in ("bootstrap", "seed")}
        kinds = EvaluationSettings, ForecasterChoices
        self.settings, _ = load_together(kinds, plain(params.evaluation) | resampling)
        self.promises = load_each(PromiseRow, plain(params.online.promises))

    def places(self) -> dict[str, Path]:
        """Name -> scene of each real place that is available."""
        folders = {name: REAL / name for name in self.params.places if (REAL / name).exists()}
        return {name: path for name, path in folders.items() if read_scene(path).unavailable is None}

    def training_places(self) -> set[str]:
        """Real places that trained the network."""
        weights = Path(self.origin["networks"])
        if weights.name.endswith("robot"):
            return set(self.params.places)
        if "fold" not in self.origin:
            return set()
        trained = trained_sets(self.params.folds.real[self.origin["fold"]], self.params.places)
        return {name.removeprefix("real/") for name in trained}

    def scores_at(self, folder: Path, place: str) -> dict[str, Scores]:
        """Scores of a model folder at a place, as its sensor detects people."""
        sensor = SensorSettings(**row(self.params, "sensors", self.params.places[place].sensor))
        return scores_in(read_scene(REAL / place), folder, sensor, self.settings)

    def rooms(self, folder: Path) -> dict[str, Scores]:
        """Scores of a model folder in the test rooms, as a robot detects people."""
        sensor = SensorSettings(**row(self.params, "sensors", _ROBOT))
        rooms = [read_scene(path) for path in scene_folders(SIMULATED)]
        parts = [scores_in(room, folder, sensor, self.settings) for room in rooms]
        return {method: pool_scores([part[method] for part in parts]) for method in parts[0]}

    def verdicts(self, against: Path | None) -> Iterator[Verdict]:
        """All promises, as they are measured."""
        yield from law_verdicts(self.folder)
        yield from latency_verdicts(self.folder)
        yield from self.reported_verdicts()
        for place in self.places():
            scores = self.scores_at(self.folder, place)
            unseen = place not in self.training_places()
            remark = "unseen" if unseen else "trained here"
            figures = summarise_methods(scores, STRONGEST, self.settings)
            yield from place_verdicts(place, figures, NETWORK, self.promises.get(place), remark)
            if unseen:  # regions are wide enough for places that did not train the network
                yield from region_verdicts(place, figures[NETWORK], remark)
            if against is not None:
                yield self.comparison(place, scores[NETWORK], self.scores_at(against, place)[NETWORK])
        if SIMULATED.exists():
            yield from self.sensed_room_verdicts(against)

    def sensed_room_verdicts(self, against: Path | None) -> Iterator[Verdict]:
        """Test rooms through sensor and tracker."""
        scores = self.rooms(self.folder)
        figures = summarise_methods(scores, STRONGEST, self.settings)
        name = "rooms, sensed"
        yield from room_verdicts(name, figures[NETWORK], ROOMS)
        yield from region_verdicts(name, figures[NETWORK])
        if YARDSTICK.exists():
            rival = self.rooms(YARDSTICK)[NETWORK].values["ade_m"].mean()
            share = figures[NETWORK]["ade_m"] / rival
            yield at_most(
                name, f"ADE / that of {YARDSTICK}", share, SENSED, f"{figures[NETWORK]['ade_m']:.3f} m"
            )
        if against is not None:
            yield self.comparison(name, scores[NETWORK], self.rooms(against)[NETWORK])

    def reported_verdicts(self) -> Iterator[Verdict]:
        """Unseen places and test rooms with true states, from the metric files of the run that made it."""
        metrics, method = metrics_of(self.folder), self.origin.get("method", "")
        for study in ("transfer", "real"):
            for place, figures in metrics.get(study, {}).items():
                about, remark = f"{place}, {study}", f"reports/metrics/{study}.json"
                if method in figures:
                    yield from place_verdicts(about, figures, method, self.promises.get(place), remark)
                    yield from region_verdicts(about, figures[method], remark)
                else:
                    yield Verdict(about, f"{method or 'network'} in {remark}", "absent", "there", False)
        rooms = metrics.get("sim", {}).get("sim_test", {}).get(method, {})
        yield from room_verdicts("rooms, true states", rooms, TRUE_STATES)

    def comparison(self, about: str, scores: Scores, other: Scores) -> Verdict:
        """Whether the error is no larger than another model's; see `tools.verdicts.no_worse`."""
        both = summarise_methods({"own": scores, "other": other}, "other", self.settings)
        interval = both["own"]["ade_m_minus_reference_ci95"]
        return no_worse(about, both["own"]["ade_m"], both["other"]["ade_m"], interval)
