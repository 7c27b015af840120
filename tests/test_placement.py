"""A map that does not lie under the people is noticed wherever a recording comes in."""

import logging
from dataclasses import replace

import numpy as np
import pytest
from omegaconf import OmegaConf

from pedpred.command import main
from pedpred.scenes import OccupancyMap, Scene, Trajectories, checked_placement
from pedpred.storage.scenes import write_scene
from stages import ingest


def corner(people=40):
    """People walk along a corridor in the lower part of the map and up at its right end."""
    occupied = np.ones((60, 40), bool)
    occupied[:, 2:10] = occupied[50:58] = False
    way = np.concatenate([[[0.3 * k, 0.6] for k in range(18)], [[5.4, 0.6 + 0.3 * k] for k in range(12)]])
    rows = np.arange(people * len(way))
    trajectories = Trajectories(0.3 * (rows % len(way)), rows // len(way), np.tile(way, (people, 1)) - [2, 1])
    return Scene("corner", trajectories, OccupancyMap(occupied, np.array([-2.0, -1.0]), 0.1), 0.3)


def turned(scene, how):
    """The same people on a map that was drawn wrongly."""
    ground = scene.occupancy
    if how == "with x and y swapped":
        wrong = replace(ground, occupied=ground.occupied.T, origin=ground.origin[::-1])
    else:
        x, y = {"mirrored in x": (-1, 1), "mirrored in y": (1, -1), "turned by 180 degrees": (-1, -1)}[how]
        wrong = replace(ground, occupied=ground.occupied[::x, ::y])
    return replace(scene, occupancy=wrong)


WRONG = ["mirrored in x", "mirrored in y", "turned by 180 degrees", "with x and y swapped"]


def moved(scene, rows, position):
    """The same scene with some detections elsewhere."""
    changed = scene.trajectories.position.copy()
    changed[rows] = position
    return replace(scene, trajectories=replace(scene.trajectories, position=changed))


def test_a_right_map_is_not_warned_about(caplog):
    assert checked_placement(corner()).worst == 0.0
    assert checked_placement(Scene.without_people("hall", "for a test")).worst == 0.0
    assert not caplog.records


@pytest.mark.parametrize("how", WRONG)
def test_the_warning_names_the_turn_that_would_be_right(how, caplog):
    assert checked_placement(turned(corner(), how)).wrong
    (record,) = caplog.records
    assert record.levelno == logging.WARNING
    assert [word for word in WRONG if word in caplog.text] == [how]


@pytest.mark.parametrize("shift_m", [0.5, 3.0, 30.0])
def test_a_shifted_map_is_warned_about(shift_m, caplog):
    scene = corner()
    ground = replace(scene.occupancy, origin=scene.occupancy.origin + shift_m)
    found = checked_placement(replace(scene, occupancy=ground))
    assert found.worst > 0.01
    assert (found.outside == 1.0) is (shift_m == 30.0)
    assert len(caplog.records) == 1


def test_a_few_misplaced_detections_are_no_reason_to_warn(caplog):
    scene = corner()
    count = len(scene.trajectories)
    for misplaced, warned in ((count // 100, False), (count // 100 + 1, True)):
        found = checked_placement(moved(scene, slice(misplaced), (-1.0, 2.0)))
        assert found.in_obstacles == misplaced / count
        assert bool(caplog.records) is warned


def by_ingest(folder):
    place = {"source": "scene_folder", "folder": str(folder), "settings": {}}
    out = str(folder.with_name("out"))
    ingest.main.__wrapped__(OmegaConf.create({"places": {"corner": place}, "name": "corner", "out": out}))


@pytest.mark.parametrize(
    "read",
    [
        by_ingest,
        lambda folder: main(["info", str(folder)]),
        lambda folder: main(["convert", str(folder), "-o", str(folder.with_name("out.mcap"))]),
        lambda folder: main(["predict", str(folder), "-o", str(folder.with_name("out.mcap"))]),
        lambda folder: main(["evaluate", str(folder), "--samples", "20"]),
    ],
    ids=["ingest", "info", "convert", "predict", "evaluate"],
)
def test_a_flipped_map_is_warned_about_by(read, tmp_path, caplog, mixture, monkeypatch):
    write_scene(turned(corner(people=4), "mirrored in y"), tmp_path / "corner")
    monkeypatch.setattr("pedpred.online.predictor.default_model", lambda: mixture[0])
    read(tmp_path / "corner")
    (warning,) = [record for record in caplog.records if record.name == "pedpred.scenes.placement"]
    assert "mirrored in y" in warning.getMessage()


@pytest.mark.parametrize(("people", "marked"), [(2, False), (3, True)])
def test_figures_with_a_wrong_map_are_marked(people, marked, tmp_path, mixture, capsys):
    scene = corner(people=50)
    wrong = scene.trajectories.track_id < people
    write_scene(moved(scene, wrong, scene.trajectories.position[wrong] + [0.0, 100.0]), tmp_path / "corner")
    main(["evaluate", str(tmp_path / "corner"), "--samples", "20", "--model", str(mixture[0])])
    assert ("WRONG MAP?" in capsys.readouterr().out) is marked
