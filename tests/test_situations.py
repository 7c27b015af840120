"""Training rows: what a network would see of tracked people, where they truly went, and their stage."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from omegaconf import OmegaConf

from pedpred.rows.files import count_rows_of, read_manifest
from pedpred.rows.recorded import ViewingSettings, rows_of_viewing
from pedpred.rows.sampling import RowSampling, RowSettings
from pedpred.rows.simulated import SimulatedSet, rows_of_world, steps_of_world
from pedpred.scenes import Scene
from pedpred.settings import load
from pedpred.storage.scenes import write_scene
from stages import rows
from tests.configuration import composed
from tests.exported import LSTM_ROWS, MIXTURE_ROWS, widths_of
from tests.simulated import SENSING, read, short_worlds
from tests.worlds import walled_scene

CONF = read("situations/varied")
ROWS = load(RowSettings, CONF["rows"])
WORLDS = short_worlds(12.0, warm_up_s=5.0)
PROTOCOL = MIXTURE_ROWS.protocol
SAMPLING = RowSampling(ROWS, MIXTURE_ROWS, 0.2)
CORRIDOR = SimulatedSet("corridor", "", 2, 60, 30, 1.0)
VIEWINGS = ViewingSettings(3, 50, 0.5, (1.0, 0.5), (0.0, 0.02), (0.0,))


def assert_equal(rows, others):
    assert list(rows) == list(others)
    for name, values in rows.items():
        np.testing.assert_array_equal(values, others[name])


@pytest.mark.parametrize("kind", ["corridor", "bottleneck", "room", "square", "lone"])
def test_a_world_gives_the_rows_that_are_asked_for(kind):
    chosen = replace(CORRIDOR, kind=kind)
    rows = rows_of_world(1, chosen, WORLDS, SENSING, SAMPLING)
    widths = {name: values.shape[1] for name, values in rows.items() if name != "future"}
    assert widths == widths_of(MIXTURE_ROWS.features)
    assert rows["future"].shape[1:] == (PROTOCOL.horizon_steps, 2)
    assert 30 < len(rows["future"]) <= 90
    assert len({len(values) for values in rows.values()}) == 1
    assert all(np.isfinite(values).all() for values in rows.values())
    assert_equal(rows, rows_of_world(1, chosen, WORLDS, SENSING, SAMPLING))


def test_a_set_may_have_true_states_only():
    rows = rows_of_world(0, replace(CORRIDOR, rows=0), WORLDS, SENSING, SAMPLING)
    assert 0 < len(rows["future"]) <= 30
    np.testing.assert_array_equal(rows["track"][:, 2:5], 0.0)  # no covariance
    neither = rows_of_world(0, replace(CORRIDOR, rows=0, true_share=0.0), WORLDS, SENSING, SAMPLING)
    assert neither["future"].shape == (0, PROTOCOL.horizon_steps, 2)


@pytest.mark.parametrize("rate_hz", [0.0, 2.5])
def test_viewings_differ_and_repeat(rate_hz):
    scene = walled_scene(np.random.default_rng(0), dt_s=0.1, detections=120)
    views = [rows_of_viewing(n, scene, rate_hz, VIEWINGS, SAMPLING) for n in range(3)]
    assert all(0 < len(rows["future"]) <= 50 for rows in views)
    assert not np.array_equal(views[0]["history"], views[1]["history"])
    assert_equal(views[2], rows_of_viewing(2, scene, rate_hz, VIEWINGS, SAMPLING))


# Step sequences of recurrent networks


@pytest.mark.parametrize("kind", ["corridor", "lone"])
def test_the_same_world_gives_the_same_steps_on_the_clock(kind):
    sampling = RowSampling(ROWS, LSTM_ROWS, 0.2)
    first, second = (list(steps_of_world(kind, 0, WORLDS, SENSING, sampling)) for _ in range(2))
    found = {}
    for name in ("track_id", "time_s", "position", "velocity", "future"):
        found[name], again = (np.concatenate([getattr(b, name) for b in own]) for own in (first, second))
        assert found[name].tobytes() == again.tobytes()
    passed = np.diff(found["time_s"])[np.diff(found["track_id"]) == 0] / LSTM_ROWS.protocol.dt_s
    assert len(passed) > 30
    np.testing.assert_allclose(passed, np.round(passed), atol=1e-5)


# The stage


@pytest.fixture
def usual():
    """The configuration at the smallest scale, with one simulated set and one place."""
    cfg = composed("scale=smoke")
    cfg["situations"]["simulated"] = {"corridor": cfg["situations"]["simulated"]["corridor"]}
    cfg["places"] = {"eth": cfg["places"]["eth"]}
    return cfg


def run(cfg, kind, out, key):
    """Run the stage; manifest and bytes of all files of one of its sets."""
    rows.main.__wrapped__(OmegaConf.create(cfg | {"name": "mixture", "kind": kind, "out": str(out)}))
    return read_manifest(out / key), {p.name: p.read_bytes() for p in (out / key).iterdir()}


def test_the_number_of_workers_changes_no_byte(usual, tmp_path, monkeypatch):
    found = []
    for jobs in ("1", "2"):
        monkeypatch.setenv("PEDPRED_JOBS", jobs)
        found.append(run(usual, "simulated", tmp_path / jobs, "corridor"))
    assert found[0] == found[1]
    _, names = found[0][0]
    assert list(names) == ["corridor_000", "corridor_001"]
    assert count_rows_of(tmp_path / "1/corridor") >= 120


@pytest.mark.parametrize("kind", ["recorded", "missing", "simulated"])
def test_a_place_gives_its_viewings_if_there_is_a_recording(kind, usual, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PEDPRED_JOBS", "1")
    scene = walled_scene(np.random.default_rng(0), detections=60)
    missing, stand_in = Scene.without_people("eth", "ask for it"), replace(scene, stand_in="drawn by hand")
    place = {"recorded": scene, "missing": missing, "simulated": stand_in}[kind]
    write_scene(place, Path("data/scenes/real/eth"))
    (_, names), files = run(usual, "real", Path("rows"), "eth")
    assert list(names) == (["eth_0", "eth_1"] if kind == "recorded" else [])
    assert len(files) == 1 + len(names)
