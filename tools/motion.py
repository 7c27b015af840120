"""How people turn, change speed, stop and start, real and simulated: `python -m tools.motion [FILE ...]`.

The ranges of conf/worlds were set so that worlds of the matching kinds show the distributions of real places.
Positions are averaged over 1.2 s and velocities taken over 0.8 s, so that neither noise nor sway counts.
Without files: the places in data/scenes/real. Then follow worlds of each kind, noise-free.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.ndimage import uniform_filter1d

from pedpred.config import read_params
from pedpred.errors import user_errors
from pedpred.scenes import Scene
from pedpred.simulation.worlds import DRAWN_KINDS, simulate_world
from pedpred.tracking.tracks import births
from stages.worlds import worlds_of
from tools.arguments import count
from tools.places import add_recordings, recordings

_STEP_S = 0.2
_AVERAGED, _ACROSS, _SECOND, _AHEAD = 6, 4, 5, 15  # of 0.2 s: means, velocities, one second, three seconds
_WALKS_MPS, _STANDS_MPS = 0.6, 0.2
_LONGEST_GAP_S = 1.0


def smooth_walks(scene: Scene) -> Iterator[np.ndarray]:
    """Averaged positions of each life every 0.2 s, m. [T, 2] each."""
    detections = scene.trajectories
    order = np.lexsort((detections.time_s, detections.track_id))
    track_id, time_s, position = (
        detections.track_id[order],
        detections.time_s[order],
        detections.position[order],
    )
    first = np.flatnonzero(births(track_id, time_s, position, _LONGEST_GAP_S))
    for life in np.split(np.arange(len(order)), first[1:]) if len(order) else ():
        now = np.arange(time_s[life[0]], time_s[life[-1]], _STEP_S)
        if len(now) > _AVERAGED + _ACROSS + _AHEAD:
            path = np.stack([np.interp(now, time_s[life], position[life, axis]) for axis in range(2)], axis=1)
            half = _AVERAGED // 2
            yield uniform_filter1d(path, _AVERAGED, axis=0)[half:-half]


def describe_motion(name: str, scenes: Iterable[Scene]) -> dict[str, object]:
    """Quantiles of turns and of changes of the speed, shares of stops and starts, and what slow people do."""
    parts: list[np.ndarray] = []
    for scene in scenes:
        for path in smooth_walks(scene):
            velocity = (path[_ACROSS:] - path[:-_ACROSS]) / (_ACROSS * _STEP_S)
            now = np.arange(0, len(velocity) - _AHEAD, _SECOND)
            speed, angle = np.hypot(*velocity.T), np.arctan2(velocity[:, 1], velocity[:, 0])
            parts.append(
                np.stack([
                    speed[now], speed[now + _SECOND], speed[now + _AHEAD],
                    np.abs(np.angle(np.exp(1j * (angle[now + _SECOND] - angle[now])))),
                    np.abs(np.angle(np.exp(1j * (angle[now + _AHEAD] - angle[now])))),
                ])
            )  # fmt: skip
    now, soon, later, turn_1s, turn_3s = np.concatenate([*parts, np.zeros((5, 0))], axis=1)
    walks, stands = now > _WALKS_MPS, now < _STANDS_MPS
    row: dict[str, object] = {"people of": name, "instants": len(now)}
    for title, turn, goes_on in (("1 s", turn_1s, soon), ("3 s", turn_3s, later)):
        row |= {
            f"turn in {title}, {share} %": _quantile(np.degrees(turn[walks & (goes_on > _WALKS_MPS)]), share)
            for share in (50, 90)
        }
    row |= {f"speed after 3 s, {share} %": _quantile(later[walks] / now[walks], share) for share in (5, 95)}
    row["stop in 3 s"] = _mean(later[walks] < _STANDS_MPS)
    row["start in 3 s"] = _mean(later[stands] > _WALKS_MPS)
    return row


def _quantile(values: np.ndarray, percent: int) -> float:
    return float(np.percentile(values, percent)) if len(values) else float("nan")


def _mean(values: np.ndarray) -> float:
    return float(values.mean()) if len(values) else float("nan")


@user_errors()
def main() -> None:
    """Print a row per recording and per kind of world."""
    parser = argparse.ArgumentParser(prog="python -m tools.motion", description=__doc__.partition("\n\n")[0])
    add_recordings(parser)
    parser.add_argument("--worlds", type=count, default=12, help="of each kind (default: %(default)s)")
    arguments = parser.parse_args()
    worlds, _ = worlds_of(read_params(Path()))
    rows = [describe_motion(scene.name, [scene]) for scene in recordings(arguments.recording, arguments.rate)]
    for kind in DRAWN_KINDS:
        rows.append(describe_motion(kind, (simulate_world(kind, n, worlds) for n in range(arguments.worlds))))
    print(pd.DataFrame(rows).to_string(index=False, float_format="{:.3g}".format))


if __name__ == "__main__":
    main()
