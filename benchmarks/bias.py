"""How far people go and how far they are forecast to go: `python -m benchmarks.bias [FILE ...]`.

Mean displacement along the heading after the whole horizon, m, by present speed, with and without the map,
of the truth, the network and constant velocity. A network that is right about starts and stops is right in
each row.
Without files: the places in data/scenes/real, on which the shipped network was trained.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from benchmarks import pages
from benchmarks.timing import tell
from pedpred.baselines.present_motion import PRESENT_MOTION
from pedpred.command.prediction import predictor_for
from pedpred.errors import user_errors
from pedpred.evaluation.scores import integrate_truth
from pedpred.evaluation.windows import ask_about_windows
from pedpred.features.perception import Perception
from pedpred.online import OnlinePredictor
from pedpred.online.assessment import forecasts_by_instants
from pedpred.online.predictor import NO_MAP
from pedpred.online.settings import OnlineSettings
from pedpred.scenes import Scene
from tools.places import add_recordings, recordings

SPEEDS_MPS = (0.0, 0.2, 0.5, 1.0, 10.0)
FEWEST = 30
"""Windows of a row that is printed."""


def ahead_m(scene: Scene, model: Path | None) -> dict[str, np.ndarray]:
    """Displacement of each window along the heading, m, and the present speed, m/s. [W] each."""
    age_s = predictor_for(scene, None).settings.max_age_s
    predictor = OnlinePredictor.load(model, OnlineSettings(age_s, learn_trust=False))
    about, sizes = predictor.description, predictor.protocol
    how = Perception(predictor.filters, about.standstill_mps)
    request = replace(ask_about_windows(scene, how, sizes, memory=False), tracker=None)
    asked = request.asked
    heading = np.stack([np.cos(asked.heading_rad), np.sin(asked.heading_rad)], axis=-1)
    network = np.empty((len(asked.time_s), 2))
    for which, forecast in forecasts_by_instants(predictor, request, scene):
        network[which] = forecast.mean[:, -1]
    ends = {"truth": integrate_truth(asked, sizes.dt_s)[:, -1], "network": network}
    ends["cv"] = PRESENT_MOTION["cv"]()(request).mean[:, -1]
    along = {name: ((end - asked.position) * heading).sum(axis=-1) for name, end in ends.items()}
    return along | {"speed": np.hypot(*asked.velocity.T)}


def rows_of(scene: Scene, model: Path | None) -> list[dict[str, object]]:
    """One row per range of speeds; the network without the map is nan where the map has no obstacles."""
    along, rows = ahead_m(scene, model), []
    blind = np.full_like(along["network"], np.nan)
    if scene.occupancy.occupied.any():
        blind = ahead_m(replace(scene, occupancy=NO_MAP), model)["network"]
    columns = {name: along[name] for name in ("truth", "network", "cv")} | {"network, no map": blind}
    for low, high in pairwise(SPEEDS_MPS):
        some = (along["speed"] >= low) & (along["speed"] < high)
        if some.sum() >= FEWEST:
            row = {"place": scene.name, "speed, m/s": f"{low:g} to {high:g}", "windows": int(some.sum())}
            rows.append(row | {name: float(values[some].mean()) for name, values in columns.items()})
    return rows


@user_errors()
def main() -> None:
    """Measure and print."""
    parser = pages.table_parser(__doc__)
    add_recordings(parser)
    options = pages.table_options(parser, "benchmarks.bias")
    rows = []
    for scene in recordings(options.recording, options.rate):
        rows += rows_of(scene, options.model)
    tell("displacement after 3 s, m", rows)
    if options.write:
        pages.put("bias", rows)


if __name__ == "__main__":
    main()
