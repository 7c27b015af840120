"""Arguments: numbers of any kind are taken exactly, and nothing of what they hold is dropped silently."""

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

from pedpred.arrays import read_only, real_number, real_numbers
from pedpred.errors import ValueRuleError
from pedpred.features.surroundings import Pedestrians
from pedpred.geometry import Homography
from pedpred.online import OnlinePredictor
from pedpred.scenes import Camera, Forecast, OccupancyMap, Predictions, Scene, Trajectories


def endless(_):
    """A list that holds itself."""
    entries = []
    entries.append(entries)
    return entries


LOSING = {
    "masked": (lambda v: np.ma.masked_array(v, np.arange(v.size).reshape(v.shape) == 0), "masked"),
    "masked rows in a list": (
        lambda v: [np.ma.masked_array(row, np.ones(np.shape(row), bool)) for row in v],
        "masked",
    ),
    "complex": (lambda v: v + 1j, "imaginary"),
    "complex without an imaginary part": (lambda v: v + 0j, "imaginary"),
    "complex in lists": (lambda v: (v + 1j).tolist(), "imaginary"),
    "objects": (lambda v: v.astype(object), "objects"),
    "nothing": (lambda v: np.full(v.shape, None), "missing"),
    "digits": (lambda v: v.astype(int).astype(str), "text"),
    "bytes": (lambda v: v.astype(int).astype(bytes), "text"),
    "dates": (lambda v: v.astype("datetime64[s]"), "seconds"),
    "durations": (lambda v: v.astype("timedelta64[ms]"), "seconds"),
    "truth values": (lambda v: v != 0, "true or false"),
    "a list in itself": (endless, "numbers"),
    "a gradient": (lambda v: torch.tensor(v, dtype=torch.float64, requires_grad=True), "numbers"),
}
KEEPING = {
    "lists": lambda v: v.tolist(),
    "tuples": lambda v: tuple(map(tuple, v.tolist())) if v.ndim > 1 else tuple(v.tolist()),
    "nothing is masked": lambda v: np.ma.masked_array(v, False),
    "a matrix": lambda v: np.asmatrix(v) if v.ndim > 1 else v,
    "single precision": lambda v: v.astype(np.float32),
    "whole numbers": lambda v: v.astype(int),
    "small numbers": lambda v: v.astype(np.int8),
    "a table": lambda v: pd.DataFrame(v) if v.ndim > 1 else pd.Series(v),
    "a tensor": torch.tensor,
    "every second one": lambda v: np.repeat(v, 2, axis=0)[::2],
    "another order of bytes": lambda v: v.astype(">f8"),
}
PEOPLE = {"time_s": np.arange(3.0), "track_id": np.arange(3.0), "position": np.arange(6.0).reshape(3, 2)}
PATHS = {"point": np.zeros((2, 3, 2)), "path": np.zeros((2, 1, 3, 2)), "weight": np.ones((2, 1))}


def trajectories(**changed):
    return Trajectories(**(PEOPLE | changed))


def predictions(**changed):
    return Predictions(**(PATHS | {"dt_s": 0.3} | changed))


GROUND = OccupancyMap(np.zeros((2, 2)), [0, 0], 1.0)
FIELDS = {
    **{f"Trajectories.{name}": (trajectories, name, PEOPLE[name]) for name in PEOPLE},
    "Trajectories.goal": (trajectories, "goal", PEOPLE["position"]),
    "Trajectories.person_id": (trajectories, "person_id", PEOPLE["track_id"]),
    "OccupancyMap.origin": (lambda **own: replace(GROUND, **own), "origin", np.arange(2.0)),
    **{f"Predictions.{name}": (predictions, name, PATHS[name]) for name in PATHS},
    "Predictions.covariance": (predictions, "covariance", np.ones((2, 1, 3, 2, 2))),
    "Homography.matrix": (lambda homography: Homography(homography), "homography", np.diag([1.0, 2.0, 3.0])),
    "Camera.picture": (
        lambda picture: Camera(Homography(np.eye(3)), picture),
        "picture",
        np.arange(12.0).reshape(2, 2, 3),
    ),
    "Pedestrians.position": (
        lambda position: Pedestrians(np.arange(3), position, np.zeros(3), np.zeros((3, 2))),
        "position",
        PEOPLE["position"],
    ),
    "Forecast.velocity": (
        lambda velocity: Forecast(0.0, np.arange(2), velocity, predictions()),
        "velocity",
        np.ones((2, 3, 2)),
    ),
}  # fmt: skip


@pytest.mark.parametrize("how", LOSING)
@pytest.mark.parametrize("field", FIELDS)
def test_a_value_type_refuses_what_it_would_lose(field, how):
    make, name, value = FIELDS[field]
    change, message = LOSING[how]
    with pytest.raises(ValueRuleError, match=rf"(?s)^{name}.*({message})"):
        make(**{name: change(value)})


@pytest.mark.parametrize("how", [name for name in LOSING if name != "truth values"])
def test_a_map_refuses_cells_that_it_would_lose(how):
    change, message = LOSING[how]
    with pytest.raises(ValueRuleError, match=rf"(?s)^occupied.*({message}|free)"):
        OccupancyMap(change(np.eye(2)), [0, 0], 1.0)


@pytest.mark.parametrize("how", LOSING)
@pytest.mark.parametrize("name", ["track_id", "position", "velocity"])
def test_an_update_refuses_what_it_would_lose(name, how, mixture):
    change, message = LOSING[how]
    robot = OnlinePredictor.load(mixture[0])
    frame = {"track_id": np.arange(3), "position": PEOPLE["position"], "velocity": PEOPLE["position"]}
    with pytest.raises(ValueRuleError, match=rf"(?s)^{name}.*({message})"):
        robot.update(0.0, **(frame | {name: change(frame[name])}))
    assert len(robot.update(0.0, **frame)) == 3


@pytest.mark.parametrize("missing", [None, np.nan, pd.NA])
@pytest.mark.parametrize("kind", ["Float64", "float64", object])
@pytest.mark.parametrize("name", ["track_id", "position", "velocity"])
def test_missing_values_of_a_table_are_refused_by_name(name, kind, missing, mixture):
    table = pd.DataFrame({"id": [1, 2], "x": [0.5, 0.0], "y": [0.0, 1.0]}, dtype=object)
    columns = {"track_id": ["id"], "position": ["x", "y"], "velocity": ["x", "y"]}[name]
    table.loc[1, columns] = missing
    try:
        column = table[columns].astype(kind)
    except TypeError:  # pandas refuses it
        return
    given = {"track_id": [1, 2], "position": np.eye(2), "velocity": np.eye(2)}
    given[name] = column if name != "track_id" else column["id"]
    with pytest.raises(ValueRuleError, match=rf"(?s)^{name}"):
        OnlinePredictor.load(mixture[0]).update(0.0, **given)
    with pytest.raises(ValueRuleError, match=rf"(?s)^{name}"):
        Trajectories(np.zeros(2), **given)


@pytest.mark.filterwarnings("ignore:the matrix subclass")
@pytest.mark.parametrize("how", KEEPING)
@pytest.mark.parametrize("field", FIELDS)
def test_a_value_type_takes_numbers_of_any_kind(field, how):
    make, name, value = FIELDS[field]
    if value.ndim > 2 and how in ("a matrix", "a table"):
        return
    try:
        given = KEEPING[how](value)
    except TypeError:
        return
    kept = getattr(make(**{name: given}), "matrix" if name == "homography" else name)
    assert type(kept) is np.ndarray
    np.testing.assert_array_equal(kept, value)


@pytest.mark.parametrize("value", [np.ma.masked, 1 + 0j, "2", b"2", None, True, np.True_, [1.0], [], 10**400,
                                   np.datetime64(1, "s"), np.timedelta64(1, "s"), object()])  # fmt: skip
def test_one_number_is_one_number(value):
    with pytest.raises(ValueRuleError, match=r"(?s)x = .*one number"):
        real_number("x", value)
    for make in (
        lambda: OccupancyMap([[0]], [0, 0], value),
        lambda: predictions(dt_s=value),
        lambda: Scene("place", trajectories(), GROUND, value),
    ):
        with pytest.raises(ValueRuleError, match="one number"):
            make()


@given(st.integers(-(2**63), 2**64 - 1) | st.floats(width=64))
def test_a_number_is_exact_whatever_holds_it(value):
    for given_ in (value, np.array(value), np.asarray(value)[()]):
        assert real_number("x", given_) == pytest.approx(float(value), nan_ok=True, rel=0, abs=0)
    kept = real_numbers("x", [value])
    assert kept[0] == value or value != value


# Maps are their own


@given(arrays(bool, st.tuples(st.integers(1, 5), st.integers(1, 5))), st.data())
def test_whatever_is_written_into_a_buffer_a_map_stays(cells, data):
    kind = data.draw(st.sampled_from([bool, np.uint8, np.int64, float]))
    buffer, origin = np.zeros((12, 12), kind), np.zeros(4)
    step = data.draw(st.sampled_from([-2, -1, 1, 2]))
    view = buffer[:: abs(step)][: cells.shape[0], : cells.shape[1]][:: 1 if step > 0 else -1]
    view[:], origin[1:3] = cells, (3.0, 4.0)
    how = data.draw(st.sampled_from(["itself", "read-only", "a view of a read-only one", "a memory view"]))
    if how != "itself":
        view = view[:]
        view.flags.writeable = False
    if how == "a view of a read-only one":
        view = view[:]
    if how == "a memory view":
        view = np.asarray(memoryview(view))
    ground = OccupancyMap(view, origin[1:3], 0.1)
    buffer[:], origin[:] = ~buffer.astype(bool), np.nan
    np.testing.assert_array_equal(ground.occupied, cells)
    assert ground.origin.tolist() == [3.0, 4.0]


def unpickled(ground):
    """As another process sends it."""
    return pickle.loads(pickle.dumps(ground))  # noqa: S301 (of our own making)


@pytest.mark.parametrize(
    "again", [copy.copy, copy.deepcopy, unpickled, lambda ground: replace(ground, resolution_m=0.2)]
)
def test_nobody_can_write_into_a_map(again):
    ground = again(OccupancyMap(np.eye(2, dtype=bool), np.zeros(2), 0.1))
    for values in (ground.occupied, ground.origin):
        with pytest.raises(ValueError, match="read-only"):
            values[:] = 1


def test_what_never_changes_is_not_copied():
    cells = np.eye(3, dtype=bool)
    cells.flags.writeable = False
    ground = OccupancyMap(cells, np.zeros(2), 0.1)
    assert ground.occupied is cells
    assert replace(ground, resolution_m=0.2).occupied is cells
    raw = np.frombuffer(bytes(4), np.uint8)
    assert read_only(raw, np.uint8) is raw


def test_a_map_that_is_changed_after_it_was_set_changes_nothing(mixture):
    robot, other = OnlinePredictor.load(mixture[0]), OnlinePredictor.load(mixture[0])
    cells, origin = np.zeros((80, 80), bool), np.array([-4.0, -4.0])
    cells[45:47] = True
    robot.set_map(OccupancyMap(cells, origin, 0.1))
    other.set_map(OccupancyMap(cells.copy(), origin.copy(), 0.1))
    cells[:], origin[:] = False, 50.0
    for k in range(8):
        seen = 0.2 * k, [1], [[-1.0 + 0.2 * k, 0.0]]
        one, two = robot.update(*seen), other.update(*seen)
        np.testing.assert_array_equal(one.predictions.path, two.predictions.path)


@pytest.mark.parametrize("name", ["model", "mixture"])
def test_what_is_returned_is_nobody_elses_even_where_it_is_made_writable(name, request):
    """A deliberate writer spoils the own answer alone."""
    folder = request.getfixturevalue(name)[0]
    robot, other = OnlinePredictor.load(folder), OnlinePredictor.load(folder)
    for k in range(20):
        seen = 0.2 * k, [1, 2], [[0.2 * k, 0.0], [3.0, 0.1 * k]]
        one, two = robot.update(*seen), other.update(*seen)
        np.testing.assert_array_equal(one.track_id, two.track_id)
        np.testing.assert_array_equal(one.velocity, two.velocity)
        for name_, values in one.predictions.arrays().items():
            np.testing.assert_array_equal(values, getattr(two.predictions, name_))
        for values in (one.track_id, one.velocity, *one.predictions.arrays().values()):
            while values is not None:
                if values.flags.owndata:
                    values.flags.writeable = True
                    values.reshape(-1)[:] = 7
                values = values.base
