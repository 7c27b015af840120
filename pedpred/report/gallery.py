"""All pictures of a page, with the captions that say what is seen and by which rule it was chosen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from pedpred.errors import ValueRuleError
from pedpred.networks.autoencoder import GridAutoencoder
from pedpred.report.calibration_plots import calibration_figure, told_by
from pedpred.report.curves import curves_figure
from pedpred.report.encounters import before_obstacle, mutual_avoidance
from pedpred.report.horizon import horizon_figure
from pedpred.report.instants import Instant, choose
from pedpred.report.measures import MethodMetrics
from pedpred.report.pages import POOLED, Picture, Section
from pedpred.report.plan import arrangement_figure, contact_sheet
from pedpred.report.reconstructions import (
    MEASURED,
    SHOWN,
    evenly_chosen,
    reconstructed,
    reconstructions_figure,
)
from pedpred.report.situation import ARROW_S, REGION
from pedpred.report.snapshots import camera_figure, inputs_figure
from pedpred.scenes import Scene
from pedpred.storage.windows import Windows

CROWD = {"sim": 8, "real": 4}
"""How many moving people an instant needs to be shown."""
SHOWN_S = {"sim": 60.0, "real": float("inf")}
"""How much of a recording the pictures of arrangements show, s."""
SHEET_S, SHEET_COLUMNS, SHEET_ROWS = 30.0, 10, 8
"""The same for rooms that share a picture, s; how many of them stand side by side, and in how many rows."""

_LEGEND = (
    "Circles: people, filled the one whom the picture is about; arrows: where the present velocity leads "
    f"in {ARROW_S} s; large dots: the LSTM's ten steps; ellipses: where it expects people with "
    f"{100 * REGION:.0f} % after half the horizon and at its end; small dots: Kalman CV; "
    "dashed: what they did; "
    "empty grey circles: people without an evaluation window."
)
_STILL = (
    "The background is one still of the video, so the people visible in it are others; positions are those "
    "of heads, as annotated."
)


def simulation_gallery(
    metrics: Mapping[str, MethodMetrics],
    data_sets: Mapping[str, Sequence[Scene]],
    windows: Mapping[str, Windows],
    curves: Mapping[str, pd.DataFrame],
    autoencoder: GridAutoencoder,
) -> list[Section]:
    """Pictures of the page on simulation; windows by the scene's name, training's data sets included."""
    scenes = _by_name(data_sets[POOLED])
    _check(windows, scenes)
    snapshots = [
        Picture(
            f"snapshot_{name}", found.caption, inputs_figure(scenes[found.scene], windows[found.scene], found)
        )
        for name, found in _instants(windows, scenes, CROWD["sim"]).items()
    ]
    horizon = _horizon("horizon", metrics[POOLED], "simulation, unseen arrangements")
    return [
        Section("Error over the horizon", [horizon]),
        *_calibration({"calibration": (list(windows.values()), "simulation, unseen arrangements")}),
        Section("Instants, chosen by rule", snapshots, text=_LEGEND),
        *_reconstructions(autoencoder, windows),
        _arrangements(scenes, f"and the tracks of the first {SHOWN_S['sim']:.0f} s", SHOWN_S["sim"]),
        *_trained_in({name: rooms for name, rooms in data_sets.items() if name != POOLED}),
        *_training(curves),
    ]


def real_gallery(
    metrics: Mapping[str, MethodMetrics],
    data_sets: Mapping[str, Sequence[Scene]],
    windows: Mapping[str, Windows],
    curves: Mapping[str, pd.DataFrame],
    autoencoder: GridAutoencoder,
) -> list[Section]:
    """Pictures of the page on real people; windows by the scene's name."""
    scenes = _by_name([scene for data_set in data_sets.values() for scene in data_set])
    _check(windows, scenes)
    _check(windows, metrics)
    horizons = [_horizon(f"horizon_{name}", metrics[name], f"tested at {name}") for name in windows]
    snapshots = [
        Picture(f"camera_{scene}_{name}", found.caption, seen(scenes[scene], own, found))
        for scene, own in windows.items()
        for seen in [inputs_figure if scenes[scene].camera is None else camera_figure]
        for name, found in _instants({scene: own}, scenes, CROWD["real"]).items()
    ]
    return [
        Section("Error over the horizon", horizons),
        *_calibration({f"calibration_{n}": ([own], f"tested at {n}") for n, own in windows.items()}),
        Section("Instants, chosen by rule", snapshots, text=f"{_LEGEND} {_STILL}"),
        *_reconstructions(autoencoder, windows),
        _arrangements(scenes, "and all tracks", SHOWN_S["real"]),
        *_training(curves),
    ]


def _instants(windows: Mapping[str, Windows], scenes: Mapping[str, Scene], crowd: int) -> dict[str, Instant]:
    """What is shown of some scenes, by a name; an encounter that never happened is left out."""
    found = {
        "gain": choose(windows, crowd),
        "loss": choose(windows, crowd, least=True),
        "avoidance": mutual_avoidance(windows),
        "obstacle": before_obstacle(windows, scenes),
    }
    return {name: instant for name, instant in found.items() if instant is not None}


def _check(windows: Mapping[str, Windows], known: Mapping[str, object]) -> None:
    """Every file of forecasts must be about a scene that is known otherwise too."""
    strangers = sorted(windows.keys() - known.keys())
    if strangers:
        raise ValueRuleError("forecasts of scene", strangers[0], f"only {sorted(known)} are known")


def _horizon(name: str, methods: MethodMetrics, title: str) -> Picture:
    caption = f"Position error, {title}."
    return Picture(name, caption, horizon_figure(methods, title))


def _calibration(pools: Mapping[str, tuple[Sequence[Windows], str]]) -> list[Section]:
    """Expected and observed coverage of pooled scenes; nothing where no method tells covariances."""
    pictures = [
        Picture(name, f"What error ellipses should and do hold, {title}.", calibration_figure(own, title))
        for name, (own, title) in pools.items()
        if told_by(own)
    ]
    return [Section("Error ellipses over what they promise", pictures)] if pictures else []


def _reconstructions(autoencoder: GridAutoencoder, windows: Mapping[str, Windows]) -> list[Section]:
    """Obstacle grids of places unknown to the auto-encoder; nothing where nobody sees an obstacle."""
    crops = evenly_chosen(windows, MEASURED)
    if not len(crops):
        return []
    found = reconstructed(autoencoder, crops)
    few = found.few(SHOWN)
    caption = (
        f"Obstacle grids of test places, {len(few.truth)} at evenly spaced ranks of occupied share, and what "
        "the auto-encoder makes of them. Intersection over union of occupied cells: median "
        f"{np.median(found.agreement):.2f} over {len(crops)} grids chosen likewise."
    )
    picture = Picture("reconstructions", caption, reconstructions_figure(few))
    return [Section("What the auto-encoder keeps", [picture])]


def _by_name(scenes: Sequence[Scene]) -> dict[str, Scene]:
    return {scene.name: scene for scene in scenes}


def _arrangements(scenes: Mapping[str, Scene], what: str, shown_s: float) -> Section:
    pictures = [Picture(f"tracks_{n}", n, arrangement_figure(s, shown_s)) for n, s in sorted(scenes.items())]
    rows = -(-len(pictures) // 5)
    return Section(f"Places: obstacles {what}", pictures, columns=-(-len(pictures) // rows))


def _trained_in(data_sets: Mapping[str, Sequence[Scene]]) -> list[Section]:
    """The rooms of every other simulated data set, on one sheet each."""
    pictures = []
    for name, scenes in data_sets.items():
        few, columns = scenes[: SHEET_COLUMNS * SHEET_ROWS], min(SHEET_COLUMNS, len(scenes))
        which = f"{few[0].name} to {few[-1].name}, row by row" if len(few) > 1 else few[0].name
        caption = f"{name}: {which}, of {len(scenes)}; tracks of the first {SHEET_S:.0f} s."
        pictures.append(Picture(f"rooms_{name}", caption, contact_sheet(few, SHEET_S, columns)))
    return [Section("Rooms that the networks were trained in", pictures)] if pictures else []


def _training(curves: Mapping[str, pd.DataFrame]) -> list[Section]:
    if not curves:
        return []
    picture = Picture("training", "A column per stage of training.", curves_figure(curves))
    return [Section("Training", [picture])]
