"""Whether tracks can be those of people: order of columns, clocks, speeds; real ones cause no warning."""

import logging

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pedpred.reading import read_recording
from pedpred.reading.checks import check, speeds_mps
from pedpred.reading.errors import ContentError
from pedpred.reading.options import ReadOptions
from pedpred.scenes import Trajectories
from tests.conftest import ROOT
from tests.refused import unread


def walkers(people, steps, seed, speed_mps=1.2, dt_s=0.4):
    """(id, step, x, y) of people who walk on gently turning ways and come one after the other."""
    rng = np.random.default_rng(seed)
    headings = rng.uniform(0, 6.3, people) + np.cumsum(rng.normal(0, 0.1, (steps, people)), axis=0)
    way = speed_mps * dt_s * np.stack([np.cos(headings), np.sin(headings)], axis=-1)
    places = rng.uniform(-10, 10, (people, 2)) + np.cumsum(way, axis=0)
    return [(who, k + 3 * who, *places[k, who].round(3)) for who in range(people) for k in range(steps)]


def write(folder, rows):
    path = folder / "walk.txt"
    path.write_text("\n".join(" ".join(map(str, row)) for row in rows))
    return path


@given(st.integers(2, 12), st.integers(12, 40), st.integers(0, 99), st.booleans(), st.booleans())
@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_id_and_frame_are_told_apart_in_any_order_of_lines(tmp_path, people, steps, seed, first, mixed):
    rows = [(who, 10 * k, x, y) for who, k, x, y in walkers(people, steps, seed)]
    if mixed:
        np.random.default_rng(seed).shuffle(rows)
    path = write(tmp_path, [row if first else (row[1], row[0], *row[2:]) for row in rows])
    found = read_recording(path, ReadOptions(rate_hz=25.0)).scene.trajectories
    assert len(np.unique(found.track_id)) == people
    assert found.time_s.max() == max(row[1] for row in rows) / 25.0


@pytest.mark.parametrize(("name", "step", "rate_hz"), [("{}", 0.4, None), ("ped{}", 1, 2.5)])
def test_times_and_words_tell_columns_apart(tmp_path, name, step, rate_hz):
    rows = walkers(3, 20, 0)
    path = write(tmp_path, [(k * step, name.format(who), x, y) for who, k, x, y in rows])
    found = read_recording(path, ReadOptions(rate_hz=rate_hz)).scene.trajectories
    assert found.time_s.max() == pytest.approx(0.4 * max(row[1] for row in rows))


def test_an_order_that_stays_open_must_be_given(tmp_path):
    path = write(tmp_path, [(who, k, 0.5 * k, 0.5 * who) for who in range(9) for k in range(9)])
    with unread(path, remedy="--columns"):
        read_recording(path, ReadOptions(rate_hz=2.5))
    read_recording(path, ReadOptions(columns=("id", "frame", "x", "y"), rate_hz=2.5))


def crowd(factor=1.0, clock=1.0):
    who, k, x, y = np.transpose(walkers(6, 30, 1))
    return Trajectories(clock * 0.4 * k, who, factor * np.stack([x, y], axis=-1))


@pytest.mark.parametrize("factor", [6.0, 1000.0])
def test_impossible_speeds_are_refused_unless_any_speed_is_read(factor):
    people = crowd(factor)
    with pytest.raises(ContentError) as refused:
        check(people, "walk.csv")
    assert all(option in refused.value.remedy for option in ("--unit", "--rate", "--any-speed"))
    np.testing.assert_allclose(check(people, "walk.csv", any_speed=True), 0.4)


@pytest.mark.parametrize("factor", [15, 1e6])
def test_a_clock_that_does_not_count_seconds_is_refused(factor):
    with pytest.raises(ContentError) as refused:
        check(crowd(clock=factor), "walk.csv")
    assert all(option in refused.value.remedy for option in ("t_ms", "--rate"))


def test_speeds_are_measured_along_tracks():
    np.testing.assert_allclose(np.median(speeds_mps(crowd(2.0))), 2.4, rtol=0.01)


@pytest.mark.parametrize("factor", [3.0, 0.05])
def test_odd_speeds_give_one_warning(factor, caplog):
    check(crowd(factor), "walk.csv")
    assert [record.levelname for record in caplog.records] == ["WARNING"]


@pytest.mark.parametrize("name", ["corner/walk.txt", "zara01/excerpt.txt"])
def test_a_real_recording_is_read_without_a_warning(name, caplog):
    with caplog.at_level(logging.WARNING):
        read_recording(ROOT / "examples" / name, ReadOptions(rate_hz=25.0 if "zara" in name else None))
    assert not caplog.records
