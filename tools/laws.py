"""Laws of forecasts, such as symmetries, each measured as a number with a limit.

Worlds are drawn at random (`tools.law_worlds`). Tests check the laws for small networks, `tools.judge` for a
model folder.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from pedpred.scenes import Forecast
from tools.law_worlds import CROWD, RATES_HZ, Move, World, crowded, standing_people, straight_walkers

KNOWN = 3
"""Detections from which on laws of motion hold; before, hardly any motion is known."""
_FAR_M = 30.0
_PEOPLE = 16

STRAIGHT = (0.95, 1.05)
"""Forecast over true displacement of people who walk straight on free ground."""
STANDING_M = 0.15
"""Largest distance of the last step from the true position of people who stand, m."""


def straight_shares(
    folder: Path, rng: np.random.Generator, rate_hz: float, seconds: float = 30.0, people: int = _PEOPLE
) -> dict[str, np.ndarray]:
    """Forecast over true displacement of straight walkers at the last step, along their way.

    Returns:
        At each detection from the third one and from 1 s after birth on [F]: "share"; "age_s", since birth;
        and "speed_mps".
    """
    world, velocity = straight_walkers(rng, people, seconds, rate_hz)
    measured: dict[str, list[np.ndarray]] = {"share": [], "age_s": [], "speed_mps": []}
    for k, (who, detections, forecast) in enumerate(world.forecasts(folder)):
        age_s = (detections - 1) / rate_hz
        old = (detections >= KNOWN) & (age_s >= 1.0)
        true = velocity[who] * forecast.dt_s * forecast.predictions.steps
        walked = forecast.position[:, -1] - world.position[k, who]
        share = (walked * true).sum(axis=-1) / (true**2).sum(axis=-1)
        speed_mps = np.linalg.norm(velocity[who], axis=-1)
        for name, values in (("share", share), ("age_s", age_s), ("speed_mps", speed_mps)):
            measured[name].append(values[old])
    return {name: np.concatenate(values) for name, values in measured.items()}


def standing_errors_m(
    folder: Path, rng: np.random.Generator, rate_hz: float, noise_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """Distance of the last step from the true position of people who stand, m.

    Returns:
        Up to the third detection [F], and later [G].
    """
    world = standing_people(rng, _PEOPLE, noise_m, rate_hz)
    place = np.nanmean(world.position, axis=0)
    parts: list[list[np.ndarray]] = [[], []]
    for who, detections, forecast in world.forecasts(folder):
        error = np.linalg.norm(forecast.position[:, -1] - place[who], axis=-1)
        for part, rows in zip(parts, (detections <= KNOWN, detections > KNOWN), strict=True):
            part.append(error[rows])
    newborn, later = (np.concatenate(part) for part in parts)
    return newborn, later


def moved_gap_m(folder: Path, rng: np.random.Generator) -> float:
    """Change of forecasts when world and map are moved and turned by multiples of 90 degrees, m."""
    return _gap_m(folder, crowded(rng), _somewhere(rng, False))


def mirrored_gap_m(folder: Path, rng: np.random.Generator) -> float:
    """Difference between forecasts of a mirrored world and mirrored forecasts, m."""
    return _gap_m(folder, crowded(rng), _somewhere(rng, True))


def _somewhere(rng: np.random.Generator, mirrored: bool) -> Move:
    x, y = rng.uniform(-1e3, 1e3, 2)
    return Move(rng.integers(4) * np.pi / 2, (float(x), float(y)), mirrored)


def turned_gap_m(folder: Path, rng: np.random.Generator) -> float:
    """Change of forecasts on free ground when the world is turned by any angle, m."""
    world, _ = straight_walkers(rng, 6, 6.0, float(rng.choice(RATES_HZ)))
    return _gap_m(folder, world, Move(rng.uniform(-np.pi, np.pi)))


def renamed_gap_m(folder: Path, rng: np.random.Generator) -> float:
    """Change of forecasts when ids and the order of detections change, m."""
    world, order = crowded(rng), rng.permutation(CROWD)
    names = replace(world, track_id=rng.permutation(1000)[:CROWD])
    other = replace(names, position=names.position[:, order], track_id=names.track_id[order])
    largest_m = 0.0
    pairs = zip(world.forecasts(folder), other.forecasts(folder), strict=True)
    for (who, detections, one), (others, _, two) in pairs:
        place = np.argsort(order[others])[np.argsort(np.argsort(who))]
        same = replace(two, velocity=two.velocity[place], predictions=two.predictions.select(place))
        largest_m = max(largest_m, apart_m(one, same, detections >= KNOWN))
    return largest_m


def far_gap_m(folder: Path, rng: np.random.Generator) -> float:
    """Change of forecasts when a person 30 m away jumps and another one comes and goes, m."""
    world = crowded(rng)
    frames = len(world.time_s)
    beyond = np.abs(world.position).max() + _FAR_M  # jumps that end here do not cross the crowd
    far = beyond + rng.uniform(0.0, _FAR_M, (frames, 2, 2))
    far[:, 1] = far[0, 1]
    far[rng.random(frames) < 0.5, 1] = np.nan
    with_far = replace(
        world,
        position=np.concatenate([world.position, far], axis=1),
        track_id=np.append(world.track_id, [2000, 2001]),  # the largest
    )
    largest_m, near = 0.0, np.arange(CROWD)
    pairs = zip(world.forecasts(folder), with_far.forecasts(folder), strict=True)
    for (_, _, one), (_, _, two) in pairs:
        paths = two.predictions.select(near)
        moved = np.abs(one.predictions.path - paths.path).max(), np.abs(one.position - paths.point).max()
        largest_m = max(largest_m, *map(float, moved))
    return largest_m


def _gap_m(folder: Path, world: World, move: Move) -> float:
    """By how much forecasts of a world are not moved with it, from the third detection on, m."""
    largest_m = 0.0
    pairs = zip(world.forecasts(folder), world.moved(move).forecasts(folder), strict=True)
    for (_, detections, here), (_, _, there) in pairs:
        largest_m = max(largest_m, apart_m(here, move.forecast_back(there), detections >= KNOWN))
    return largest_m


def apart_m(one: Forecast, other: Forecast, counted: np.ndarray) -> float:
    """Largest distance between two forecasts of the same people at any step, m.

    Of the point forecasts, and of each mode to the closest one of the other forecast: modes that are equally
    likely may change places.

    Args:
        one: of N people.
        other: of the same people, in the same order and frame.
        counted: which of them count. [N] bool
    """
    if not counted.any():
        return 0.0
    point = np.linalg.norm(one.position - other.position, axis=-1).max(axis=-1)
    paths = one.predictions.path[:, :, None], other.predictions.path[:, None]
    modes = np.linalg.norm(paths[0] - paths[1], axis=-1).max(axis=-1)
    matched = np.maximum(modes.min(axis=2).max(axis=1), modes.min(axis=1).max(axis=1))
    return float(np.maximum(point, matched)[counted].max())


GAPS: Mapping[str, tuple[Callable[[Path, np.random.Generator], float], float]] = {
    "turned by quarters and moved": (moved_gap_m, 0.01),
    "turned by any angle": (turned_gap_m, 0.01),
    "other ids and order": (renamed_gap_m, 0.01),
    "people 30 m away": (far_gap_m, 0.001),
    "mirrored": (mirrored_gap_m, 0.05),
}
"""Change of the world -> its measured effect on forecasts, and the largest that is allowed, m."""
