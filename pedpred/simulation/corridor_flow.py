"""Validation with two opposite streams in a corridor: speed over density, and lane formation.

Density and speed are measured with PedPy (Schroedter et al. 2024) in the middle of the corridor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
import pandas as pd
import pedpy

from pedpred.errors import ValueRuleError
from pedpred.scenes import Scene, Trajectories
from pedpred.settings import (
    LARGEST_SEED,
    In,
    Range,
    Settings,
    positive,
)
from pedpred.simulation.ground import ground_of
from pedpred.simulation.layouts import Layout, draw_targets
from pedpred.simulation.settings import SocialForceSettings
from pedpred.simulation.shapes import Rectangle
from pedpred.simulation.simulator import simulate

_LARGEST_SIDE_M = 200.0


@dataclass(frozen=True)
class FlowSettings(Settings):
    """Experiment in a corridor with a target region at each end.

    Attributes:
        size_m: length and width of the corridor. [2]
        end_m: depth of the target regions at its ends.
        measured_m: section of the corridor that is measured, from and to. [2]
        people: number of people of each run.
        settle_s: time before the measurement.
        seconds: measured time.
        lane_m: people with a smaller lateral distance walk in one lane.
        seed: of the experiment.
    """

    size_m: tuple[float, float]
    end_m: float
    measured_m: Range
    people: Annotated[tuple[int, ...], In("[1, 10000]")]
    settle_s: Annotated[float, In("[0, 36000]")]
    seconds: Annotated[float, In("(0, 36000]")]
    lane_m: Annotated[float, In("(0, 100]")]
    seed: Annotated[int, In(f"[0, {LARGEST_SEED}]")]

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (positive("size_m", self.size_m, (2,)) <= _LARGEST_SIDE_M).all():
            raise ValueRuleError("size_m", self.size_m, f"a side may measure at most {_LARGEST_SIDE_M} m")
        In(f"(0, {self.size_m[0]}]").check("end_m", self.end_m, "a number")
        for end_m in self.measured_m:
            In(f"[0, {self.size_m[0]}]").check("measured_m", end_m, "two rising numbers")


def lane_order(lateral_m: np.ndarray, forward: np.ndarray, lane_m: float) -> float:
    """Mean of phi_n = ((N_same - N_opposite) / (N_same + N_opposite))^2. Rex & Loewen 2007.

    N counts the others with a lateral distance below `lane_m` from n, anywhere along the corridor; 1 means
    perfect lanes.

    Args:
        lateral_m: position across the corridor. [N]
        forward: direction of each person. [N] bool
        lane_m: half the width of a lane.

    Returns:
        The order; NaN if all lanes hold one person.
    """
    together = np.abs(lateral_m[:, None] - lateral_m) < lane_m
    np.fill_diagonal(together, False)
    count = together.sum(axis=1)
    balance = (together * np.where(forward[:, None] == forward, 1, -1)).sum(axis=1)
    if not count.any():
        return float("nan")
    return float(np.mean((balance[count > 0] / count[count > 0]) ** 2))


def corridor_flow(settings: FlowSettings, model: SocialForceSettings) -> tuple[list[dict], Scene]:
    """Run the experiment for every number of people.

    Returns:
        A row per run (people, density, speed, lane order, lane order with shuffled directions), and the
        run of at least `_CROWD` people whose lane order exceeds the shuffled one most.
    """
    rows, scenes = [], []
    for people in settings.people:
        scene = _walked(people, settings, model)
        rows.append({"people": people, **_measured(scene.trajectories, people, settings)})
        scenes.append(scene)
    gain = [row["lane_order"] - row["lane_order_shuffled"] for row in rows]
    crowded = np.array(settings.people) >= _CROWD
    clearest = int(np.argmax(np.where(crowded, np.nan_to_num(gain, nan=-1.0), -2.0)))
    return rows, scenes[clearest]


_CROWD = 40  # fewer people form lanes by chance, and make a poor picture


def _walked(people: int, settings: FlowSettings, model: SocialForceSettings) -> Scene:
    length, width = settings.size_m
    ends = [
        Rectangle((x, 0.5 * width), (settings.end_m, width))
        for x in (0.5 * settings.end_m, length - 0.5 * settings.end_m)
    ]
    layout = Layout((length, width), (), ends)
    crowd = replace(model.crowd, spacing_m=0.35, target_spacing_m=0.5, clearance_m=0.3)  # so that all fit
    model = replace(model, crowd=crowd, clock=replace(model.clock, warm_up_s=settings.settle_s))
    rng = np.random.default_rng([settings.seed, people])
    occupancy = layout.occupancy()
    targets = draw_targets(layout, ground_of(occupancy), crowd, rng)
    return simulate("corridor_flow", occupancy, targets, model, people, settings.seconds, rng)


def _measured(trajectories: Trajectories, people: int, settings: FlowSettings) -> dict[str, float]:
    low, high = settings.measured_m
    width = settings.size_m[1]
    instants = len(trajectories) // people
    table = pd.DataFrame(
        {
            "id": trajectories.track_id,
            "frame": np.repeat(np.arange(instants), people),
            "x": trajectories.position[:, 0],
            "y": trajectories.position[:, 1],
        }
    )
    rate = 1.0 / float(trajectories.time_s[people] - trajectories.time_s[0])
    walked = pedpy.TrajectoryData(data=table, frame_rate=rate)
    area = pedpy.MeasurementArea([(low, 0.0), (high, 0.0), (high, width), (low, width)])
    density = pedpy.compute_classic_density(traj_data=walked, measurement_area=area)["density"]
    speeds = pedpy.compute_individual_speed(
        traj_data=walked, frame_step=1, speed_calculation=pedpy.SpeedCalculation.BORDER_SINGLE_SIDED
    )
    inside = table.merge(speeds).query("@low <= x <= @high")
    return {
        "density_per_m2": float(density.mean()),
        "speed_mps": float(inside["speed"].mean()),
        **_lanes(trajectories, people, settings),
    }


def _lanes(trajectories: Trajectories, people: int, settings: FlowSettings) -> dict[str, float]:
    """Lane order in the measured part, averaged over time, and its value for shuffled directions."""
    assert trajectories.velocity is not None
    rng = np.random.default_rng([settings.seed, people, 1])
    orders: Sequence[list[float]] = ([], [])
    low, high = settings.measured_m
    for start in range(0, len(trajectories), people):
        rows = slice(start, start + people)
        x, y = trajectories.position[rows].T
        inside = (low <= x) & (x <= high)
        forward = trajectories.velocity[rows][inside, 0] > 0
        for scores, who in zip(orders, (forward, rng.permutation(forward)), strict=True):
            scores.append(lane_order(y[inside], who, settings.lane_m))
    real, chance = (float(np.nanmean(o)) if not np.isnan(o).all() else float("nan") for o in orders)
    return {"lane_order": real, "lane_order_shuffled": chance}
