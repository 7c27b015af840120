"""The answer type of all forecasters, its files, and the probability that somebody covers a cell."""

import dataclasses

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pedpred.evaluation.forecasts import read_windows, write_windows
from pedpred.scenes import OccupancyMap, Predictions, predicted_occupancy
from tests.forecasts import drawn_predictions, windows_with
from tests.refused import refused, unread


def test_weights_fall_and_sum_to_one():
    for weight in ([0.4, 0.6], [0.6, 0.6], [1.1, -0.1]):
        with refused("weight"):
            Predictions(np.zeros((1, 3, 2)), np.zeros((1, 2, 3, 2)), np.array([weight]), 0.3)


def test_shapes_that_do_not_belong_together_are_refused():
    given_ = drawn_predictions(np.random.default_rng(0))
    for name in ("path", "weight", "covariance"):
        with refused(name):
            dataclasses.replace(given_, **{name: getattr(given_, name)[1:]})


def test_a_single_mode_is_the_point_forecast():
    point = np.random.default_rng(0).normal(size=(4, 3, 2))
    single = Predictions.single(point, 0.3)
    assert (single.modes, single.steps, len(single)) == (1, 3, 4)
    for same in (single.most_likely, single.mean, single.sample(1, np.random.default_rng(0))[:, 0]):
        np.testing.assert_array_equal(same, point)


def test_samples_have_the_moments_of_the_mixture():
    given_ = drawn_predictions(np.random.default_rng(1), rows=2, steps=2)
    drawn = given_.sample(200_000, np.random.default_rng(2))
    weight = given_.weight[:, :, None, None]
    np.testing.assert_allclose(drawn.mean(axis=1), given_.mean, atol=0.03)
    apart = given_.path - given_.mean[:, None]
    spread = apart[..., :, None] * apart[..., None, :] + given_.covariance
    expected = (weight[..., None] * spread).sum(axis=1)
    apart = drawn - given_.mean[:, None]
    found = (apart[..., :, None] * apart[..., None, :]).mean(axis=1)
    np.testing.assert_allclose(found, expected, atol=0.03 * np.abs(expected).max())


@pytest.mark.parametrize("damage", ["a wrong interval", "no heading"])
def test_a_damaged_file_of_forecasts_is_named(damage, tmp_path):
    path = tmp_path / "hall.parquet"
    write_windows(windows_with(np.zeros((5, 2)), np.zeros((5, 4, 2)), {"cv": np.zeros((5, 4, 2))}), path)
    table = pq.read_table(path)
    if damage == "no heading":
        table = table.drop_columns(["heading_rad"])
    else:
        about = table.schema.metadata.items()
        table = table.replace_schema_metadata({k: v.replace(b'_s": 0.3', b'_s": -0.3') for k, v in about})
    pq.write_table(table, path)
    with unread(path):
        read_windows(path)


# Predicted occupancy

GRID = OccupancyMap(np.zeros((80, 60)), [-4.0, -3.0], 0.1)
BODY_M = 0.3
seeds = st.integers(0, 2**32 - 1)


def people(seed, count=1, modes=3, steps=4, reach_m=1.5):
    """Any few people near the origin."""
    rng = np.random.default_rng(seed)
    path = rng.uniform(-reach_m, reach_m, (count, modes, steps, 2))
    root = rng.normal(0, 0.15, (count, modes, steps, 2, 2))
    weight = np.sort(rng.dirichlet(np.ones(modes), count))[:, ::-1]
    return Predictions(path[:, 0], path, weight, 0.3, root @ root.swapaxes(-1, -2) + 0.01 * np.eye(2))


def drawn(predictions, count=4000):
    """The same probability from samples."""
    paths = predictions.sample(count, np.random.default_rng(0)).swapaxes(1, 2)
    centre = GRID.center_of(np.argwhere(~GRID.occupied)[::97])
    away = np.linalg.norm(paths[:, :, :, None] - centre, axis=-1) <= BODY_M
    return 1 - (1 - away.mean(axis=2)).prod(axis=0)


@given(seeds)
@settings(max_examples=4)
def test_it_is_the_share_of_samples_that_cover_a_cell(seed):
    """So people are independent of each other."""
    predictions = people(seed, count=2)
    cells = predicted_occupancy(predictions, GRID).reshape(4, -1)[:, ::97]
    np.testing.assert_allclose(cells, drawn(predictions), atol=0.08)
    swapped = predicted_occupancy(predictions.select(np.array([1, 0])), GRID).reshape(4, -1)[:, ::97]
    np.testing.assert_allclose(cells, swapped, atol=1e-6)


@given(seeds, st.sampled_from([0.05, 0.1, 0.25, 1.0]))
@settings(max_examples=10)
def test_one_person_covers_the_area_of_a_body(seed, cell_m):
    covered_m2 = predicted_occupancy(people(seed), GRID.free(cell_m)).sum(axis=(1, 2)) * cell_m**2
    np.testing.assert_allclose(covered_m2, np.pi * BODY_M**2, rtol=0.01)


@given(seeds, st.integers(-15, 15), st.integers(-15, 15))
@settings(max_examples=10)
def test_a_part_of_the_grid_has_the_same_values(seed, right, up):
    """Also where people are partly or wholly outside the part."""
    predictions = people(seed, count=2, reach_m=3.0)
    left, bottom = 30 + right, 15 + up
    part = OccupancyMap(np.zeros((20, 30)), GRID.origin + 0.1 * np.array([left, bottom]), 0.1)
    wide = OccupancyMap(np.zeros((180, 160)), GRID.origin - 5.0, 0.1)
    whole = predicted_occupancy(predictions, wide)[:, 50 + left :, 50 + bottom :][:, :20, :30]
    np.testing.assert_allclose(predicted_occupancy(predictions, part), whole, atol=1e-5)


def test_without_covariance_a_path_is_exact():
    here = Predictions.single(np.array([[[0.55, 0.55]]]), 0.3)
    cells = predicted_occupancy(here, GRID)[0]
    away = np.linalg.norm(GRID.center_of(np.indices(GRID.occupied.shape).T) - 0.55, axis=-1).T
    assert cells[away < 0.1].min() > 0.95
    assert cells[away > 0.65].max() == pytest.approx(0, abs=1e-3)


def test_what_has_no_answer_is_refused_by_its_field():
    large = OccupancyMap(np.zeros((4000, 4000), bool), [0, 0], 0.1)
    local = Predictions.single(np.zeros((1, 1, 2)), 0.3, frame="agent")
    for field, *arguments in (
        ("grid", people(0), large),
        ("body_m", people(0), GRID, np.nan),
        ("frame", local, GRID),
    ):
        with refused(field):
            predicted_occupancy(*arguments)


def test_cells_may_have_another_size():
    coarse = GRID.free(0.25)
    assert (coarse.occupied.shape, coarse.origin.tolist()) == ((32, 24), GRID.origin.tolist())
    with refused("cell_m"):
        GRID.free(0.0)
