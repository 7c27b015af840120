"""Training rows of situations by hand: which detections, which targets, how often, and states in between."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pedpred.features import ForecastProtocol
from pedpred.rows.recorded import ViewingSettings, rows_of_viewing
from pedpred.rows.sampling import RowSampling, RowSettings, _chances, draw_tracker, sample_rows
from pedpred.rows.simulated import (
    SimulatedSet,
    resample_hermite,
    rows_of_scene,
    select_true_states,
    sense_scene,
)
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from pedpred.simulation.worlds.views import Area
from pedpred.tracking import KalmanSettings
from tests.refused import refused
from tests.simulated import SENSING

USED = KalmanSettings(0.3, 0.05, 1.5)
ROWS = RowSettings(
    seed=5,
    trackers=(USED,),
    used_share=0.25,
    learning_share=0.4,
    acceleration_noise=(0.01, 1.0),
    position_noise_m=(0.02, 0.5),
    initial_speed_mps=(0.5, 2.5),
    newborn_share=0.0,
    newborn=1,
    shifted_share=0.0,
    shift_m=0.2,
)
PROTOCOL = ForecastProtocol(dt_s=0.4, horizon_steps=2, truth_gap_s=0.6, max_age_intervals=1.25)
FREE = OccupancyMap(np.zeros((40, 40), bool), np.array([-20.0, -20.0]), 1.0)


class Plain:
    """Inputs that are what they are computed from."""

    def compute(self, seen, dt_s):
        self.asked, self.dt_s = seen, dt_s
        people = seen.observers
        here = {"time_s": seen.time_s, "who": people.track_id, "age": seen.past.age}
        return here | {"position": people.position, "beams": people.position.copy()}

    def obstacle_inputs(self, occupancy, position, heading):
        return {"beams": position}


def sampling_of(rows=ROWS, protocol=PROTOCOL):
    return RowSampling(rows, SimpleNamespace(protocol=protocol, features=Plain()), 0.2)


def scene_of(trajectories, dt_s=0.4, name="here"):
    return Scene(name, trajectories, FREE, dt_s)


def walkers(people=3, ticks=40, dt_s=0.1, speed_mps=1.0):
    """People side by side along x."""
    time_s, who = np.repeat(np.round(np.arange(ticks) * dt_s, 9), people), np.tile(np.arange(people), ticks)
    position = np.stack([speed_mps * time_s, 3.0 * who], axis=1)
    velocity = np.tile([speed_mps, 0.0], (len(who), 1))
    return Trajectories(time_s, who, position, velocity)


def true_paths():
    """Person 5 until 1.6 s and person 8 until 1.0 s, every 0.2 s; person 8 again from 1.65 s."""
    time_5, time_8 = np.arange(9) * 0.2, np.append(np.arange(6) * 0.2, [1.65, 1.85, 2.05])
    time_5[-1] -= 1e-8  # stamps are not exact
    x, y = 0.3 * np.arange(9) + 0.05 * np.arange(9) ** 2, 0.2 * np.sin(np.arange(9.0))
    position = np.concatenate([np.stack([x, y], 1), np.stack([1.0 + y, 2.0 + x], 1)])
    return Trajectories(np.concatenate([time_5, time_8]), np.repeat([5, 8], 9), position), x, y


def detections():
    """Person 5 at four instants, beside the true path; 8 at two; 9 of whom nothing is known."""
    time_s, who = np.array([0.0, 0.4, 0.8, 1.2, 0.0, 0.4, 0.0]), np.array([5, 5, 5, 5, 8, 8, 9])
    _, x, y = true_paths()
    at = np.array([0, 2, 4, 6, 0, 2, 0])
    swapped = (who == 8)[:, None]
    position = np.where(swapped, np.stack([1.0 + y[at], 2.0 + x[at]], 1), np.stack([x[at], y[at]], 1))
    velocity = [[1.0, 0.5], [0.5, 1.0], [2.0, -1.0], [1.0, 0.0], [0.0, 3.0], [-2.0, 1.0], [1.0, 1.0]]
    return Trajectories(time_s, who, position + np.array([0.1, -0.2]), np.array(velocity))


def found_rows(protocol=PROTOCOL, most=100, seed=0):
    sampling, (truth, *_) = sampling_of(protocol=protocol), true_paths()
    rows = sample_rows(scene_of(detections()), truth, None, most, sampling, np.random.default_rng(seed))
    return rows, sampling.row_format.features


def test_rows_are_detections_whose_whole_future_is_known():
    """Two steps of 0.4 s: person 5 until 1.6 - 0.8 s, person 8 until 1.0 - 0.8 s, where a gap begins."""
    rows, features = found_rows()
    assert rows["who"].tolist() == [5, 5, 5, 8]
    assert rows["time_s"].tolist() == [0.0, 0.4, 0.8, 0.0]
    assert features.dt_s == 0.4
    known, _ = found_rows(replace(PROTOCOL, truth_gap_s=0.7))
    assert known["who"].tolist() == [5, 5, 5, 8, 8]  # now it is bridged
    brief, _ = found_rows(replace(PROTOCOL, truth_gap_s=0.7, lost_after_s=0.5))
    assert brief["who"].tolist() == [5, 5, 5, 8]
    nobody = walkers(0, 0)
    nobody = sample_rows(scene_of(nobody), nobody, None, 9, sampling_of(), np.random.default_rng(0))
    assert nobody["future"].shape == (0, 2, 2)


def test_targets_lead_from_the_tracked_to_the_true_path():
    """v_1 = (true(t + dt) - tracked(t)) / dt, v_k = (true(t + k dt) - true(t + (k - 1) dt)) / dt, turned."""
    rows, _ = found_rows()
    _, x, y = true_paths()
    path, seen = np.stack([x, y], 1), detections()
    for row, (tick, velocity) in enumerate([(0, (1.0, 0.5)), (2, (0.5, 1.0)), (4, (2.0, -1.0))]):
        ahead = path[[tick + 2, tick + 4]]
        steps = np.diff([path[tick] + [0.1, -0.2], *ahead], axis=0) / 0.4
        forward = np.array(velocity) / math.hypot(*velocity)
        left = np.array([-forward[1], forward[0]])
        want = np.stack([steps @ forward, steps @ left], axis=-1)
        np.testing.assert_allclose(rows["future"][row], want, atol=1e-5)
    assert rows["future"].dtype == np.float32
    assert len(seen) == 7


def test_neighbours_are_known_after_their_last_detection():
    """1.25 intervals of 0.4 s: at 0.8 s person 8, seen at 0.4 s, is still there; 9, seen at 0 s, is not."""
    rows, features = found_rows()
    around = features.asked.around
    there = [sorted(around.track_id[first:last]) for first, last in around.span]
    assert there == [[5, 8, 9], [5, 8, 9], [5, 8], [5, 8, 9]]
    around = found_rows(replace(PROTOCOL, max_age_intervals=2.25))[1].asked.around
    assert [last - first for first, last in around.span] == [3, 3, 3, 3]
    assert rows["age"].tolist() == [0, 1, 2, 0]


def test_newborn_have_at_least_their_share():
    """One of five is newborn, and half of the rows are to be: 0.5 / 1 for it and 0.5 / 4 for others."""
    newborn = np.array([False, True, False, False, False])
    np.testing.assert_allclose(_chances(newborn, 0.5), [0.125, 0.5, 0.125, 0.125, 0.125])
    twice = np.array([True, True, False, False, False])
    np.testing.assert_allclose(_chances(twice, 0.7), [0.35, 0.35, 0.1, 0.1, 0.1])
    for same in ((newborn, 0.2), (newborn, 0.1), (newborn, 1.0), (newborn[:1], 0.5), (newborn[1:2], 0.5)):
        assert _chances(*same) is None
    assert _chances(newborn[:0], 0.5) is None


@pytest.mark.parametrize("newborn", [1, 3])
def test_newborn_are_the_first_detections(newborn):
    truth = walkers(20, 30)
    rows = replace(ROWS, newborn_share=0.6, newborn=newborn)
    sampling = sampling_of(rows, replace(PROTOCOL, dt_s=0.1, horizon_steps=1))
    found = sample_rows(scene_of(truth, 0.1), truth, None, 30, sampling, np.random.default_rng(0))
    ages = np.bincount(found["age"], minlength=29)
    assert ages[:newborn].sum() > 10
    assert ages[newborn:].sum() > 3
    assert ages[newborn:].max() < 5


def test_maps_are_shifted_along_each_axis_in_some_rows():
    truth = walkers(40, 60)
    sampling = sampling_of(replace(ROWS, shifted_share=0.3, shift_m=0.25))
    found = sample_rows(scene_of(truth, 0.1), truth, None, 9999, sampling, np.random.default_rng(0))
    shift = found["beams"] - found["position"]
    moved = (shift != 0).any(axis=1)
    assert len(moved) == 40 * 52
    assert moved.mean() == pytest.approx(0.3, abs=0.03)
    assert shift[moved].std(axis=0) == pytest.approx([0.25, 0.25], rel=0.08)
    assert shift[moved].mean(axis=0) == pytest.approx([0.0, 0.0], abs=0.04)
    assert abs(np.corrcoef(shift[moved].T)[0, 1]) < 0.15


def test_trackers_are_drawn_between_their_limits():
    """Noise log-uniform, so that 10^-1 and 10^-1 are in the middle; the speed uniform around 1.5 m/s."""
    rng = np.random.default_rng(0)
    banks = [draw_tracker(ROWS, rng) for _ in range(800)]
    own = [bank.filters[0] for bank in banks]
    assert np.mean([one == USED for one in own]) == pytest.approx(0.25, abs=0.04)
    assert np.mean([len(bank.filters) > 1 for bank in banks]) == pytest.approx(0.4, abs=0.05)
    drawn = np.array(
        [(k.acceleration_noise, k.position_noise_m, k.initial_speed_mps) for k in own if k != USED]
    )
    assert np.log10(drawn[:, :2]).mean(axis=0) == pytest.approx([-1.0, -1.0], abs=0.08)
    assert np.log10(drawn[:, :2]).std(axis=0) == pytest.approx([2 / 12**0.5, 1.398 / 12**0.5], rel=0.08)
    assert drawn[:, 2].mean() == pytest.approx(1.5, abs=0.08)
    assert drawn[:, 2].std() == pytest.approx(2 / 12**0.5, rel=0.08)


def test_true_states_are_every_third_tick_in_view():
    """Ticks of 0.1 s: 0, 0.3, ... 1.5 s at x = t; the view holds 0.25 m to 1.25 m."""
    scene = scene_of(walkers(2, 16), 0.1)
    seen = select_true_states(scene, Area(np.array([0.25, -1.0]), np.array([1.25, 4.0])), 0.3)
    states = seen.trajectories
    assert states.time_s[states.track_id == 0].tolist() == pytest.approx([0.3, 0.6, 0.9, 1.2])
    assert states.track_id.tolist() == [0, 1] * 4
    assert seen.detection_dt_s == 0.3
    low = select_true_states(scene, Area(np.array([0.25, -1.0]), np.array([1.25, 2.0])), 0.3)
    assert set(low.trajectories.track_id) == {0}


def test_states_between_recorded_ones_are_cubic():
    """At a third of the interval h: p = (20 p0 + 4 h v0 + 7 p1 - 2 h v1) / 27.

    At two thirds: p = (7 p0 + 2 h v0 + 20 p1 - 4 h v1) / 27. There v = 4 (p1 - p0) / 3 h - v0 / 3, and at a
    third 4 (p1 - p0) / 3 h - v1 / 3: cubic Hermite polynomials.
    """
    h, p0, p1, v0, v1 = 0.3, *(np.array(v) for v in [(1.0, -2.0), (1.4, -1.7), (1.1, 0.4), (1.6, 1.9)])
    time_s, who = np.array([0.6, 0.9, 0.6, 0.9, 1.2, 0.3]), np.array([4, 4, 1, 1, 1, 7])
    position = np.array([p0, p1, p1, p0, p1, p0])
    known = Trajectories(time_s, who, position, np.array([v0, v1, v1, v0, v1, v0]))
    fine = resample_hermite(scene_of(known, 0.3), 0.1)
    states = fine.trajectories
    assert fine.detection_dt_s == 0.1
    assert set(states.track_id) == {1, 4}  # nobody is between the states of somebody seen once
    mine = states.select(states.track_id == 4)
    assert mine.time_s.tolist() == [0.6, 0.7, 0.8, 0.9]
    chord = 4 * (p1 - p0) / (3 * h)
    third = (20 * p0 + 4 * h * v0 + 7 * p1 - 2 * h * v1) / 27
    later = (7 * p0 + 2 * h * v0 + 20 * p1 - 4 * h * v1) / 27
    np.testing.assert_allclose(mine.position, [p0, third, later, p1], atol=1e-12)
    np.testing.assert_allclose(mine.velocity, [v0, chord - v1 / 3, chord - v0 / 3, v1], atol=1e-12)
    other = states.select(states.track_id == 1)
    assert len(other) == 7
    np.testing.assert_allclose(other.position[::3], [p1, p0, p1], atol=1e-12)
    coarse = resample_hermite(fine, 0.3).trajectories
    np.testing.assert_allclose(coarse.select(coarse.track_id == 1).position, [p1, p0, p1], atol=1e-12)
    same = scene_of(known, 0.1)
    assert resample_hermite(same, 0.1 + 1e-10) is same


def viewing(number=0, rate_hz=2.5, scene=None, variation=ROWS, **changes):
    how = {"viewings": 3, "rows": 400, "used_share": 1.0, "thinnings": (1.0,), "thinned_noise_m": (0.0,)}
    settings = ViewingSettings(**how | {"noise_m": (0.0,)} | changes)
    sampling = sampling_of(variation, replace(PROTOCOL, dt_s=0.1, horizon_steps=1))
    found = rows_of_viewing(number, scene or scene_of(walkers(4), 0.1), rate_hz, settings, sampling)
    return found, sampling.row_format.features


@pytest.mark.parametrize(
    ("rate_hz", "thinning", "frames"),
    [(2.5, 1.0, 4), (2.5, 0.8, 3), (2.5, 1.6, 6), (5.0, 2.0, 4), (2.5, 0.1, 2), (0.0, 0.5, 1)],
)
def test_a_viewing_has_every_nth_frame_from_a_random_one_on(rate_hz, thinning, frames):
    """2.5 Hz in frames of 0.1 s: every 4th, times the factor, rounded down, but at least every 2nd."""
    begins = set()
    for number in range(12):
        found, _ = viewing(number, rate_hz, thinnings=(thinning,))
        ticks = np.unique(np.round(found["time_s"] * 10).astype(int))
        assert set(np.diff(ticks)) == {frames}
        begins.add(ticks[0])
    assert begins <= set(range(frames))
    assert len(begins) > frames / 2


@pytest.mark.parametrize(("rate_hz", "noise_m"), [(2.5, 0.3), (0.0, 0.1)])
def test_noise_of_a_viewing_depends_on_frames_left_out(rate_hz, noise_m):
    scene = scene_of(walkers(400, 12), 0.1)
    found, _ = viewing(0, rate_hz, scene, thinned_noise_m=(0.3,), noise_m=(0.1,), rows=9999)
    first = found["age"] == 0  # not yet filtered
    position = found["position"][first]
    apart = position - np.stack([found["time_s"][first], 3.0 * found["who"][first]], axis=1)
    assert len(apart) == 400
    assert apart.std(axis=0) == pytest.approx([noise_m] * 2, rel=0.1)


def test_a_viewing_has_trackers_of_its_own_share():
    """Exact trackers follow people who jump to and fro by 0.3 m; drawn ones, with 0.5 m of noise, do not."""
    exact = KalmanSettings(10.0, 1e-3)
    vague = {"position_noise_m": (0.4, 0.5), "acceleration_noise": (0.01, 0.02)}
    scene = scene_of(walkers(20), 0.1)
    states = scene.trajectories
    jump = 0.3 * (np.round(states.time_s * 10) % 2)
    states = replace(states, position=states.position + np.stack([0 * jump, jump], axis=1))
    for share in (1.0, 0.0):
        rows = replace(ROWS, trackers=(exact,), used_share=1.0 - share, learning_share=0.0, **vague)
        found, _ = viewing(0, 0.0, replace(scene, trajectories=states), rows, used_share=share)
        truth = 3.0 * found["who"] + 0.3 * (np.round(found["time_s"] * 10) % 2)
        assert (np.abs(found["position"][:, 1] - truth).max() < 0.01) == (share == 1.0)


def test_what_a_scene_is_watched_with_depends_on_its_name():
    scene = scene_of(walkers(5, 60), 0.1, "one")

    def watched(scene, seed):
        found = sense_scene(scene, "corridor", SENSING, sampling_of(replace(ROWS, seed=seed, used_share=0.0)))
        assert len(found.sensed.detections.trajectories) > 10
        drawn = found.sensed.detections.trajectories.position.tobytes(), found.kalman.filters
        return *drawn, tuple(found.view.low), found.rng.random()

    first = watched(scene, 5)
    assert watched(replace(scene, name="one"), 5) == first
    for other in (watched(scene, 6), watched(replace(scene, name="two"), 5)):
        assert all(mine != theirs for mine, theirs in zip(first, other, strict=True))


@pytest.mark.parametrize(("share", "true"), [(0.0, 0), (1.0, 7)])
def test_rows_of_true_states_follow_in_a_share_of_scenes(share, true):
    """True states are at multiples of 0.4 s and exact; a sensor looks by its own clock."""
    scene = scene_of(walkers(5, 60), 0.1)
    chosen = SimulatedSet("corridor", "", 1, 12, 7, share)
    rows = rows_of_scene(scene, chosen, SENSING, sampling_of())
    assert len(rows["who"]) == 12 + true
    exact = rows["position"][12:] - np.stack([rows["time_s"][12:], 3.0 * rows["who"][12:]], axis=1)
    np.testing.assert_allclose(exact, 0.0, atol=1e-9)
    ticks = rows["time_s"] / 0.4
    assert np.abs(ticks - np.round(ticks))[12:].max(initial=0.0) < 1e-9
    for name, value in {"kind": "tunnel", "worlds": 0, "rows": -1, "true_rows": -1}.items():
        with refused(name):
            replace(chosen, **{name: value})
