"""Processor time of drives: `python -m benchmarks.driving_speed [SCENE] [--world KIND] [--episodes N]`.

A row per method: time to draw an episode and to drive it, and how long 1000 episodes take on two idle cores.
`--profile N` lists the N functions in which most of this time is spent.
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from benchmarks.driving import places_of
from benchmarks.timing import tell
from pedpred.driving.episodes import DriveSettings
from pedpred.driving.forecasters import HARD, NAMES
from pedpred.driving.runs import Models, Runner
from pedpred.driving.table import Condition
from pedpred.driving.worlds import KINDS
from pedpred.errors import user_errors
from pedpred.online.shipped import default_model
from tools.arguments import count, probability

_EPISODES, _CORES = 1000, 2
_PARTS = {
    "forecast, ms": ("forecasters.py", "predictor.py", "update"),
    "plan, ms": ("planner.py", "planner.py", "command"),
    "sensor, ms": ("sensor.py", "sensor.py", "visible"),
    "people, ms": ("walkers.py", "people.py", "advance"),
}
"""Column -> files and name of the function whose time it holds, for each cycle."""


def seconds(function: Callable[[], object]) -> float:
    """Processor time of a call, s."""
    begun_s = time.process_time()
    function()
    return time.process_time() - begun_s


def measured(runner: Runner, condition: Condition, episodes: int) -> tuple[dict[str, Any], pstats.Stats]:
    """A row about a method, and a profile of its drives."""
    drawn = [runner.places.draw(0, runner.settings)]
    runner.driven(*drawn[0], condition)  # compiles
    draw_s = seconds(
        lambda: drawn.extend(runner.places.draw(n, runner.settings) for n in range(1, episodes + 1))
    )
    done: list[Any] = []
    drive_s = seconds(lambda: done.extend(runner.driven(*one, condition) for one in drawn[1:]))
    cycles = sum(len(one.state) - 1 + drawn[1][1].watching for one in done)
    profile = cProfile.Profile(time.process_time)
    profile.enable()
    for one in drawn[1:]:
        runner.driven(*one, condition)
    profile.disable()
    stats = pstats.Stats(profile)
    row = {"method": condition.method, "draw, ms": 1e3 * draw_s / episodes}
    row |= {"drive, ms": 1e3 * drive_s / episodes, "cycle, ms": 1e3 * drive_s / cycles}
    for name, (first, second, function) in _PARTS.items():
        spent_s = max(
            (
                own[3]
                for (file, _, called), own in stats.stats.items()  # type: ignore[attr-defined]
                if called == function and Path(file).name in (first, second)
            ),
            default=0.0,
        )
        row[name] = 1e3 * spent_s / cycles
    minutes = (draw_s + drive_s) / episodes * _EPISODES / _CORES / 60
    return row | {f"{_EPISODES} episodes on {_CORES} cores, min": minutes}, stats


@user_errors()
def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.driving_speed",
        description=__doc__,
        formatter_class=argparse.RawTextHelpFormatter,
    )
    parser.add_argument("scene", type=Path, nargs="?")
    parser.add_argument("--world", choices=KINDS, default="corridor", help="in place of a scene")
    parser.add_argument("--episodes", type=count, default=10)
    parser.add_argument("--risk", type=probability, default=0.1)
    parser.add_argument("--method", choices=NAMES, action="append")
    parser.add_argument("--profile", type=count, default=0)
    given = parser.parse_args()
    places = places_of(given.scene, given.world, react=True)
    runner = Runner(places, DriveSettings(), Models(default_model()))
    rows, profiles = [], []
    for method in given.method or NAMES:
        condition = Condition(method, 0.0 if method in HARD else given.risk)
        row, stats = measured(runner, condition, given.episodes)
        rows.append(row)
        profiles.append(stats)
    tell(f"{places.name}, {given.episodes} episodes", rows)
    for stats in profiles if given.profile else ():
        stats.sort_stats("tottime").print_stats(given.profile)


if __name__ == "__main__":
    main()
