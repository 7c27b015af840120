"""Forecasts that somebody else made: numbers of any size in them, in bounded memory."""

import json
import time
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pedpred.command import trajnet
from pedpred.command.forecast_tables import COLUMNS, write_forecasts
from pedpred.command.foreign import ForeignForecasts, read_forecasts
from pedpred.errors import InputError
from pedpred.scenes import Predictions
from tests.forecasts import windows_with


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """Writes rows of a table of forecasts; the file."""
    path = tmp_path_factory.mktemp("foreign") / "theirs.csv"

    def write(rows):
        path.write_text(
            "\n".join(",".join(map(repr, row)) for row in rows).join([f"{','.join(COLUMNS)}\n", "\n"])
        )
        return path

    return write


def test_rows_that_share_no_mode_and_no_step_are_refused_in_bounded_memory(table):
    path = table([(1, 0.0, number, 1.0, number, 0.0, 0.0) for number in range(1, 3000)])
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match="needs each step from 1 to 2999 once in each of 2999 modes"):
            read_forecasts(path, None)
        assert tracemalloc.get_traced_memory()[1] < 20e6
    finally:
        tracemalloc.stop()


@given(st.lists(st.floats(0.0, 1.7e308), min_size=2, max_size=5).filter(any))
def test_weights_of_any_size_become_shares(table, weights):
    forecasts = read_forecasts(table([(1, 0.0, *pair, 1, 0.0, 0.0) for pair in enumerate(weights)]), None)
    assert np.isfinite(forecasts.weight).all()
    assert forecasts.weight.sum() == pytest.approx(1.0)
    exact = [weight / max(weights) for weight in sorted(weights, reverse=True)]
    np.testing.assert_allclose(forecasts.weight[0] / forecasts.weight.max(), exact, rtol=1e-12, atol=1e-300)


@given(st.integers(-(2**63), 2**63 - 2))
def test_forecasts_of_ids_of_64_bits_are_told_apart(table, who):
    forecasts = read_forecasts(table([(one, 0.0, 0, 1.0, 1, 0.0, 0.0) for one in (who, who + 1)]), None)
    assert forecasts.track_id.tolist() == [who, who + 1]


def predicted(scenes, fps, path):
    """Write scenes with a prediction of one step each."""
    lines = [{"scene": {"id": number, "p": 1, "fps": fps}} for number in range(scenes)]
    track = {"p": 1, "x": 0.0, "y": 0.0, "prediction_number": 0}
    lines += [{"track": {**track, "f": 10 * number, "scene_id": number}} for number in range(scenes)]
    path.write_text("\n".join(map(json.dumps, lines)))
    return path


@pytest.mark.parametrize("fps", [0, -1, 1e-320, 1e308, float("inf"), float("nan")])
def test_a_rate_that_no_camera_has_is_refused(fps, tmp_path):
    rule = "them.ndjson, line 1: .* is not a number" if np.isinf(fps) else "fps of the scenes"
    with pytest.raises(InputError, match=rule):
        read_forecasts(predicted(1, fps, tmp_path / "them.ndjson"), None)


@pytest.mark.parametrize("nowhere", ["NaN", "null"])
def test_neighbours_may_have_no_position_and_others_must(nowhere, tmp_path):
    path = predicted(1, 2.5, tmp_path / "them.ndjson")
    wanted = read_forecasts(path, None)
    lost = f'{{"track": {{"f": 10, "p": %d, "x": {nowhere}, "y": {nowhere}, "prediction_number": 0, '
    lost += '"scene_id": 0}}'
    text = path.read_text()
    path.write_text(f"{text}\n{lost % 99}")
    found = read_forecasts(path, None)
    np.testing.assert_array_equal(found.time_s, wanted.time_s)
    path.write_text(f"{text}\n{lost % 1}")
    with pytest.raises(InputError, match=r"line \d+: a prediction of the pedestrian.*has no position"):
        read_forecasts(path, None)


@pytest.mark.parametrize("later", [0, 5, 1000])
def test_scenes_may_lie_between_the_frames_of_others(later, tmp_path):
    lines = [{"scene": {"id": number, "p": number, "fps": 2.5}} for number in (1, 2)]
    lines += [
        {"track": {"f": later * (who == 2) + 10 * k, "p": who, "x": 0.4 * k, "y": 0.0, **forecast}}
        for who in (1, 2)
        for forecast in ({"prediction_number": n, "scene_id": who} for n in (0, 1))
        for k in (9, 10, 11)
    ]
    (tmp_path / "them.ndjson").write_text("\n".join(map(json.dumps, lines)))
    found = read_forecasts(tmp_path / "them.ndjson", None)
    np.testing.assert_allclose(found.time_s, [3.2, 3.2 + 0.04 * later])
    assert found.path.shape == (2, 2, 3, 2)
    assert found.step_s == 0.4


def test_the_number_of_scenes_is_bounded(tmp_path, monkeypatch):
    monkeypatch.setattr(trajnet, "_MOST_SCENES", 3)
    assert len(read_forecasts(predicted(3, 2.5, tmp_path / "them.ndjson"), None).time_s) == 3
    with pytest.raises(InputError, match="line 4: more than 3 scenes"):
        read_forecasts(predicted(4, 2.5, tmp_path / "them.ndjson"), None)


@pytest.mark.parametrize("modes", [1, 3])
def test_forecasts_that_are_written_as_a_table_are_read_again(tmp_path, modes):
    rng, steps = np.random.default_rng(0), 4
    path = rng.uniform(-50, 50, (5, modes, steps, 2))
    weight = np.sort(rng.dirichlet(np.ones(modes), 5))[:, ::-1]
    forecasts = Predictions(path[:, 0], path, weight, 0.3)
    given = {"track_id": np.array([7, 7, 8, 9, 9]), "time_s": np.array([0.4, 0.8, 0.4, 0.0, 1.7e9])}
    windows = windows_with(np.zeros((5, 2)), np.zeros((5, steps, 2)), {}, **given)
    write_forecasts(replace(windows, predictions={"mine": forecasts}), "mine", tmp_path / "mine.csv")
    found = read_forecasts(tmp_path / "mine.csv", 0.3)
    np.testing.assert_array_equal(found.track_id, given["track_id"])
    np.testing.assert_allclose(found.time_s, given["time_s"])
    np.testing.assert_allclose(found.path, path, atol=1e-4)
    np.testing.assert_allclose(found.weight, weight, atol=1e-3)


def nearest(forecasts, who, when_s):
    """The row of somebody's forecast nearest in time, at most 5 ms away; else -1."""
    away_s = np.where(forecasts.track_id == who, np.abs(forecasts.time_s - when_s), np.inf)
    return int(away_s.argmin()) if away_s.min() <= 0.005 else -1


def made(track_id, time_s):
    """Forecasts of some people at some instants, all alike."""
    count = len(track_id)
    return ForeignForecasts(
        Path("theirs"), track_id, time_s, np.zeros((count, 1, 1, 2)), np.ones((count, 1)), 0.4
    )


@given(st.integers(0, 2**32), st.integers(1, 40))
def test_a_window_has_the_nearest_forecast_of_its_person(seed, count):
    rng = np.random.default_rng(seed)
    pairs = np.unique(rng.integers(0, [4, 200], (count, 2)), axis=0)
    ids = np.array([-(2**62) - 1, -(2**62), 5, 2**62])
    forecasts = made(ids[pairs[:, 0]], pairs[:, 1] / 100)
    who, when_s = rng.choice(ids, 50), rng.integers(-5, 500, 50) / 250 + 1e-4
    expected = [nearest(forecasts, *one) for one in zip(who, when_s, strict=True)]
    assert forecasts._rows(who, when_s).tolist() == expected


def test_ten_times_as_many_people_take_ten_times_as_long():
    def least_s(people):
        forecasts, took_s = made(np.arange(people), np.zeros(people)), []
        for _ in range(3):
            begun_s = time.process_time()
            forecasts._rows(forecasts.track_id, forecasts.time_s)
            took_s.append(time.process_time() - begun_s)
        return min(took_s)

    assert least_s(20_000) < 40 * least_s(2_000)
