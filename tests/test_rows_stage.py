"""The stage that writes rows: the same bytes from any number of workers; no recording, no rows."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from omegaconf import OmegaConf

from pedpred.rows.files import count_rows_of, read_manifest
from pedpred.scenes import Scene
from pedpred.storage.scenes import write_scene
from stages import rows
from tests.configuration import composed
from tests.worlds import walled_scene


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
