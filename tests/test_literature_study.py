"""The comparison with the literature: windows in company, paths that cover a forecast, folds, tables."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from omegaconf import OmegaConf

from pedpred.baselines.present_motion import PRESENT_MOTION, STRONGEST
from pedpred.command import field_protocol
from pedpred.evaluation.observed import find_observed_windows
from pedpred.evaluation.scores import Resampling, Scores, mean_scores, write_scores
from pedpred.features.perception import Perception
from pedpred.metrics.covering import covering_paths
from pedpred.models.mixture.features import MixtureFeatures
from pedpred.report.literature import SCENES, literature_section, read_published
from pedpred.report.methods import Methods
from pedpred.report.results import results_frame
from pedpred.scenes import Predictions, Scene, Trajectories
from pedpred.tracking import KalmanBank, KalmanSettings
from stages.config import PARTS
from stages.eth_ucy_gather import figures_of
from stages.perception import windows_of
from stages.rows import training_rows
from tests.configuration import read
from tests.conftest import ROOT, raw_folder
from tests.refused import refused
from tests.worlds import EXCERPT, empty_map, recorded

BANK = KalmanBank.around(
    KalmanSettings(acceleration_noise=0.03, position_noise_m=0.05, initial_speed_mps=1.0)
)
FEATURES = MixtureFeatures()
PARAMS = read("params.yaml")
STUDY = PARAMS["literature"]
PROTOCOL = windows_of(STUDY)


def crowd(seed=0, people=6, ticks=40):
    """People who come and go and wander."""
    rng, parts = np.random.default_rng(seed), []
    for person in range(people):
        first = int(rng.integers(0, 15))
        last = int(rng.integers(first + 2, ticks))
        steps = np.arange(first, last)
        path = rng.uniform(-4, 4, 2) + np.cumsum(
            rng.normal(0, 0.1, (len(steps), 2)) + rng.normal(0, 0.4, 2), axis=0
        )
        parts.append((0.4 * steps, np.full(len(steps), 10 + person), path))
    return Trajectories(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def found(trajectories, memory=False):
    scene = Scene("square", trajectories, empty_map(), 0.4)
    return find_observed_windows(scene, Perception(BANK, 0.2), PROTOCOL, memory)


def read_inputs(windows):
    (rows,) = training_rows(windows, FEATURES, 1)
    order = np.argsort(windows.time_s, kind="stable")
    return {
        (windows.track[w], round(windows.time_s[w], 3)): {n: v[i] for n, v in rows.items()}
        for i, w in enumerate(order)
    }


@settings(max_examples=10)
@given(seed=st.integers(0, 1000))
def test_a_window_knows_the_last_8_annotations_and_nothing_else(seed):
    whole = crowd(seed)
    usual = read_inputs(found(whole))
    for (track, end_s), inputs in list(usual.items())[:4]:
        near = (whole.time_s > end_s - 8 * 0.4 + 0.1) & (whole.time_s < end_s + 0.1)
        own = (whole.track_id == track) & (whole.time_s < end_s + 12 * 0.4 + 0.1)
        moved = np.where(near[:, None], whole.position, whole.position + 7.0)
        moved[own & ~near & (whole.time_s > end_s)] -= 7.0  # the truth of this window stays
        again = read_inputs(found(replace(whole, position=moved)))[track, end_s]
        for name, values in inputs.items():
            np.testing.assert_array_equal(again[name], values, err_msg=name)


@settings(max_examples=10)
@given(seed=st.integers(0, 1000), begun_s=st.floats(0, 1e5), slow=st.floats(-9e-4, 9e-4))
def test_windows_do_not_depend_on_when_the_clock_began(seed, begun_s, slow):
    whole = crowd(seed)
    usual = read_inputs(found(whole))
    later = read_inputs(found(replace(whole, time_s=begun_s + (1 + slow) * whole.time_s)))
    assert len(later) == len(usual)
    for own, other in zip(usual.values(), later.values(), strict=True):
        for name, values in own.items():
            np.testing.assert_allclose(other[name], values, atol=1e-5, err_msg=name)


FIELD = {
    "eth": (1.08, 2.28),
    "hotel": (0.32, 0.61),
    "univ": (0.52, 1.17),
    "zara1": (0.43, 0.95),
    "zara2": (0.32, 0.72),
}
"""ADE and FDE of constant velocity, m."""


@pytest.mark.parametrize("scene", SCENES)
def test_reported_constant_velocity_is_that_of_the_field(scene):
    """And of a few lines over the raw files."""
    errors = []
    for name in STUDY["scenes"][scene]:
        frame, track, *position = np.loadtxt(raw_folder("eth_ucy") / f"{name}.txt").T
        position = np.stack(position, axis=-1)
        for one in np.unique(track):
            rows = np.flatnonzero(track == one)
            rows = rows[np.argsort(frame[rows])]
            for k in range(len(rows) - 19):
                if frame[rows[k + 19]] - frame[rows[k]] == 190:
                    path = position[rows[k : k + 20]]
                    going = path[7] + np.outer(np.arange(1, 13), path[7] - path[6])
                    errors.append(np.hypot(*(going - path[8:]).T))
    reported = json.loads((ROOT / "reports/metrics/literature.json").read_text())[scene]["cv"]
    assert reported["windows"] == len(errors)
    assert reported["ade_m"] == pytest.approx(np.mean(errors), abs=1e-5)
    assert reported["fde_m"] == pytest.approx(np.mean(errors, axis=0)[-1], abs=1e-5)
    assert (reported["ade_m"], reported["fde_m"]) == pytest.approx(FIELD[scene], abs=6e-3)


def test_last_step_errors_of_zara_are_those_of_a_few_lines():
    """Of the half minute that is part of the project."""
    people, errors = recorded(EXCERPT).trajectories, []
    for track in np.unique(people.track_id):
        path = people.position[people.track_id == track]
        for k in range(len(path) - 19):
            going = path[k + 7] + np.outer(np.arange(1, 13), path[k + 7] - path[k + 6])
            errors.append(np.hypot(*(going - path[k + 8 : k + 20]).T))
    own = found(people)
    ours = np.linalg.norm(PRESENT_MOTION["cv"]()(own.request).point - own.truth, axis=-1)
    assert ours.shape == np.shape(errors)
    assert ours.mean() == pytest.approx(np.mean(errors), abs=1e-6) == pytest.approx(0.437, abs=5e-4)
    assert ours[:, -1].mean() == pytest.approx(1.039, abs=5e-4)


def fan(rows=3, modes=4, steps=5, seed=0):
    rng = np.random.default_rng(seed)
    path = np.cumsum(rng.normal(0.3, 0.2, (rows, modes, steps, 2)), axis=2)
    root = rng.normal(0, 0.1, (rows, modes, steps, 2, 2))
    covariance = root @ root.swapaxes(-1, -2) + 0.01 * np.eye(2)
    weight = -np.sort(-rng.dirichlet(np.ones(modes), rows), axis=1)
    return Predictions((weight[..., None, None] * path).sum(1), path, weight, 0.4, covariance)


def test_covering_paths_leave_less_uncovered_than_draws():
    forecast = fan(rows=20)
    paths, draws = covering_paths(forecast), forecast.sample(20, np.random.default_rng(1))
    truth = forecast.sample(200, np.random.default_rng(2))

    def uncovered(chosen):
        away = np.linalg.norm(chosen[:, None] - truth[:, :, None], axis=-1).mean(axis=-1)
        return away.min(axis=2).mean()

    assert uncovered(paths) < 0.9 * uncovered(draws)


def test_coverage_is_that_of_all_seeds(tmp_path, monkeypatch):
    """One network's regions hold every truth, the other's none: half, though the mean share is above 0.5."""
    monkeypatch.chdir(tmp_path)
    track, values = np.arange(4), {"ade_m": np.ones(4)}
    seeds = [
        Scores(track, values, np.ones((4, 2)), np.full((4, 2), share), np.zeros((4, 2)))
        for share in (0.1, 0.99)
    ]
    named = {STRONGEST: seeds[0], "lstm": mean_scores(seeds), "lstm_0": seeds[0], "lstm_1": seeds[1]}
    for name, each in named.items():
        write_scores(each, Path("scores", name, "one.parquet"))
    study = OmegaConf.create({"seeds": [0, 1], "scenes": {"a": ["one"]}, "networks": ["lstm"]})
    figures = figures_of(study, Path("scores"), "a", Resampling(bootstrap=10))["lstm"]
    assert [figures[f"per_step_coverage_{share}"] for share in (50, 90, 95)] == [[0.5, 0.5]] * 3


def test_the_command_measures_the_windows_of_the_pipeline():
    assert (PROTOCOL, STUDY["samples"]) == (field_protocol.WINDOWS, field_protocol.SAMPLES)


@pytest.mark.parametrize(
    "change", [{"train": ["real/biwi_eth"]}, {"train": ["real/biwi"]}, {"test": ["real/zara9"]}]
)
def test_a_fold_that_trains_on_what_it_tests_is_refused(change):
    row = {"test": ["real/biwi_eth"], "train": ["real/biwi_hotel"], **change}
    with refused(f"literature.folds.eth_ucy.eth.{next(iter(change))}"):
        PARTS["literature"](PARAMS | {"literature": STUDY | {"folds": {"eth_ucy": {"eth": row}}}})


def test_the_folds_of_the_field_test_its_scenes():
    for scene in SCENES:
        tested = STUDY["folds"]["eth_ucy"][scene]["test"]
        assert tested == [f"real/{name}" for name in STUDY["scenes"][scene]]


def test_tables_name_stricter_folds_and_average_whole_rows():
    methods = Methods.read(ROOT, PARAMS["comparison"]["reference"])
    own = {"ade_m": 0.4, "fde_m": 0.8, "best_ade_m": 0.2, "best_fde_m": 0.3}
    figures = {scene: {"cv": {"ade_m": 0.5, "fde_m": 1.0}, "mixture": own} for scene in SCENES}
    figures["zara1_without_street"] = {"mixture": own | {"ade_m": 0.9}}
    section = literature_section(results_frame({"literature": figures}), read_published(ROOT), methods)
    _, single, _ = section.blocks
    rows = {row.cells[0].text: [cell.text for cell in row.cells] for row in single.rows}
    label = methods["mixture"].label
    assert rows[label][1:3] == ["0.400", "0.800"]
    stricter = rows[f"{label}, street or campus left out"]
    assert [stricter[1], *stricter[9::2]] == [
        "0.500",
        "0.900",
        "0.400",
    ]  # ADE in the mean, at zara1 and zara2
