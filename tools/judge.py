"""Judge a model folder: `python -m tools.judge [FOLDER] [--against FOLDER|REVISION] [--out FILE]`.

Prints a table of promises with the figures behind them; exit code 1 when one is broken. Measured here: every
real place in data/scenes/real, as its sensor detects it and the folder's tracker follows it; the simulated
test rooms through a robot's sensor; the laws; the time of an update. A place that trained the network says
so; the promises about unseen places are judged by the metric files of the folds. `--against` fails when the
folder is worse than another one, or than a revision's, beyond the interval of the paired difference.
"""

from __future__ import annotations

import os

if __name__ == "__main__":  # before numpy is loaded: latencies are those of one thread
    os.environ.update(
        OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1", NUMBA_NUM_THREADS="1"
    )

import argparse
import logging
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from pedpred.baselines.present_motion import STRONGEST
from pedpred.command.prediction import robot_for
from pedpred.config import plain, read_params, row
from pedpred.errors import PedpredError
from pedpred.evaluation import EvaluationSettings, Scores, pooled, summaries
from pedpred.features.perception import sensed
from pedpred.files import atomic_write, write_json
from pedpred.online.assessment import NETWORK, assess
from pedpred.online.network import ABOUT, GRAPH, read_origin
from pedpred.report.comparison import metrics_now
from pedpred.scenes import Scene
from pedpred.simulation.fields import parsed
from pedpred.simulation.sensor import SensorSettings
from pedpred.storage.scenes import read_scene, scene_folders
from tools.verdicts import (
    ROOMS,
    SENSED,
    TRUE_STATES,
    Promise,
    Verdict,
    below,
    latency_verdicts,
    law_verdicts,
    place_verdicts,
    region_verdicts,
    room_verdicts,
)

REAL, SIMULATED = Path("data/scenes/real"), Path("data/scenes/simulated/sim_test")
YARDSTICK = Path("models/online/simulation")
"""The paper's network, where it is exported."""
_ROBOT = "robot"  # the row of conf/sensors for simulated rooms
_TITLES = ("", "about", "what", "found", "limit", "remark")
_WIDTHS = (4, 18, 44, 30, 24, 0)


def scores_in(
    scene: Scene, folder: Path, sensor: SensorSettings, settings: EvaluationSettings
) -> dict[str, Scores]:
    """Scores of a model folder and of simple methods in a scene that a sensor looks at."""
    return assess(scene, robot_for(sensed(scene, sensor), folder), settings, sensor)


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
        self.settings = parsed(EvaluationSettings, plain(params.evaluation))
        self.promises = {place: Promise(**own) for place, own in plain(params.online.promises).items()}

    def places(self) -> dict[str, Path]:
        """Name -> scene of each real place that is available."""
        folders = {name: REAL / name for name in self.params.places if (REAL / name).exists()}
        return {name: path for name, path in folders.items() if read_scene(path).unavailable is None}

    def trained_on(self) -> set[str]:
        """Real places that trained the network."""
        weights = Path(self.origin["networks"])
        if weights.name == "robot":
            return set(self.params.places)
        if weights.parent.name != "folds":
            return set()
        return {name.removeprefix("real/") for name in self.params.folds.real[weights.name].train}

    def scores_at(self, folder: Path, place: str) -> dict[str, Scores]:
        """Scores of a model folder at a place, as its sensor detects people."""
        sensor = SensorSettings(**row(self.params, "sensors", self.params.places[place].sensor))
        return scores_in(read_scene(REAL / place), folder, sensor, self.settings)

    def rooms(self, folder: Path) -> dict[str, Scores]:
        """Scores of a model folder in the test rooms, as a robot detects people."""
        sensor = SensorSettings(**row(self.params, "sensors", _ROBOT))
        rooms = [read_scene(path) for path in scene_folders(SIMULATED)]
        parts = [scores_in(room, folder, sensor, self.settings) for room in rooms]
        return {method: pooled([part[method] for part in parts]) for method in parts[0]}

    def verdicts(self, against: Path | None) -> Iterator[Verdict]:
        """All promises, as they are measured."""
        yield from law_verdicts(self.folder)
        yield from latency_verdicts(self.folder)
        yield from self.reported()
        for place in self.places():
            scores = self.scores_at(self.folder, place)
            unseen = place not in self.trained_on()
            remark = "unseen" if unseen else "trained here"
            figures = summaries(scores, STRONGEST, self.settings)
            yield from place_verdicts(place, figures, NETWORK, self.promises.get(place), remark)
            if unseen:  # regions are wide enough for places that did not train the network
                yield from region_verdicts(place, figures[NETWORK], remark)
            if against is not None:
                yield self.no_worse(place, scores[NETWORK], self.scores_at(against, place)[NETWORK])
        if SIMULATED.exists():
            yield from self.sensed_rooms(against)

    def sensed_rooms(self, against: Path | None) -> Iterator[Verdict]:
        """Test rooms through sensor and tracker."""
        scores = self.rooms(self.folder)
        figures = summaries(scores, STRONGEST, self.settings)
        name = "rooms, sensed"
        yield from room_verdicts(name, figures[NETWORK], ROOMS)
        yield from region_verdicts(name, figures[NETWORK])
        if YARDSTICK.exists():
            rival = self.rooms(YARDSTICK)[NETWORK].values["ade_m"].mean()
            share = figures[NETWORK]["ade_m"] / rival
            yield below(
                name, f"ADE / that of {YARDSTICK}", share, SENSED, f"{figures[NETWORK]['ade_m']:.3f} m"
            )
        if against is not None:
            yield self.no_worse(name, scores[NETWORK], self.rooms(against)[NETWORK])

    def reported(self) -> Iterator[Verdict]:
        """Unseen places and test rooms with true states, from the metric files of the pipeline."""
        metrics, method = metrics_now(Path("reports/metrics")), self.origin.get("method", "")
        for study in ("transfer", "real"):
            for place, figures in metrics.get(study, {}).items():
                remark = f"reports/metrics/{study}.json"
                if method in figures:
                    yield from place_verdicts(place, figures, method, self.promises.get(place), remark)
                    yield from region_verdicts(place, figures[method], remark)
                else:
                    yield Verdict(place, f"{method or 'network'} in {remark}", "absent", "there", False)
        rooms = metrics.get("sim", {}).get("sim_test", {}).get(method, {})
        yield from room_verdicts("rooms, true states", rooms, TRUE_STATES)

    def no_worse(self, about: str, own: Scores, other: Scores) -> Verdict:
        """Whether the error is above another model's beyond the interval of the paired difference."""
        both = summaries({"own": own, "other": other}, "other", self.settings)
        low, high = both["own"]["ade_m_minus_reference_ci95"]
        found = f"{both['own']['ade_m']:.3f} for {both['other']['ade_m']:.3f}, {low:+.3f} ... {high:+.3f}"
        return Verdict(about, "ADE against the other model, m", found, "interval not above 0", bool(low <= 0))


def folder_at(given: str, folder: Path, scratch: Path) -> Path | None:
    """A model folder: the one that is named, or the judged one in a revision; None if it has none."""
    if Path(given).exists():
        return Path(given)
    for name in (GRAPH, ABOUT):
        command = ["git", "show", "--end-of-options", f"{given}:{(folder / name).as_posix()}"]
        done = subprocess.run(command, capture_output=True, check=False)  # noqa: S603, a list, no shell
        if done.returncode:
            sys.stdout.write(f"{given} has no {folder / name}, so nothing is compared\n")
            return None
        with atomic_write(scratch / folder / name) as new:
            new.write_bytes(done.stdout)
    return scratch / folder


def line(verdict: Verdict) -> str:
    """A verdict as a row of the table."""
    kept = "pass" if verdict.holds else "FAIL"
    return _row(kept, verdict.about, verdict.what, verdict.found, verdict.limit, verdict.remark)


def _row(*cells: str) -> str:
    return "  ".join(c.ljust(w) for c, w in zip(cells, _WIDTHS, strict=True)).rstrip() + "\n"


def summary(verdicts: list[Verdict]) -> str:
    """How many promises hold, and the broken ones."""
    broken = [line(verdict) for verdict in verdicts if not verdict.holds]
    return f"\n{len(verdicts) - len(broken)} of {len(verdicts)} promises hold\n{''.join(broken)}"


def main(arguments: list[str] | None = None) -> None:
    """Measure, print, and fail when a promise is broken."""
    parser = argparse.ArgumentParser(prog="python -m tools.judge", description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", default=Path("models/online/default"))
    parser.add_argument("--against", help="a model folder, or a git revision that has FOLDER")
    parser.add_argument("--out", type=Path, help="write the verdicts there, JSON")
    given = parser.parse_args(arguments)
    try:
        judgement = Judgement(given.folder, read_params(Path()))
        with tempfile.TemporaryDirectory() as scratch:
            against = folder_at(given.against, given.folder, Path(scratch)) if given.against else None
            sys.stdout.write(_row(*_TITLES))
            verdicts = []
            for verdict in judgement.verdicts(against):
                verdicts.append(verdict)
                sys.stdout.write(line(verdict))
                sys.stdout.flush()
    except PedpredError as error:
        raise SystemExit(f"{type(error).__name__}: {error}") from error
    sys.stdout.write(summary(verdicts))
    if given.out is not None:
        found: dict[str, Any] = {"folder": given.folder.as_posix(), "verdicts": [asdict(v) for v in verdicts]}
        write_json(given.out, found)
    sys.exit(int(not all(verdict.holds for verdict in verdicts)))


if __name__ == "__main__":
    logging.disable(logging.WARNING)
    main()
