"""All pictures of a page, with captions that say what is shown and by which rule it was chosen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from pedpred.errors import ValueRuleError
from pedpred.evaluation.forecasts import EvaluationWindows
from pedpred.models.lstm.autoencoder import GridAutoencoder
from pedpred.report.charts import box_plot
from pedpred.report.curves import training_figure
from pedpred.report.displacement import displacement_section
from pedpred.report.document import Picture, Pictures, Section, Text
from pedpred.report.error_plots import calibration_figure, horizon_figure, with_covariances
from pedpred.report.instants import Instant, before_obstacle, choose, is_moving, mutual_avoidance
from pedpred.report.measures import Result
from pedpred.report.methods import Methods
from pedpred.report.plan import arrangement_figure, contact_sheet
from pedpred.report.reconstructions import reconstructions_section
from pedpred.report.sections import calibration_section
from pedpred.report.situation import ARROW_S, reading_of_modes
from pedpred.report.snapshots import snapshot_figure
from pedpred.scenes import Scene

CROWD = {"simulated": 8, "real": 4}
"""Least number of moving people at an instant that is shown."""
SHOWN_S = {"simulated": 60.0, "real": float("inf")}
"""Length of the tracks in the pictures of places, s."""
SHEET_S, SHEET_COLUMNS, SHEET_ROWS = 30.0, 10, 4
"""Length of the tracks of rooms that share a picture, s, and how the rooms are arranged."""

_STILL = (
    "The background is one still of the video, so the people visible in it are others; positions are those "
    "of heads, as annotated."
)


_FINE_TUNING = (
    " Fine-tuning (step 0: before it) is validated on simulated worlds and on real places together. Its "
    "curve can rise: what a network learns about real people makes it less accurate in simulated worlds. "
    "A Mixture keeps its last weights, an LSTM those with the least validation error."
)


@dataclass(frozen=True)
class Evaluated:
    """What was measured in a study, and what it was measured on."""

    study: str
    kind: str  # of its test sets, "simulated" or "real"
    results: Sequence[Result]
    scenes: Mapping[str, Sequence[Scene]]  # by data set; those of trainings follow the test sets
    windows: Mapping[str, EvaluationWindows]  # by scene
    curves: Mapping[str, pd.DataFrame]  # of trainings, by name
    autoencoder: GridAutoencoder
    missing: Mapping[str, str] = field(default_factory=dict)  # sets without recording: how to get it

    @property
    def stand_ins(self) -> dict[str, str]:
        """Tested scenes of simulated people in place of recorded ones, and how they were made."""
        tested = [scene for result in self.results for scene in self.scenes.get(result.name, ())]
        return {scene.name: scene.stand_in for scene in tested if scene.stand_in is not None}

    def scene(self, name: str) -> Scene:
        """Find a scene by its name."""
        return next(scene for scenes in self.scenes.values() for scene in scenes if scene.name == name)


def draw_gallery(evaluated: Evaluated, methods: Methods) -> list[Section]:
    """Draw all pictures of the page on a study.

    Raises:
        ValueRuleError: forecasts of a scene that is in no test set.
    """
    results, windows, kind = evaluated.results, evaluated.windows, evaluated.kind
    if not results:
        return _training(evaluated.curves, methods)
    tested = {result.name: evaluated.scenes[result.name] for result in results}
    scenes = {scene.name: scene for rooms in tested.values() for scene in rooms}
    unknown = sorted(windows.keys() - scenes.keys())
    if unknown:
        raise ValueRuleError("forecasts of scene", unknown[0], f"only {sorted(scenes)} are known")
    forecast = {
        place: {scene.name: windows[scene.name] for scene in rooms if scene.name in windows}
        for place, rooms in tested.items()
    }
    endings = {place: f"_{place}" if len(results) > 1 else "" for place in tested}
    horizons = [_horizon(f"horizon{endings[result.name]}", result, methods) for result in results]
    others = {name: rooms for name, rooms in evaluated.scenes.items() if name not in tested}
    return [
        Section("Error over the horizon", [Pictures(horizons)], "horizon"),
        *calibration_section(results, methods, _calibration(windows, results, methods)),
        *displacement_section({place: list(own.values()) for place, own in forecast.items()}, methods),
        *_chosen_instants(forecast, endings, scenes, CROWD[kind], methods),
        *reconstructions_section(evaluated.autoencoder, windows),
        _places(scenes, SHOWN_S[kind]),
        *(_trained_in(others) if kind == "simulated" else []),
        *_training(evaluated.curves, methods),
    ]


def _chosen_instants(
    forecast: Mapping[str, Mapping[str, EvaluationWindows]],
    endings: Mapping[str, str],
    scenes: Mapping[str, Scene],
    crowd: int,
    methods: Methods,
) -> list[Section]:
    """Instants of each place, by place -> scene -> windows; those without a camera picture share theirs."""
    shared: dict[str, dict[str, EvaluationWindows]] = {}
    for place, windows in forecast.items():
        seen = any(scenes[name].camera for name in windows)
        shared.setdefault(endings[place] if seen else "", {}).update(windows)
    snapshots = [
        _snapshot(f"{ending}_{name}", scenes, windows, instant, methods)
        for ending, windows in shared.items()
        for name, instant in _instants(windows, scenes, crowd, methods).items()
    ]
    if not snapshots:
        return []
    everywhere = [scene for windows in forecast.values() for scene in windows.values()]
    legend = _legend(everywhere, methods) + f" {_STILL}" * any(scene.camera for scene in scenes.values())
    return [Section("Instants, chosen by rule", [Text(legend), Pictures(snapshots)])]


def _legend(windows: Sequence[EvaluationWindows], methods: Methods) -> str:
    return (
        "Circles: people, the one in focus is filled; arrows: displacement in "
        f"{ARROW_S} s at the present velocity; large dots: point forecast of the {methods.main.label}; "
        f"{reading_of_modes(windows, methods.main)}small dots: forecast of the "
        f"{methods.reference.label}; dashed: the true path; empty grey circles: people without an evaluation "
        "window. On the right, the inputs of the LSTM for the person in focus, heading up: obstacle grid, "
        "and angular grid, with an arc at the nearest person of each cone (pale: nobody up to there)."
    )


def _calibration(
    windows: Mapping[str, EvaluationWindows], results: Sequence[Result], methods: Methods
) -> list[Picture]:
    """Coverage over all test sets together; the tables list them one by one."""
    everywhere = list(windows.values())
    if not with_covariances(everywhere, methods):
        return []
    where = results[0].place if len(results) == 1 else f"{len(results)} places together"
    caption = f"Expected and observed coverage of regions, {where}."
    return [Picture("calibration", caption, calibration_figure(everywhere, where, methods))]


def _horizon(name: str, result: Result, methods: Methods) -> Picture:
    plot = box_plot(result.figures, result.title, result.dt_s, methods)
    return Picture(name, f"Position error, {result.place}.", horizon_figure(result, methods), plot)


def _instants(
    windows: Mapping[str, EvaluationWindows], scenes: Mapping[str, Scene], crowd: int, methods: Methods
) -> dict[str, Instant]:
    """What is shown of some scenes, by a name; an encounter that never happened is left out.

    Nothing where nobody moves, or where the methods that are drawn were not evaluated.
    """
    drawn = {methods.main.key, methods.reference.key}
    windows = {name: scene for name, scene in windows.items() if drawn <= scene.predictions.keys()}
    if not any(is_moving(scene).any() for scene in windows.values()):
        return {}
    chosen = {
        "gain": choose(windows, crowd, methods),
        "loss": choose(windows, crowd, methods, least=True),
        "avoidance": mutual_avoidance(windows, methods.reference),
        "obstacle": before_obstacle(windows, scenes, methods.reference),
    }
    return {name: instant for name, instant in chosen.items() if instant is not None}


def _snapshot(
    ending: str,
    scenes: Mapping[str, Scene],
    windows: Mapping[str, EvaluationWindows],
    instant: Instant,
    methods: Methods,
) -> Picture:
    scene, predicted = scenes[instant.scene], windows[instant.scene]
    kind = "snapshot" if scene.camera is None else "camera"
    return Picture(f"{kind}{ending}", instant.caption, snapshot_figure(scene, predicted, instant, methods))


def _places(scenes: Mapping[str, Scene], shown_s: float) -> Section:
    pictures = [Picture(f"tracks_{n}", n, arrangement_figure(s, shown_s)) for n, s in sorted(scenes.items())]
    rows = -(-len(pictures) // 5)
    tracks = "all tracks" if np.isinf(shown_s) else f"the tracks of the first {shown_s:.0f} s"
    return Section(
        f"Places: obstacles and {tracks} (colours only tell tracks apart)",
        [Pictures(pictures, -(-len(pictures) // rows))],
    )


def _trained_in(data_sets: Mapping[str, Sequence[Scene]]) -> list[Section]:
    """The rooms of every other simulated data set, on one sheet each."""
    pictures = []
    for name, scenes in data_sets.items():
        few, columns = scenes[: SHEET_COLUMNS * SHEET_ROWS], min(SHEET_COLUMNS, len(scenes))
        which = f": {few[0].name} to {few[-1].name}, row by row, of {len(scenes)}" if len(few) > 1 else ""
        caption = f"{name}{which}; tracks of the first {SHEET_S:.0f} s."
        pictures.append(Picture(f"rooms_{name}", caption, contact_sheet(few, SHEET_S, columns)))
    return [Section("Rooms that the networks were trained in", [Pictures(pictures)])] if pictures else []


def _training(curves: Mapping[str, pd.DataFrame], methods: Methods) -> list[Section]:
    if not curves:
        return []
    caption = (
        "Validation of every stage of training, with its last value, on tracks or worlds of the sets that a "
        "network was trained on: levels of networks that are trained on different sets do not compare."
    )
    if any(name.startswith("finetune") for name in curves):
        caption += _FINE_TUNING
    picture = Picture("training", caption, training_figure(curves, methods))
    return [Section("Training", [Pictures([picture])], "training")]
