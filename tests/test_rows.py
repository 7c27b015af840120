"""Rows of the configuration that tools write: one changes, the others and their comments stay."""

import shutil
from pathlib import Path

import numpy as np
import yaml

from pedpred.storage.scenes import write_scene
from tests.conftest import ROOT
from tests.worlds import walled_scene
from tools import tune_tracker
from tools.rows import write_row

FILE = ROOT / "conf/trackers/kalman.yaml"


def test_a_row_is_replaced_with_its_comment_and_a_new_one_appended(tmp_path):
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


def test_a_tuned_tracker_becomes_a_row(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_scene(walled_scene(np.random.default_rng(0), noise_m=0.05), Path("data/scenes/real/crossing"))
    path = Path(shutil.copy(FILE, tmp_path))
    tune_tracker.main(["crossing", "--out", str(path)])
    row = yaml.safe_load(path.read_text())["tuned_on_crossing"]
    assert row["kind"] == "kalman"
    assert all(row[name] > 0 for name in ("acceleration_noise", "position_noise_m", "initial_speed_mps"))
