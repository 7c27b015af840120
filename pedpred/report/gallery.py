"""All pictures of a page, with captions that say what is shown and by which rule it was chosen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from pedpred.errors import ValueRuleError
from pedpred.evaluation.forecasts import EvaluationWindows
from pedpred.report.crops import reconstructions_section
from pedpred.report.displacement import displacement_section
from pedpred.report.document import Picture, Pictures, Section, Text
from pedpred.report.gather import Evaluated
from pedpred.report.instants import RULES, choose, is_moving
from pedpred.report.methods import Methods
from pedpred.report.plan import arrangement_figure, contact_sheet
from pedpred.report.plots import calibration_figure, horizon_figure, training_figure, with_covariances
from pedpred.report.results import Result
from pedpred.report.scene_picture import ARROW_S, reading_of_modes, snapshot_figure
from pedpred.report.sections import calibration_section
from pedpred.scenes import Scene

CROWD = {"simulated": 8, "real": 4}
"""Least number of moving people at an instant that is shown."""
SHOWN_S = {"simulated": 60.0, "real": float("inf")}
"""Length of the tracks in the pictures of places, s."""
SHEET_S, SHEET_COLUMNS, SHEET_ROWS = 30.0, 10, 4
"""Length of the tracks of rooms that share a picture, s, and how the rooms are arranged."""

Windows = Mapping[str, EvaluationWindows]
"""By scene."""

_STILL = (
    " The background is one still of the video, so the people visible in it are others; positions are those "
    "of heads, as annotated."
)
_VALIDATED = (
    "Validation of every stage of training, with its last value, on tracks or worlds of the sets that a "
    "network was trained on: levels of networks that are trained on different sets do not compare."
)
_FINE_TUNING = (
    " Fine-tuning (step 0: before it) is validated on simulated worlds and on real places together. Its "
    "curve can rise: what a network learns about real people makes it less accurate in simulated worlds. "
    "A Mixture keeps its last weights, an LSTM those with the least validation error."
)


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
    if unknown := sorted(windows.keys() - scenes.keys()):
        raise ValueRuleError("forecasts of scene", unknown[0], f"only {sorted(scenes)} are known")
    forecast = {
        place: {scene.name: windows[scene.name] for scene in rooms if scene.name in windows}
        for place, rooms in tested.items()
    }
    others = {name: rooms for name, rooms in evaluated.scenes.items() if name not in tested}
    horizons = [_horizon(result, len(results) > 1, methods) for result in results]
    return [
        Section("Error over the horizon", [Pictures(horizons)], "horizon"),
        *calibration_section(results, methods, _calibration(windows, results, methods)),
        *displacement_section({place: list(own.values()) for place, own in forecast.items()}, methods),
        *_instants(forecast, scenes, CROWD[kind], methods),
        *reconstructions_section(evaluated.autoencoder, windows),
        _places(scenes, SHOWN_S[kind]),
        *(_trained_in(others) if kind == "simulated" else []),
        *_training(evaluated.curves, methods),
    ]


def _horizon(result: Result, several: bool, methods: Methods) -> Picture:
    name, caption = f"horizon{_ending(result.name, several)}", f"Position error, {result.place}."
    return Picture(name, caption, horizon_figure(result, methods))


def _ending(place: str, several: bool) -> str:
    """Of a picture's name: the place, where there are several."""
    return f"_{place}" if several else ""


def _calibration(windows: Windows, results: Sequence[Result], methods: Methods) -> list[Picture]:
    """Coverage over all test sets together; the tables list them one by one."""
    everywhere = list(windows.values())
    if not with_covariances(everywhere, methods):
        return []
    where = results[0].place if len(results) == 1 else f"{len(results)} places together"
    caption = f"Expected and observed coverage of regions, {where}."
    return [Picture("calibration", caption, calibration_figure(everywhere, where, methods))]


def _instants(
    forecast: Mapping[str, Windows], scenes: Mapping[str, Scene], crowd: int, methods: Methods
) -> list[Section]:
    """Instants of each place, by place -> scene -> windows; those without a camera picture share theirs.

    There are none where nobody moves, or where the methods that are drawn were not evaluated.
    """
    shared: dict[str, dict[str, EvaluationWindows]] = {}
    for place, windows in forecast.items():
        seen = any(scenes[name].camera for name in windows)
        shared.setdefault(_ending(place, len(forecast) > 1) if seen else "", {}).update(windows)
    pictures, drawn = [], {methods.main.key, methods.reference.key}
    for ending, windows in shared.items():
        whole = {name: own for name, own in windows.items() if drawn <= own.predictions.keys()}
        if not any(is_moving(own).any() for own in whole.values()):
            continue
        for name, rule in RULES.items():
            if instant := choose(rule, whole, scenes, crowd, methods):
                scene = scenes[instant.scene]
                figure = snapshot_figure(scene, whole[instant.scene], instant, methods)
                kind = "camera" if scene.camera else "snapshot"
                pictures.append(Picture(f"{kind}{ending}_{name}", instant.caption, figure))
    if not pictures:
        return []
    legend = _legend([own for windows in forecast.values() for own in windows.values()], methods)
    legend += _STILL * any(scene.camera for scene in scenes.values())
    return [Section("Instants, chosen by rule", [Text(legend), Pictures(pictures)])]


def _legend(windows: Sequence[EvaluationWindows], methods: Methods) -> str:
    return (
        "Circles: people, the one in focus is filled; arrows: displacement in "
        f"{ARROW_S} s at the present velocity; large dots: point forecast of the {methods.main.label}; "
        f"{reading_of_modes(windows, methods.main)}small dots: forecast of the "
        f"{methods.reference.label}; dashed: the true path; empty grey circles: people without an evaluation "
        "window. On the right, the inputs of the LSTM for the person in focus, heading up: obstacle grid, "
        "and angular grid, with an arc at the nearest person of each cone (pale: nobody up to there)."
    )


def _places(scenes: Mapping[str, Scene], shown_s: float) -> Section:
    pictures = [Picture(f"tracks_{n}", n, arrangement_figure(s, shown_s)) for n, s in sorted(scenes.items())]
    rows = -(-len(pictures) // 5)
    tracks = "all tracks" if np.isinf(shown_s) else f"the tracks of the first {shown_s:.0f} s"
    title = f"Places: obstacles and {tracks} (colours only tell tracks apart)"
    return Section(title, [Pictures(pictures, -(-len(pictures) // rows))])


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
    caption = _VALIDATED + _FINE_TUNING * any(name.startswith("finetune") for name in curves)
    picture = Picture("training", caption, training_figure(curves, methods))
    return [Section("Training", [Pictures([picture])], "training")]
