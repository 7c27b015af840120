"""Rows of the configuration that tools write: one changes, the others and their comments stay."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from pedpred.baselines.social_force import initial_state
from pedpred.errors import ConfigError
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from pedpred.storage.scenes import write_scene
from tests.configuration import read
from tests.conftest import ROOT
from tests.simulated import SETTINGS
from tests.worlds import walled_scene
from tools import fit_social_force, tune_tracker
from tools.rows import write_row

FILE = ROOT / "conf/trackers/kalman.yaml"


def test_a_row_is_replaced_with_its_comment(tmp_path):
    path = Path(shutil.copy(FILE, tmp_path))
    write_row(path, "tuned_on_eth", "# again\ntuned_on_eth:\n  kind: truth\n")
    write_row(path, "tuned_on_zara", "tuned_on_zara:\n  kind: kalman\n")
    before, after = yaml.safe_load(FILE.read_text()), yaml.safe_load(path.read_text())
    changed = {"tuned_on_eth": {"kind": "truth"}, "tuned_on_zara": {"kind": "kalman"}}
    assert after == before | changed
    text = path.read_text()
    assert "# again\ntuned_on_eth:" in text
    assert "on eth, -0.515 each" not in text
    assert "on hotel, 0.166 each" in text
    assert text.splitlines()[0] == FILE.read_text().splitlines()[0]


def tuned(place, sensor, path, scene=None):
    """The row that is fitted to a scene with detections at 2.5 Hz, as the sensor lets them through."""
    params = {"places": {place: {"sensor": sensor}}, "sensors": {"perfect": {}, "thinned": {"rate_hz": 1.25}}}
    Path("params.yaml").write_text(yaml.safe_dump(params))
    scene = scene or walled_scene(np.random.default_rng(0), noise_m=0.05)
    write_scene(scene, Path("data/scenes/real", place))
    tune_tracker.main([place, "--out", str(path)])
    return yaml.safe_load(path.read_text())[f"tuned_on_{place}"]


def test_a_tuned_tracker_becomes_a_row(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = Path(shutil.copy(FILE, tmp_path))
    rows = [tuned("hall", sensor, path) for sensor in ("perfect", "thinned")]
    for row in rows:
        assert row["kind"] == "kalman"
        assert all(row[name] > 0 for name in ("acceleration_noise", "position_noise_m", "initial_speed_mps"))
    assert rows[0] != rows[1]


def test_fitted_forces_become_a_row(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = Path(shutil.copy(ROOT / "conf/social_forces/walking.yaml", tmp_path))
    params = read("params.yaml")
    params["places"] = {"hall": {"tracker": "kalman", "sensor": "perfect"}}
    Path("params.yaml").write_text(yaml.safe_dump(params))
    write_scene(walled_scene(np.random.default_rng(0)), Path("data/scenes/real/hall"))
    fit_social_force.main(["hall", "--trials", "2", "--out", str(path)])
    row = yaml.safe_load(path.read_text())["fitted_on_hall"]
    assert set(row["forces"]) == set(fit_social_force.FITTED)


def test_a_fit_comes_closer_to_what_people_did():
    """Two pairs meet on a pavement; the truth is how they walk by other forces."""
    start = np.array([[2.0, 4.0], [2.0, 5.2], [14.0, 4.3], [14.0, 5.5]])
    velocity = np.array([[1.3, 0], [1.3, 0], [-1.3, 0], [-1.3, 0]])
    time_s = np.repeat(0.3 * np.arange(31), 4)
    position = np.tile(start, (31, 1)) + np.tile(velocity, (31, 1)) * time_s[:, None]
    ground = OccupancyMap(np.zeros((160, 100), bool), np.zeros(2), 0.1)
    people, groups = np.tile(np.arange(4), 31), np.tile([7, 7, 2, 2], 31)
    walks = Trajectories(time_s, people, position, group_id=groups)
    scene = Scene("pavement", walks, ground, 0.3)
    begun = initial_state(scene, np.arange(4), np.zeros(4), start, velocity, SETTINGS.routing)

    def walked(**forces):
        return begun.paths(replace(SETTINGS, forces=SETTINGS.forces._replace(**forces)), 10, 0.3)

    truth = walked(pedestrian_strength=6.0, relaxation_time_s=0.9)
    fit = fit_social_force.fit_forces(begun, np.arange(4), truth, SETTINGS, 0.3, most_trials=60)
    assert fit.reached_m < 0.5 * fit.start_m
    off = np.linalg.norm(walked(**fit.forces) - truth, axis=-1)
    assert fit.reached_m == pytest.approx(off.mean())


def test_a_row_that_would_be_its_own_base_is_refused():
    rows = {"a": {"x": 1, "y": 1}, "fitted_on_eth": {"base": "a", "y": 2}, "c": {"base": "fitted_on_eth"}}
    assert fit_social_force.base_of("hotel", "c", rows) == {"x": 1, "y": 2}
    assert fit_social_force.base_of("eth", "a", rows) == {"x": 1, "y": 1}
    for base in ("fitted_on_eth", "c"):
        with pytest.raises(ConfigError):
            fit_social_force.base_of("eth", base, rows)
