"""Arguments: numbers of any kind are taken exactly; masks, dates, text and the like are refused by name."""

import copy
import pickle
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pedpred.arrays import real_number, real_numbers
from pedpred.features.surroundings import Pedestrians
from pedpred.geometry import Homography
from pedpred.online import OnlinePredictor
from pedpred.scenes import Camera, Forecast, OccupancyMap, Predictions, Scene, Trajectories
from tests.refused import refused

REFUSED = {
    "masked": lambda v: np.ma.masked_array(v, np.arange(v.size).reshape(v.shape) == 0),
    "complex": lambda v: v + 1j,
    "None": lambda v: np.full(v.shape, None),
    "text": lambda v: v.astype(int).astype(str),
    "dates": lambda v: v.astype("datetime64[s]"),
    "truth values": lambda v: v != 0,
    "a gradient": lambda v: torch.tensor(v, dtype=torch.float64, requires_grad=True),
}
TAKEN = {
    "nothing is masked": lambda v: np.ma.masked_array(v, False),
    "single precision": lambda v: v.astype(np.float32),
    "a tensor": torch.tensor,
    "every second one": lambda v: np.repeat(v, 2, axis=0)[::2],
}
PEOPLE = {"time_s": np.arange(3.0), "track_id": np.arange(3.0), "position": np.arange(6.0).reshape(3, 2)}
PATHS = {"point": np.zeros((2, 3, 2)), "path": np.zeros((2, 1, 3, 2)), "weight": np.ones((2, 1))}
GROUND = OccupancyMap(np.zeros((2, 2)), [0, 0], 1.0)


def trajectories(**changed):
    return Trajectories(**(PEOPLE | changed))


def predictions(**changed):
    return Predictions(**(PATHS | {"dt_s": 0.3} | changed))


FIELDS = [  # maker, field, value
    (trajectories, "track_id", PEOPLE["track_id"]),
    (trajectories, "goal", PEOPLE["position"]),
    (lambda **own: replace(GROUND, **own), "origin", np.arange(2.0)),
    (predictions, "path", PATHS["path"]),
    (predictions, "covariance", np.ones((2, 1, 3, 2, 2))),
    (lambda homography: Homography(homography), "homography", np.diag([1.0, 2.0, 3.0])),
    (lambda picture: Camera(Homography(np.eye(3)), picture), "picture", np.arange(12.0).reshape(2, 2, 3)),
    (
        lambda position: Pedestrians(np.arange(3), position, np.zeros(3), np.zeros((3, 2))),
        "position",
        PEOPLE["position"],
    ),
    (lambda velocity: Forecast(0.0, np.arange(2), velocity, predictions()), "velocity", np.ones((2, 3, 2))),
]


@pytest.mark.parametrize("kind", REFUSED)
def test_a_value_type_refuses_what_is_no_real_number(kind):
    for make, name, value in FIELDS:
        with refused(name):
            make(**{name: REFUSED[kind](value)})


@pytest.mark.parametrize("kind", [kind for kind in REFUSED if kind != "truth values"])
def test_a_map_refuses_cells_that_are_no_real_numbers(kind):
    with refused("occupied"):
        OccupancyMap(REFUSED[kind](np.eye(2)), [0, 0], 1.0)


@pytest.mark.parametrize("name", ["track_id", "position", "velocity"])
def test_an_update_refuses_what_is_no_real_number(name, mixture):
    robot = OnlinePredictor.load(mixture[0])
    frame = {"track_id": np.arange(3), "position": PEOPLE["position"], "velocity": PEOPLE["position"]}
    for wrong in REFUSED.values():
        with refused(name):
            robot.update(0.0, **(frame | {name: wrong(frame[name])}))
    assert len(robot.update(0.0, **frame)) == 3


@pytest.mark.parametrize("kind", ["Float64", object])
def test_missing_values_of_a_table_are_refused_by_name(kind, mixture):
    column = pd.DataFrame({"x": [0.5, pd.NA], "y": [0.0, pd.NA]}, dtype=object).astype(kind)
    arguments = {"track_id": [1, 2], "position": column, "velocity": np.eye(2)}
    with refused("position"):
        OnlinePredictor.load(mixture[0]).update(0.0, **arguments)
    with refused("position"):
        Trajectories(np.zeros(2), **arguments)


@pytest.mark.parametrize("kind", TAKEN)
def test_a_value_type_takes_numbers_of_any_kind(kind):
    for make, name, value in FIELDS:
        taken = getattr(make(**{name: TAKEN[kind](value)}), "matrix" if name == "homography" else name)
        assert type(taken) is np.ndarray
        np.testing.assert_array_equal(taken, value)


@pytest.mark.parametrize("value", [np.ma.masked, 1 + 0j, "2", None, True, [1.0], 10**400])
def test_one_number_is_one_real_number(value):
    for field, make in {
        "resolution_m": lambda: OccupancyMap([[0]], [0, 0], value),
        "dt_s": lambda: predictions(dt_s=value),
        "detection_dt_s": lambda: Scene("place", trajectories(), GROUND, value),
    }.items():
        with refused(field):
            make()


@given(st.integers(-(2**63), 2**64 - 1) | st.floats(width=64))
def test_a_number_is_taken_exactly(value):
    for argument in (value, np.array(value), np.asarray(value)[()]):
        assert real_number("x", argument) == pytest.approx(float(value), nan_ok=True, rel=0, abs=0)
    taken = real_numbers("x", [value])
    assert taken[0] == value or value != value


# Values that are never changed by their caller


@given(arrays(bool, st.tuples(st.integers(1, 5), st.integers(1, 5))), st.data())
def test_a_map_does_not_change_with_the_buffer_it_is_made_of(cells, data):
    kind = data.draw(st.sampled_from([bool, np.uint8, np.int64, float]))
    buffer, origin = np.zeros((12, 12), kind), np.zeros(4)
    step = data.draw(st.sampled_from([-2, -1, 1, 2]))
    view = buffer[:: abs(step)][: cells.shape[0], : cells.shape[1]][:: 1 if step > 0 else -1]
    view[:], origin[1:3] = cells, (3.0, 4.0)
    if data.draw(st.booleans()):
        view = view[:]
        view.flags.writeable = False
    ground = OccupancyMap(view, origin[1:3], 0.1)
    buffer[:], origin[:] = ~buffer.astype(bool), np.nan
    np.testing.assert_array_equal(ground.occupied, cells)
    assert ground.origin.tolist() == [3.0, 4.0]


def unpickled(ground):
    return pickle.loads(pickle.dumps(ground))  # noqa: S301 (of our own making)


@pytest.mark.parametrize("again", [copy.copy, copy.deepcopy, unpickled])
def test_the_arrays_of_a_map_cannot_be_written(again):
    ground = again(OccupancyMap(np.eye(2, dtype=bool), np.zeros(2), 0.1))
    for values in (ground.occupied, ground.origin):
        with pytest.raises(ValueError, match="read-only"):
            values[:] = 1


@pytest.mark.parametrize("name", ["model", "mixture"])
def test_writing_into_an_answer_changes_no_later_answer(name, request):
    """Even where the caller makes its arrays writable."""
    folder = request.getfixturevalue(name)[0]
    robot, other = OnlinePredictor.load(folder), OnlinePredictor.load(folder)
    for k in range(12):
        seen = 0.2 * k, [1, 2], [[0.2 * k, 0.0], [3.0, 0.1 * k]]
        one, two = robot.update(*seen), other.update(*seen)
        np.testing.assert_array_equal(one.track_id, two.track_id)
        np.testing.assert_array_equal(one.velocity, two.velocity)
        for field, values in one.predictions.arrays().items():
            np.testing.assert_array_equal(values, getattr(two.predictions, field))
        for values in (one.track_id, one.velocity, *one.predictions.arrays().values()):
            while values is not None:
                if values.flags.owndata:
                    values.flags.writeable = True
                    values.reshape(-1)[:] = 7
                values = values.base
