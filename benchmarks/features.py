"""Speed of occupancy crop and angular grid, compared with plain numpy and the memory bound.

`python -m benchmarks.features [--json FILE]`. One thread. The pedestrians are in one room of 20 m x 20 m;
1000 of them (2.5 per m^2) are the worst case, with hundreds of others in range. The bound is the time of the
crop's look-ups at known addresses; the angular grid is not part of it.
"""

from __future__ import annotations

import argparse
from functools import partial

import numba
import numpy as np

from benchmarks.tables import keep, show
from benchmarks.timing import median_ms
from pedpred.errors import user_errors
from pedpred.features import Neighbours, Pedestrians, Surroundings
from pedpred.features.surroundings import Past
from pedpred.geometry import rotate
from pedpred.models.lstm.features import LstmFeatures
from pedpred.scenes import OccupancyMap
from tools.arguments import output
from tools.latency import room

CROWDS = (20, 200, 1000)
SIZES = LstmFeatures()


def crowd(count: int, rng: np.random.Generator) -> Pedestrians:
    """People at random positions with random headings."""
    heading, position = rng.uniform(-np.pi, np.pi, count), rng.uniform(0.0, 20.0, (count, 2))
    return Pedestrians(np.arange(count), position, heading, rng.normal(0.0, 1.0, (count, 2)))


def standing(frame: Pedestrians, occupancy: OccupancyMap) -> Surroundings:
    """People of one instant whose past is not known."""
    rows, none = len(frame), np.zeros(0)
    span, pairs = np.zeros((rows, 2), np.int64), np.zeros((rows, 2))
    past = Past(none, np.zeros((0, 2)), span, np.zeros(rows), frame.position, pairs, np.zeros((rows, 3)))
    return Surroundings(frame, past, np.zeros(rows), Neighbours.of_crowd(frame, rows), occupancy)


def both_grids(frame: Pedestrians, occupancy: OccupancyMap) -> dict[str, np.ndarray]:
    """Both inputs, as computed online."""
    return SIZES.compute(standing(frame, occupancy), dt_s=0.3)


def crop_only(frame: Pedestrians, occupancy: OccupancyMap) -> np.ndarray:
    """The occupancy crop alone, to compare with the bound."""
    return SIZES.obstacle_inputs(occupancy, frame.position, frame.heading_rad)["occupancy"]


def plain_numpy(frame: Pedestrians, occupancy: OccupancyMap) -> tuple[np.ndarray, np.ndarray]:
    """The same two grids in array expressions: [N, cells^2 / 8] uint8, [N, K] float32."""
    centre = (np.arange(SIZES.grid_cells) + 0.5 - SIZES.grid_cells / 2) * SIZES.grid_resolution_m
    cells = np.stack(np.meshgrid(centre, centre, indexing="ij"), axis=-1)
    points = rotate(cells[None], frame.heading_rad[:, None, None]) + frame.position[:, None, None]
    crops = np.packbits(occupancy.is_occupied(points).reshape(len(frame), -1), axis=1, bitorder="little")
    away = rotate(frame.position - frame.position[:, None], -frame.heading_rad[:, None])
    distance = np.hypot(away[..., 0], away[..., 1])
    np.fill_diagonal(distance, np.inf)
    angle = np.arctan2(away[..., 1], away[..., 0]) % (2 * np.pi)
    cone = np.minimum((angle * SIZES.angular_cells / (2 * np.pi)).astype(int), SIZES.angular_cells - 1)
    grids = np.full((len(frame), SIZES.angular_cells), SIZES.max_range_m)
    np.minimum.at(grids, (np.arange(len(frame))[:, None], cone), distance)
    return crops, grids.astype(np.float32)


@numba.njit
def gather(cells: np.ndarray, index: np.ndarray, found: np.ndarray) -> None:
    """Look-ups only."""
    for k in range(len(index)):
        found[k] = cells[index[k]]


def look_up_ns(occupancy: OccupancyMap, rng: np.random.Generator) -> float:
    """Time of one look-up at a known address in a map of that size, ns."""
    cells = occupancy.occupied.ravel().view(np.uint8)
    index = rng.integers(0, len(cells), SIZES.grid_cells**2 * 200).astype(np.int32)
    found = np.empty(len(index), np.uint8)
    return median_ms(lambda: gather(cells, index, found)) * 1e6 / len(index)


def latency(rng: np.random.Generator) -> list[dict]:
    """Milliseconds per frame, and for the look-ups alone."""
    occupancy = room(rng)
    look_up = look_up_ns(occupancy, rng)
    rows = []
    for count in CROWDS:
        frame = crowd(count, rng)
        seen, (crops, grids) = both_grids(frame, occupancy), plain_numpy(frame, occupancy)
        assert np.unpackbits(seen["occupancy"] ^ crops).mean() < 1e-4  # centres on edges, angles on edges
        assert np.isclose(seen["angular_grid"], grids, atol=1e-5).mean() > 0.9999
        ours, crop, plain = (
            median_ms(partial(work, frame, occupancy)) for work in (both_grids, crop_only, plain_numpy)
        )
        bound = count * SIZES.grid_cells**2 * look_up * 1e-6
        rows.append(
            {
                "pedestrians": count,
                "ours_ms": ours,
                "of_it_crop_ms": crop,
                "numpy_ms": plain,
                "numpy/ours": plain / ours,
                "look_ups": count * SIZES.grid_cells**2,
                "ns/look_up": look_up,
                "bound_ms": bound,
                "crop/bound": crop / bound,
            }
        )
    return rows


@user_errors()
def main() -> None:
    """Measure, print, and write the figures if `--json` is given."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.features", description=__doc__)
    parser.add_argument("--json", type=output, help="file for the figures")
    options = parser.parse_args()
    numba.set_num_threads(1)
    figures = {"latency": latency(np.random.default_rng(0))}
    show("Crop and angular grid of a frame, one thread", figures["latency"])
    keep(figures, options.json)


if __name__ == "__main__":
    main()
