"""Which recordings tools and benchmarks read: files, or the places that have a recording."""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.noise import by_place
from pedpred.errors import InputError, ValueRuleError
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


def test_where_no_place_was_recorded_the_way_to_recordings_is_named(project):
    with pytest.raises(InputError, match=r"no recording is here\. `python -m tools.recordings` says"):
        list(recordings([]))


def test_a_place_without_a_recording_that_is_named_is_an_error_with_the_way_to_it(project):
    with pytest.raises(InputError, match=r"hotel: its recording is not available\. ask for it"):
        list(recordings([project / "hotel"]))


def test_files_that_count_frames_are_read_at_their_rate(project):
    Path("walk.csv").write_text("frame,id,x,y\n" + FRAMES)
    (scene,) = recordings([Path("walk.csv")], 10.0)
    assert scene.detection_dt_s == pytest.approx(0.1)


@settings(max_examples=8)
@given(st.lists(st.tuples(st.sampled_from("abc"), st.sampled_from(["walk", "eth"])), min_size=1, unique=True))
def test_recordings_have_names_of_their_own(named):
    with TemporaryDirectory() as folder:
        files = [Path(folder, inner, f"{name}.csv") for inner, name in named]
        for file in files:
            file.parent.mkdir(exist_ok=True)
            file.write_text("time,id,x,y\n" + FRAMES)
        read = list(recordings(files))
        assert len({scene.name for scene in read}) == len(files)
        table = by_place(
            [{"place": s.name, "noise, m": 0.0, "network": 1, "network / best": 1} for s in read]
        )
        assert len(table) == len(files)


@pytest.mark.parametrize("named", [[], ["eth"]])
def test_a_rate_is_that_of_files(project, named):
    write_scene(walked(), project / "eth")
    with pytest.raises(ValueRuleError, match=r"--rate = 10\.0, but it is that of files"):
        list(recordings([project / name for name in named], 10.0))


def test_motion_of_nobody_has_no_instants(project):
    assert describe_motion("hotel", [Scene.without_people("hotel", "ask for it")])["instants"] == 0
