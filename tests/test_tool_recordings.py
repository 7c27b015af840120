"""Recordings that tools and benchmarks read: files, or the places that have a recording."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pedpred.errors import InputError
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from pedpred.storage.scenes import write_scene
from tools.motion import describe_motion
from tools.places import recordings

FRAMES = "".join(f"{frame},1,{0.1 * frame},0.0\n" for frame in range(30))


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A project with one missing place; the folder of its places."""
    monkeypatch.chdir(tmp_path)
    places = Path("data/scenes/real")
    write_scene(Scene.without_people("hotel", "ask for it"), places / "hotel")
    return places


def walked():
    time_s = 0.4 * np.arange(30)
    position = np.stack([time_s, 0.0 * time_s], axis=1)
    people = Trajectories(time_s, np.ones(30, np.int64), position)
    return Scene("eth", people, OccupancyMap.free_around(position), 0.4)


def test_places_without_a_recording_are_left_out(project):
    write_scene(walked(), project / "eth")
    write_scene(replace(walked(), name="corner", stand_in="simulated"), project / "corner")
    assert [scene.name for scene in recordings([])] == ["corner", "eth"]


def test_without_any_recording_the_error_names_the_way_to_them(project):
    for files, remedy in (([], "tools.recordings"), ([project / "hotel"], "ask for it")):
        with pytest.raises(InputError) as error:
            list(recordings(files))
        assert remedy in str(error.value)


def test_files_that_count_frames_are_read_at_their_rate(project):
    Path("walk.csv").write_text("frame,id,x,y\n" + FRAMES)
    (scene,) = recordings([Path("walk.csv")], 10.0)
    assert scene.detection_dt_s == pytest.approx(0.1)


def test_a_scene_without_people_has_no_instants(project):
    assert describe_motion("hotel", [Scene.without_people("hotel", "ask for it")])["instants"] == 0
