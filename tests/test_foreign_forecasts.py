"""Forecasts of other programs in files: tables, and predictions of TrajNet++."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pedpred.command.forecast_tables import COLUMNS, write_forecasts
from pedpred.command.foreign import read_forecasts
from pedpred.errors import InputError
from pedpred.reading.names import TrackNames
from pedpred.scenes import Predictions
from tests.forecasts import windows_with
from tests.refused import unread


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """Writes rows of a table of forecasts; the file."""
    path = tmp_path_factory.mktemp("foreign") / "theirs.csv"

    def write(rows):
        path.write_text("\n".join([",".join(COLUMNS), *(",".join(map(str, row)) for row in rows)]) + "\n")
        return path

    return write


def rows_of(tracks=(1,), times_s=(0.0,), modes=2, steps=3):
    """A table of forecasts: people go along x, the modes apart along y."""
    return [
        (track, time_s, mode, 1.0 / modes, step, time_s + 0.3 * step, mode)
        for track in tracks
        for time_s in times_s
        for mode in range(modes)
        for step in range(1, steps + 1)
    ]


# Tables


@pytest.mark.parametrize("kind", ["csv", "parquet"])
@pytest.mark.parametrize("modes", [1, 3])
def test_written_forecasts_are_read_again(tmp_path, kind, modes):
    rng, steps = np.random.default_rng(0), 4
    path = rng.uniform(-50, 50, (5, modes, steps, 2))
    weight = np.sort(rng.dirichlet(np.ones(modes), 5))[:, ::-1]
    forecasts = Predictions(path[:, 0], path, weight, 0.3)
    given_ = {"track_id": np.array([7, 7, 8, 9, 9]), "time_s": np.array([0.4, 0.8, 0.4, 0.0, 1.7e9])}
    windows = windows_with(np.zeros((5, 2)), np.zeros((5, steps, 2)), {}, **given_)
    file = tmp_path / f"mine.{kind}"
    write_forecasts(replace(windows, predictions={"mine": forecasts}), "mine", file)
    found = read_forecasts(file, 0.3)
    np.testing.assert_array_equal(found.track_id, given_["track_id"])
    np.testing.assert_allclose(found.time_s, given_["time_s"])
    np.testing.assert_allclose(found.path, path, atol=1e-4)
    np.testing.assert_allclose(found.weight, weight, atol=1e-3)


@given(st.permutations(rows_of((1, 2), (0.0, 0.4))))
def test_rows_may_stand_in_any_order(table, rows):
    usual, found = (read_forecasts(table(some)) for some in (rows_of((1, 2), (0.0, 0.4)), rows))
    for name in ("track_id", "time_s", "path", "weight"):
        np.testing.assert_array_equal(getattr(found, name), getattr(usual, name))


def test_weights_are_shares_of_modes_from_the_most_likely_on(table):
    forecasts = read_forecasts(
        table([(1, 0.0, mode, weight, 1, mode, 0.0) for mode, weight in enumerate((1, 3))])
    )
    assert forecasts.weight.tolist() == [[0.75, 0.25]]
    assert forecasts.path[0, :, 0, 0].tolist() == [1.0, 0.0]


@given(st.integers(-(2**63), 2**63 - 2))
def test_forecasts_of_ids_of_64_bits_are_told_apart(table, who):
    forecasts = read_forecasts(table(rows_of((who, who + 1))))
    assert forecasts.track_id.tolist() == [who, who + 1]


def test_whole_numbers_in_parquet_may_be_floats(tmp_path, table):
    """A column that once missed a value, or was merged, is one of floats."""
    csv = table(rows_of((1, 2)))
    whole = dict.fromkeys(("track", "mode", "step"), "float64")
    pd.read_csv(csv).astype(whole).to_parquet(tmp_path / "theirs.parquet")
    usual, found = read_forecasts(csv), read_forecasts(tmp_path / "theirs.parquet")
    np.testing.assert_array_equal(found.track_id, usual.track_id)
    np.testing.assert_array_equal(found.path, usual.path)


def test_a_value_that_makes_no_forecast_is_refused(table, tmp_path):
    for column, value in (("x", "a"), ("y", "nan"), ("step", 0.5), ("weight", -1.0)):
        wrong = pd.DataFrame(rows_of((1, 2)), columns=list(COLUMNS)).astype({column: object})
        wrong.loc[4, column] = value
        wrong.to_csv(tmp_path / "theirs.csv", index=False)
        wrong.astype({column: str}).to_parquet(tmp_path / "theirs.parquet")
        for kind in ("csv", "parquet"):
            with unread(tmp_path / f"theirs.{kind}", remedy=column):
                read_forecasts(tmp_path / f"theirs.{kind}")


def test_a_missing_column_is_named(tmp_path):
    rows = pd.DataFrame(rows_of(), columns=list(COLUMNS)).drop(columns="weight")
    rows.to_csv(tmp_path / "theirs.csv", index=False)
    rows.to_parquet(tmp_path / "theirs.parquet")
    for kind in ("csv", "parquet"):
        with unread(tmp_path / f"theirs.{kind}", remedy="column weight"):
            read_forecasts(tmp_path / f"theirs.{kind}")


def test_forecasts_have_the_same_modes_and_steps(table):
    later = [(*row[:4], row[4] + 1, *row[5:]) for row in rows_of()]
    for rows in ([], rows_of((1, 2))[:-1], [*rows_of(), rows_of()[-1]], later):
        with pytest.raises(InputError):
            read_forecasts(table(rows))


# TrajNet++


@pytest.mark.parametrize("later", [0, 5])
def test_scenes_may_lie_between_the_frames_of_others(later, tmp_path):
    lines = [{"scene": {"id": number, "p": number, "fps": 2.5}} for number in (1, 2)]
    lines += [
        {"track": {"f": later * (who == 2) + 10 * k, "p": who, "x": 0.4 * k, "y": 0.0, **forecast}}
        for who in (1, 2)
        for forecast in ({"prediction_number": n, "scene_id": who} for n in (0, 1))
        for k in (9, 10, 11)
    ]
    (tmp_path / "them.ndjson").write_text("\n".join(map(json.dumps, lines)))
    found = read_forecasts(tmp_path / "them.ndjson")
    np.testing.assert_allclose(found.time_s, [3.2, 3.2 + 0.04 * later])
    assert found.path.shape == (2, 2, 3, 2)
    assert found.step_s == 0.4


def test_a_file_without_predictions_is_refused(tmp_path):
    (tmp_path / "them.ndjson").write_text('{"scene": {"id": 7, "p": 1, "fps": 2.5}}')
    with unread(tmp_path / "them.ndjson"):
        read_forecasts(tmp_path / "them.ndjson")


# Windows


def test_names_are_those_of_the_recording(table):
    """Also names that are the numbers of other tracks, and numbers of tracks that have names."""
    names = TrackNames({0: "Bo", 1: "0"})
    rows = [*rows_of(("0",), (1.0,)), *rows_of(("Bo",), (2.0,)), *rows_of(("Cy",), (3.0,))]
    found = read_forecasts(table(rows), names=names)
    assert dict(zip(found.track_id, found.time_s, strict=True)) == {1: 1.0, 0: 2.0}
    numbers = read_forecasts(table(rows_of((0, 1))), names=TrackNames({0: "Ann", 1: "Bo"}))
    assert numbers.track_id.tolist() == [0, 1]
    with pytest.raises(InputError):
        read_forecasts(table(rows_of(("Cy",))), names=names)
