"""The stage that writes training rows: the same bytes from any number of workers; no recording, no rows."""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from pedpred.scenes import Scene
from pedpred.storage.scenes import write_scene
from pedpred.storage.situations import read_situations, read_situations_manifest
from tests.conftest import ROOT
from tests.worlds import walled_scene


def run(folder, kind, name, jobs=1):
    """Run the stage by hand at the smallest scale; its manifest and the bytes of all its files."""
    command = [sys.executable, "-m", "stages.situations", "scale=smoke", f"+kind={kind}", f"+name={name}"]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "PEDPRED_JOBS": str(jobs)}
    subprocess.run(command, cwd=folder, env=environment, check=True, capture_output=True)
    out = folder / "data/situations" / kind / name
    return read_situations_manifest(out), {path.name: path.read_bytes() for path in out.iterdir()}


def test_the_number_of_workers_changes_no_byte(tmp_path):
    (tmp_path / "other").mkdir()
    (sizes, names), files = run(tmp_path, "simulated", "corridor")
    assert run(tmp_path / "other", "simulated", "corridor", jobs=2) == ((sizes, names), files)
    assert names == ["corridor_000", "corridor_001"]
    for name in names:
        rows = read_situations(tmp_path / "data/situations/simulated/corridor", name, sizes)
        assert len(rows["future"]) >= 60


@pytest.mark.parametrize("kind", ["recorded", "missing", "simulated"])
def test_a_place_gives_its_viewings_if_there_is_a_recording(kind, tmp_path):
    scene = walled_scene(np.random.default_rng(0), detections=60)
    missing, stand_in = Scene.without_people("eth", "ask for it"), replace(scene, stand_in="drawn by hand")
    place = {"recorded": scene, "missing": missing, "simulated": stand_in}[kind]
    write_scene(place, tmp_path / "data/scenes/real/eth")
    (_, names), files = run(tmp_path, "real", "eth")
    assert names == (["eth_0", "eth_1"] if kind == "recorded" else [])
    assert len(files) == 1 + len(names)
