"""What a planner should read: `python -m benchmarks.driving (SCENE | --world KIND) [--variant NAME ...]`.

The same episodes are driven with changes of what the planner reads, over several limits of risk:

* `modes`, `kalman`: what `pedpred drive` calls so;
* `modes_shown`: the network is told where the robot is, as one more person;
* `modes_wide`: 0.15 m more deviation at every step;
* `modes_bounded`, `kalman_bounded`: covariances do not grow after 0.9 s, because the robot will have seen
  people again by then (Du Toit and Burdick 2012, partially closed-loop planning);
* `modes_and_kalman`: one more mode of weight 0.2, the Kalman filter's forecast with its covariance;
* `kalman_first`: the Kalman filter's forecast while a person is known for less than 0.8 s;
* `modes_hidden`: people whom somebody hides are kept for 2 s instead of 0.5 s.

Each variant is compared with `modes`, or its `kalman` one with `kalman`, at equal time to the goal. With
`--causes`, another table has a row for each collision at fault: for how long the person was known, and how
likely the robot's place at that moment seemed to overlap the person some time before it.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from benchmarks.driving_curves import PAGE
from benchmarks.driving_variants import VARIANTS, Trial, drive_episode
from benchmarks.pages import check_command, put
from benchmarks.timing import tell
from pedpred.command.recordings import open_scene
from pedpred.driving.episodes import Recording
from pedpred.driving.figures import Episodes, equal_time, share_interval
from pedpred.driving.runs import Places
from pedpred.driving.table import Row, write_table
from pedpred.driving.worlds import KINDS, REACTIONS, Worlds
from pedpred.errors import user_errors
from pedpred.online.shipped import default_model
from pedpred.workers import in_parallel
from tools.arguments import count, output, probability


def places_of(scene: Path | None, world: str, react: bool) -> Places:
    """A recorded scene; without one, simulated worlds whose people react to the robot or do not."""
    if scene is None:
        return Worlds(world, react)
    return Recording(open_scene(scene))


def compare(rows: Sequence[Row]) -> Iterator[dict[str, Any]]:
    """Each variant against the one that it changes, at equal time to the goal."""
    episodes = Episodes.of(rows)
    names = list(dict.fromkeys(condition.method for condition in episodes.conditions))
    for name in names:
        usual = VARIANTS[name].instead_of
        comparison = equal_time(episodes, name, usual) if usual in names else None
        if comparison is not None:
            middle, low, high = (100 * x for x in (comparison["at_fault"], *comparison["at_fault_ci95"]))
            yield {
                "variant": name,
                "minus": usual,
                "at, s": f"{comparison['time_s']:.1f}",
                "at fault, % (95 % interval)": f"{middle:+.1f} ({low:+.1f} to {high:+.1f})",
            }


def condition_rows(rows: Sequence[Row]) -> Iterator[dict[str, Any]]:
    """Shares and means of each variant and limit."""
    episodes = Episodes.of(rows)
    for condition in episodes.conditions:
        fault, value = episodes.at_fault(condition), {k: v[condition] for k, v in episodes.value.items()}
        low, high = share_interval(fault)
        yield {
            "variant": condition.method,
            "limit": condition.risk,
            "at fault, %": 100 * float(fault.mean()),
            "95 % interval": f"{100 * low:.1f} to {100 * high:.1f}",
            "collisions, %": 100 * float((value["contacts"] > 0).mean()),
            "reached, %": 100 * float(value["reached"].mean()),
            "time, s": float(value["time_s"].mean()),
        }


@user_errors()
def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.driving",
        description=__doc__,
        formatter_class=argparse.RawTextHelpFormatter,
    )
    parser.add_argument("scene", type=Path, nargs="?")
    parser.add_argument("--world", choices=KINDS)
    parser.add_argument("--people", choices=REACTIONS, default=REACTIONS[0])
    parser.add_argument("--model", type=Path, default=default_model())
    parser.add_argument("--episodes", type=count, default=60)
    parser.add_argument("--risk", type=probability, nargs="+", default=[0.1, 0.3, 0.6])
    parser.add_argument("--variant", choices=list(VARIANTS), action="append")
    parser.add_argument("--causes", action="store_true")
    parser.add_argument("--table", type=output, help="write the drives there, too")
    parser.add_argument("--write", action="store_true", help=f"write the comparison into {PAGE}")
    options = parser.parse_args()
    if (options.scene is None) == (options.world is None):
        parser.error("name a scene, or --world")
    variants = options.variant or list(VARIANTS)
    comparable = any(VARIANTS[name].instead_of in variants for name in variants) and len({*options.risk}) > 1
    if options.write and not comparable:
        parser.error("--write writes a comparison: name a variant, the one that it changes, and two limits")
    check_command(parser, options, "benchmarks.driving", PAGE, beside=("table", "causes"))
    places = places_of(options.scene, options.world, options.people == REACTIONS[0])
    trial = Trial(places, options.model, variants, options.risk, options.causes)
    jobs = [(trial, number) for number in range(options.episodes)]
    done = in_parallel(drive_episode, jobs, f"drive {places.name}", "episode")
    rows = [row for driven, _ in done for row in driven]
    if options.table:
        write_table(options.table, rows)
    tell(f"{places.name}, {options.episodes} episodes", list(condition_rows(rows)))
    if compared := list(compare(rows)):
        tell("at equal time to the goal", compared)
    if options.write:
        put("variants", compared, PAGE)
    if causes := [row for _, hits in done for row in hits]:
        tell("collisions at fault", causes)


if __name__ == "__main__":
    main()
