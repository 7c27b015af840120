"""Features: no input depends on the future, and few detections have features."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pedpred.scenes import Scene, Trajectories
from pedpred.simulation.sensor import SensorSettings, apply_sensor
from pedpred.tracking import KalmanSettings, follow
from pedpred.tracking.tracks import TIME_TOLERANCE_S
from tests.exported import LSTM_ROWS
from tests.worlds import empty_map, extract, walled_scene

PROTOCOL, FEATURES = LSTM_ROWS.protocol, LSTM_ROWS.features
KALMAN = KalmanSettings(acceleration_noise=0.3, position_noise_m=0.1)
SOURCES = {
    "annotations": dict(kind="kalman", kalman=KALMAN, dt_s=0.4, phase_offsets=3, truth=False),
    "simulation": dict(kind="truth", kalman=None, dt_s=0.3, phase_offsets=1, truth=True),
    "sensor": dict(kind="kalman", kalman=KALMAN, dt_s=0.1, phase_offsets=1, truth=False, detections=60),
}
SENSOR = SensorSettings(
    rate_hz=5.0, position_noise_m=0.1, quantum_m=0.02, drop_out_share=0.1, switch_share=0.2
)
MOTION = ("position", "heading_rad", "velocity", "last_position", "last_velocity", "last_acceleration")
INPUTS = (*MOTION, "occupancy", "angular_grid")


def table_of(scene, source, truth=None):
    tracks = follow(scene.trajectories, source["kind"], source["kalman"], 0.2)
    return extract(scene, tracks, PROTOCOL, FEATURES, truth=truth, phase_offsets=source["phase_offsets"])


def column(table, name):
    """A column or an input."""
    return {**table.columns, **table.inputs}[name]


def otherwise_later(scene, now, rng):
    """The scene with detections after `now` moved, dropped and added."""
    trajectories = scene.trajectories
    later = trajectories.time_s > now + TIME_TOLERANCE_S
    moved = {"position": trajectories.position + later[:, None] * rng.normal(0, 3, (len(later), 2))}
    if trajectories.velocity is not None:
        moved["velocity"] = trajectories.velocity + later[:, None] * rng.normal(0, 3, (len(later), 2))
    changed = dataclasses.replace(trajectories, **moved).select(~later | (rng.random(len(later)) < 0.7))
    new = changed.select(changed.time_s > now + TIME_TOLERANCE_S)
    new = dataclasses.replace(new, track_id=new.track_id + 100, position=new.position + 1.0)
    columns = {f.name: (getattr(changed, f.name), getattr(new, f.name)) for f in dataclasses.fields(new)}
    both = {name: np.concatenate(pair) for name, pair in columns.items() if pair[0] is not None}
    return dataclasses.replace(scene, trajectories=Trajectories(**both))


def inputs_until(before, after, now):
    """Rows of the same (track, clock, step) up to `now` in both tables; nobody's may be missing."""
    old, new = (
        {(t.track_id[r], t.phase[r], t.step[r]): r for r in np.flatnonzero(t.time_s <= now)}
        for t in (before, after)
    )
    common = sorted(old.keys() & new.keys())
    # A track that ends earlier has fewer steps, but none before its last detection may be missing.
    assert len(common) >= len(new) > 0
    return [old[k] for k in common], [new[k] for k in common]


def assert_same_inputs(before, after, now):
    a, b = inputs_until(before, after, now)
    for name in INPUTS:
        np.testing.assert_array_equal(column(before, name)[a], column(after, name)[b], err_msg=name)


@pytest.mark.parametrize("name", SOURCES)
@settings(max_examples=25)
@given(seed=st.integers(0, 2**32 - 1), now=st.floats(3.0, 12.0))
def test_no_input_depends_on_a_later_detection(name, seed, now):
    """Move, drop and add anything after `now`: all inputs up to then stay bit-identical."""
    source, rng = SOURCES[name], np.random.default_rng(seed)
    scene = walled_scene(rng, source["dt_s"], source["truth"], detections=source.get("detections", 40))
    if name == "sensor":
        scene, now = apply_sensor(scene, SENSOR, rng), now / 3
    before, after = table_of(scene, source), table_of(otherwise_later(scene, now, rng), source)
    assert_same_inputs(before, after, now)


def test_one_detection_and_an_empty_recording_have_features():
    lonely = Trajectories(np.array([1.0]), np.array([7]), np.array([[50.0, 50.0]]))  # and outside the map
    table = table_of(Scene("one", lonely, empty_map(), 0.4), SOURCES["annotations"])
    assert len(table) == 1
    assert not column(table, "occupancy").any()
    assert table.future_steps.tolist() == [0]
    nothing = Trajectories(np.zeros(0), np.zeros(0), np.zeros((0, 2)))
    assert len(table_of(Scene("none", nothing, empty_map(), 0.4), SOURCES["annotations"])) == 0
