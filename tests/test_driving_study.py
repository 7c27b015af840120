"""The stage that drives, and what the report makes of it: the same bytes, and what is shown."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from omegaconf import OmegaConf
from scipy.stats import binomtest

from pedpred.driving import study
from pedpred.driving.episodes import DriveSettings, EpisodeSettings
from pedpred.driving.figures import figures_of, share_interval
from pedpred.driving.measures import Measures
from pedpred.driving.shown import choose_episodes
from pedpred.driving.study import StudyPlace, StudySettings, drive_block, write_study
from pedpred.driving.table import Condition, Row, read_table, write_table
from pedpred.files import read_json
from pedpred.report.canvas import png_bytes
from pedpred.report.drives import LABELS, drives_section, read_shown
from pedpred.ros import read_bag
from pedpred.scenes import Scene
from pedpred.storage.scenes import write_scene
from stages import drive
from tests.configuration import composed
from tests.conftest import ROOT

DEFAULT = (ROOT / "models/online/default").as_posix()
PLACE = StudyPlace("", "corridor", "react", DEFAULT, DEFAULT)
SETTINGS = StudySettings(2, (0.05, 0.3), ("kalman", "modes"), 1, {"corridor": PLACE})
"""Episodes of this seed are short, yet the network learns in each of them: what stays, the next one shows."""


@pytest.fixture(scope="module", autouse=True)
def short_ways():
    """Robots watch for a second and drive some metres."""
    ways = partial(DriveSettings, episodes=EpisodeSettings((3.0, 5.0), watching_s=1.0))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study, "DriveSettings", ways)
        yield


def write(rows, folder, settings=SETTINGS):
    write_study(settings, "corridor", rows, folder / "drives", folder / "corridor.json")


@pytest.fixture(scope="module")
def rows():
    return drive_block(SETTINGS, "corridor", range(2))


def test_a_table_does_not_depend_on_how_episodes_are_divided(rows, tmp_path):
    """Nor on what else is driven: here with one of the risks alone."""
    few = replace(SETTINGS, risks=SETTINGS.risks[1:])
    dealt = drive_block(few, "corridor", [1])[::-1]
    asked = PLACE.models().conditions(few.methods, few.risks)
    same = [row for row in rows if row.episode == 1 and row.condition in asked]
    write_table(tmp_path / "dealt.csv", dealt)
    write_table(tmp_path / "same.csv", same)
    assert (tmp_path / "same.csv").read_bytes() == (tmp_path / "dealt.csv").read_bytes()
    assert figures_of(same) == figures_of(dealt)
    assert {row.condition for row in rows} == set(PLACE.models().conditions(SETTINGS.methods, SETTINGS.risks))
    assert [number for block in replace(SETTINGS, episodes=9).blocks() for number in block] == list(range(9))


def test_a_page_shows_curves_figures_and_episodes(rows, tmp_path):
    write(rows, tmp_path)
    shown = read_shown(tmp_path / "drives")
    assert {one.kind for one in shown} == {"helps", "hinders"}
    figures = read_json(tmp_path / "corridor.json", ValueError)
    section = drives_section({"corridor": (figures, shown)})
    assert section.markdown("drives").count(f"| {LABELS['kalman']} |") == 2
    assert all(png_bytes(picture.figure) for picture in section.pictures)
    assert len(list(section.pictures)) == 1 + len(shown)
    (recorded,) = (one for one in shown if one.recording)
    (scene, about), people = recorded.drives[1], read_bag(Path(recorded.recording)).trajectories
    assert about["method"] == "modes"
    np.testing.assert_allclose(np.sort(people.time_s), np.sort(scene.trajectories.time_s), atol=1e-6)
    robot = scene.trajectories.position[scene.trajectories.track_id == scene.trajectories.track_id.max()]
    assert np.hypot(*np.diff(robot, axis=0).T).max() < 0.15  # m within 0.1 s


def test_the_stage_writes_a_table_and_figures(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PEDPRED_JOBS", "1")
    for name in ("simulation_mixture", "simulation"):
        (tmp_path / "models/online").mkdir(parents=True, exist_ok=True)
        (tmp_path / "models/online" / name).symlink_to(DEFAULT)
    cfg = composed("scale=smoke")
    cfg["driving"]["seed"] = SETTINGS.seed
    drive.main.__wrapped__(OmegaConf.create(cfg | {"name": "corridor"}))
    driven = read_table(tmp_path / "data/drives/corridor/table.csv")
    methods = {row.condition.method for row in driven}
    assert methods == {"kalman", "modes", "true_future", "lstm"}
    figures = read_json(tmp_path / "reports/metrics/driving/corridor.json", ValueError)
    assert set(figures["methods"]) == methods
    assert figures["episodes"] == 1
    assert [one.kind for one in read_shown(tmp_path / "data/drives/corridor")] == ["helps"]


def test_a_missing_recording_leaves_an_empty_table(tmp_path):
    write_scene(Scene.without_people("lab_corner", "ask for it"), tmp_path / "scene")
    place = replace(PLACE, world="none", input=str(tmp_path / "scene"))
    missing = replace(SETTINGS, places={"corridor": place})
    assert drive_block(missing, "corridor", range(2)) == []
    write([], tmp_path, missing)
    assert read_json(tmp_path / "corridor.json", ValueError) == {}
    assert read_shown(tmp_path / "drives") == []


def made_rows(faults, times_s, risk=0.1):
    """A table of `modes` and `kalman` with given faults and times of each episode."""
    usual = dict.fromkeys(Measures.__annotations__, 1)
    return [
        Row("here", "differential", Condition(method, risk), e, "0", Measures(**usual | found))
        for method in ("modes", "kalman")
        for e, found in enumerate(
            {"faults": hit, "contacts": hit, "time_s": t}
            for hit, t in zip(faults[method], times_s[method], strict=True)
        )
    ]


@given(st.integers(1, 300), st.data())
def test_intervals_of_shares_are_those_of_wilson(cases, data):
    hits = data.draw(st.integers(0, cases))
    happened = np.arange(cases) < hits
    expected = binomtest(hits, cases).proportion_ci(method="wilson")
    np.testing.assert_allclose(share_interval(happened.astype(float)), expected, atol=1e-6)


def test_an_interval_of_few_episodes_without_a_collision_is_wide():
    none = {"modes": [0] * 14, "kalman": [0] * 14}
    times = {limit: {"modes": [t] * 14, "kalman": [t + 0.5] * 14} for limit, t in ((0.1, 8.0), (0.3, 7.0))}
    rows = [row for limit, at in times.items() for row in made_rows(none, at, limit)]
    low, high = figures_of(rows)["equal_time"]["kalman"]["at_fault_ci95"]
    assert -low == high > 0.15


def test_episodes_are_shown_where_most_and_least_is_avoided():
    faults = {"modes": [0, 0, 1, 0, 0], "kalman": [0, 1, 0, 0, 0]}
    times_s = {"modes": [8.0, 9.0, 7.0, 8.5, 7.0], "kalman": [8.0] * 5}
    both = made_rows(faults, times_s), made_rows(faults, times_s)[::-1]
    for rows in both:
        chosen = choose_episodes(rows, Condition("modes", 0.1), Condition("kalman", 0.1))
        assert chosen == {"helps": 1, "hinders": 2, "usual": 0}
