"""Errors beside the noise of detections: `python -m benchmarks.noise [FILE ...]`.

White noise is added to the detections of each recording; the truth stays. The network, whose tracker learns
the noise, stands beside constant velocity and a Kalman filter that was fitted to the same recording with
this noise: more than a robot can know. `--alone --no-map` leaves the network each person's own motion alone.
Without files: the places in data/scenes/real. The shipped network was trained on them; `--model` takes one
that was not.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from benchmarks import pages
from benchmarks.accuracy import ade_m
from benchmarks.timing import tell
from pedpred.command.evaluation import IsolatedTracks
from pedpred.errors import user_errors
from pedpred.features.perception import sensed
from pedpred.online.settings import OnlineSettings
from pedpred.scenes import OccupancyMap, Scene
from pedpred.simulation.sensor import SensorSettings
from pedpred.tracking import tune_kalman
from tools.arguments import positive
from tools.places import add_recordings, recordings

NOISES_M = (0.0, 0.02, 0.05, 0.1)
_FITTED_AHEAD_S = 3.2


def errors(scene: Scene, sensor: SensorSettings, model: Path | None, trust: bool) -> dict[str, float]:
    """ADE of the network with a tracker that learns or does not, and of simple methods, m."""
    seen = sensed(scene, sensor)
    age_s = 1.25 * seen.detection_dt_s
    fitted = tune_kalman(seen.trajectories, max(1, round(_FITTED_AHEAD_S / seen.detection_dt_s)))
    trackers = {
        "learns": OnlineSettings(age_s, learn_trust=trust),
        "fixed": OnlineSettings(age_s, learn_noise=False, learn_trust=trust),
        "fitted": OnlineSettings(age_s, tracker=fitted, learn_trust=trust),
    }
    scored = {name: ade_m(scene, model, settings, sensor) for name, settings in trackers.items()}
    best = min(scored["learns"]["cv"], scored["fitted"]["kalman_cv"])
    return {
        "cv": scored["learns"]["cv"],
        "kalman_cv, fitted": scored["fitted"]["kalman_cv"],
        "network": scored["learns"]["network"],
        "with a fixed tracker": scored["fixed"]["network"],
        "network / best": scored["learns"]["network"] / best,
    }


def by_place(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, str]]:
    """One row for each place: the network's error, and its share of the best simple method's, by noise."""
    table: dict[str, dict[str, str]] = {}
    for row in rows:
        cells = table.setdefault(row["place"], {"place": row["place"]})
        cells[f"{100 * row['noise, m']:g} cm"] = f"{row['network']:.3f} ({row['network / best']:.2f})"
    return list(table.values())


@user_errors()
def main() -> None:
    """Measure and print."""
    parser = pages.table_parser(__doc__)
    add_recordings(parser)
    parser.add_argument(
        "--detections", type=positive, default=2.67, help="per second at most, Hz (%(default)s)"
    )
    parser.add_argument("--seconds", type=positive, default=300.0, help="of each recording (%(default)s)")
    parser.add_argument("--alone", action="store_true", help="everybody alone")
    parser.add_argument("--no-map", action="store_true", help="without obstacles")
    pages.add_trust(parser)
    options = pages.table_options(parser, "benchmarks.noise")
    rows: list[dict[str, Any]] = []
    for scene in recordings(options.recording, options.rate):
        rows_then = scene.trajectories.time_s < scene.trajectories.time_s.min() + options.seconds
        scene = replace(scene, trajectories=scene.trajectories.select(rows_then))
        if options.alone:
            people = scene.trajectories
            scene = replace(scene, trajectories=IsolatedTracks.of(people).shifted(people))
        if options.no_map:
            scene = replace(scene, occupancy=OccupancyMap.free_around(scene.trajectories.position))
        faster = 1.0 / scene.detection_dt_s > options.detections
        for noise_m in NOISES_M:
            rate_hz = options.detections if faster else 0.0
            sensor = SensorSettings(rate_hz=rate_hz, position_noise_m=noise_m)
            measured = errors(scene, sensor, options.model, options.trust)
            rows.append({"place": scene.name, "noise, m": noise_m} | measured)
    tell("ADE, m", rows)
    if options.write:
        pages.put("alone" if options.alone else "noise", by_place(rows))


if __name__ == "__main__":
    main()
