"""Model folders of others: right checksums, and a graph that would not end or fills the memory."""

import resource
import threading
from contextlib import contextmanager

import numpy as np
import onnx
import onnx.helper as make
import pytest
from onnx import TensorProto

from pedpred.errors import InputError
from pedpred.online import OnlinePredictor, graph
from pedpred.online.network import read_description, write_description

WHOLE = TensorProto.INT64
FLOAT = TensorProto.FLOAT


def numbers(name, *values):
    return make.make_tensor(name, WHOLE, [len(values)], values)


def scalar(name, kind, value):
    return make.make_tensor(name, kind, [], [value])


def loop():
    """A loop of a thousand million rounds, each of which adds 1 to a number."""
    flag = TensorProto.BOOL
    kinds = {"i": WHOLE, "go": flag, "v": FLOAT, "go_on": flag, "w": FLOAT}
    ends = [make.make_tensor_value_info(name, kind, []) for name, kind in kinds.items()]
    nodes = [make.make_node("Identity", ["go"], ["go_on"]), make.make_node("Add", ["v", "one"], ["w"])]
    body = make.make_graph(nodes, "body", ends[:3], ends[3:], [scalar("one", FLOAT, 1.0)])
    return [make.make_node("Loop", ["rounds", "yes", "zero"], ["extra"], body=body)]


def squares(count, side):
    """Products of large matrices, one after the other."""
    first = make.make_node("ConstantOfShape", ["shape"], ["m0"])
    products = [make.make_node("MatMul", [f"m{i}", f"m{i}"], [f"m{i + 1}"]) for i in range(count)]
    return [first, *products], [numbers("shape", side, side)]


def outer(times):
    """The number of people to a power, as many numbers."""
    size = make.make_node("Shape", ["state"], ["size"], start=0, end=1)
    product = make.make_node("Concat", ["size"] * times, ["all"], axis=0)
    return [size, product, make.make_node("ConstantOfShape", ["all"], ["extra"])]


def one(operator, *inputs, **attributes):
    return [make.make_node(operator, inputs, ["extra"], **attributes)]


LOOPS = [scalar("rounds", WHOLE, 10**9), scalar("yes", TensorProto.BOOL, True), scalar("zero", FLOAT, 0.0)]
ENDS = [scalar("zero", WHOLE, 0), scalar("end", WHOLE, 10**10), scalar("step", WHOLE, 1)]
ABSENT = TensorProto(dims=[10**9], data_type=FLOAT, name="w")
MANY = [make.make_node("Identity", ["state"], [f"x{i}"]) for i in range(graph.MOST_NODES)]
STRANGE = {
    "a loop": (loop(), LOOPS),
    "foreign operators": (one("Add", "s", "s", domain="com.microsoft"), []),
    "a huge constant": (one("ConstantOfShape", "shape"), [numbers("shape", 10**10)]),
    "a huge expansion": (one("Expand", "state", "shape"), [numbers("shape", 10**6, 10**4, 1, 1)]),
    "a huge range": (one("Range", "zero", "end", "step"), ENDS),
    "weights that are not there": (one("ReduceSum", "w"), [ABSENT]),
    "more people, more memory": (outer(34), []),
    "too many operators": (MANY, []),
}


def strange(source, target, nodes, weights, functions=()):
    """Write a model folder with right checksums whose graph has further nodes."""
    network = onnx.load(source[0] / "network.onnx")
    network.graph.node.extend(nodes)
    network.graph.initializer.extend(weights)
    network.functions.extend(functions)
    (target / "network.onnx").write_bytes(network.SerializeToString())
    write_description(target, read_description(source[0]), {})


@pytest.fixture
def little_memory():
    """Let the process grow by the memory that graphs may take, and some."""
    before = resource.getrlimit(resource.RLIMIT_AS)
    with open("/proc/self/statm") as file:
        now = int(file.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (now + graph.MOST_MEMORY_BYTES + 2**29, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_AS, before)


@contextmanager
def in_the_graph():
    """Expect an error that names the graph."""
    with pytest.raises(InputError) as error:
        yield
    assert (error.value.path.name, error.value.where) == ("network.onnx", "graph")


@pytest.mark.parametrize("kind", STRANGE)
def test_a_graph_that_fills_memory_or_never_ends_is_refused(kind, model, tmp_path, little_memory):
    strange(model, tmp_path, *STRANGE[kind])
    with in_the_graph():
        OnlinePredictor.load(tmp_path)


def test_functions_that_call_each_other_are_refused(model, tmp_path):
    sets = [make.make_opsetid("", 17), make.make_opsetid("own", 1)]
    ten = [make.make_node("f0", ["x"], ["y"], domain="own")] * 10
    functions = [make.make_function("own", "f1", ["x"], ["y"], ten, sets)]
    strange(model, tmp_path, [], [], functions)
    with in_the_graph():
        OnlinePredictor.load(tmp_path)


def test_a_graph_that_takes_long_is_stopped(model, tmp_path, monkeypatch):
    """It would take minutes."""
    monkeypatch.setattr(graph, "_LONGEST_TRIAL_S", 0.2)
    strange(model, tmp_path, *squares(3000, 800))
    with in_the_graph():
        OnlinePredictor.load(tmp_path)
    assert not [thread for thread in threading.enumerate() if isinstance(thread, threading.Timer)]


def test_memory_that_grows_with_people_has_a_bound(model, tmp_path, little_memory):
    """Two people pass the trial; the update that would take too much says so, the next one works."""
    strange(model, tmp_path, outer(5), [])
    robot = OnlinePredictor.load(tmp_path)
    people = np.random.default_rng(0).uniform(-20.0, 20.0, (300, 2))
    assert len(robot.update(0.0, range(3), people[:3]).track_id) == 3
    with in_the_graph():
        robot.update(0.3, range(300), people)
    assert len(robot.update(0.6, range(3), people[:3]).track_id) >= 3
