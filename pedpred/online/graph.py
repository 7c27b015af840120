"""Graphs of exported networks, which may come from strangers: what is checked before a robot runs one.

A graph that passes is a fixed sequence of standard operators: it has no loop, branch, function or foreign
code. No run takes more memory than `MOST_MEMORY_BYTES`. How long one operator takes is not bounded.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Mapping, MutableMapping, Sequence
from functools import cache
from threading import Timer
from weakref import WeakValueDictionary

import numpy as np
import onnxruntime
from onnxruntime import InferenceSession

from pedpred.errors import brief

Shape = tuple[int, ...]

MOST_MEMORY_BYTES = 2**31
"""Limit of what all networks of a process hold at once: inputs, weights and everything between."""

MOST_NODES = 20_000
_LONGEST_TRIAL_S = 20.0
_PEOPLE = 2
_EXTERNAL = "session.model_external_initializers_file_folder_path"
_VARINT, _EIGHT, _BYTES, _FOUR = 0, 1, 2, 5
_STANDARD = (b"", b"ai.onnx")
# numbers of fields in onnx.proto
_GRAPH, _TRAINING, _FUNCTIONS = 7, 20, 25
_NODE, _SPARSE = 1, 15
_OPERATOR, _ATTRIBUTE, _DOMAIN = 4, 5, 7
_SUBGRAPHS = (6, 11)

_LOADED: MutableMapping[str, InferenceSession] = WeakValueDictionary()
"""The graphs in use, by content and ends."""


def load_graph(raw: bytes, inputs: Mapping[str, Shape], outputs: Sequence[Shape]) -> InferenceSession:
    """Load a graph that has been checked and tried, or share one that is in use; one thread.

    Args:
        raw: the graph.
        inputs: name -> shape per person that it must have.
        outputs: shapes per person that it must have, in order.

    Raises:
        ValueError: it is not a fixed sequence of standard operators, or has other inputs or outputs.
        Exception: it is damaged, or takes too much memory or time for two people; onnxruntime documents none.
    """
    known = f"{hashlib.sha256(raw).hexdigest()} {inputs} {outputs}"
    session = _LOADED.get(known)
    if session is None:
        session = _LOADED[known] = _tried(raw, inputs, outputs)
    return session


def _tried(raw: bytes, inputs: Mapping[str, Shape], outputs: Sequence[Shape]) -> InferenceSession:
    check_operators(raw)
    tried = _session(raw, onnxruntime.GraphOptimizationLevel.ORT_DISABLE_ALL)
    ends = {end.name: tuple(end.shape[1:]) for end in tried.get_inputs()}
    sizes = [tuple(end.shape[1:]) for end in tried.get_outputs()]
    if (ends, sizes) != (inputs, outputs):
        raise ValueError(f"it has {brief(ends)} -> {brief(sizes)}, expected {inputs} -> {outputs}")
    _try(tried, inputs)
    return _session(raw, onnxruntime.GraphOptimizationLevel.ORT_ENABLE_ALL)


def _session(raw: bytes, level: onnxruntime.GraphOptimizationLevel) -> InferenceSession:
    _bound_memory()
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.graph_optimization_level = level
    options.log_severity_level = 4  # what is wrong is in the error
    options.add_session_config_entry("session.use_env_allocators", "1")
    options.add_session_config_entry(_EXTERNAL, os.devnull)  # no weights beside the graph are read
    return onnxruntime.InferenceSession(raw, options, providers=["CPUExecutionProvider"])


@cache
def _bound_memory() -> None:
    """Give the sessions of this process one allocator, which has a limit."""
    place = onnxruntime.OrtMemoryInfo(
        "Cpu", onnxruntime.OrtAllocatorType.ORT_ARENA_ALLOCATOR, 0, onnxruntime.OrtMemType.DEFAULT
    )
    limit = onnxruntime.OrtArenaCfg({"max_mem": MOST_MEMORY_BYTES})
    onnxruntime.create_and_register_allocator(place, limit)


def _try(session: InferenceSession, inputs: Mapping[str, Shape]) -> None:
    """Run a graph once for some people, all zeros, with an end."""
    options = onnxruntime.RunOptions()
    zeros = {name: np.zeros((_PEOPLE, *shape), np.float32) for name, shape in inputs.items()}
    clock = Timer(_LONGEST_TRIAL_S, setattr, (options, "terminate", True))
    clock.daemon = True
    clock.start()
    try:
        session.run(None, zeros, options)
    finally:
        clock.cancel()


def check_operators(raw: bytes) -> None:
    """Check that a serialised graph is a sequence of standard operators.

    Loops, branches and scans are operators that hold a graph; functions could call each other in numbers that
    grow without bound.

    Raises:
        ValueError: it is not, or no such bytes.
    """
    nodes = 0
    for number, part in _fields(raw):
        if number in (_TRAINING, _FUNCTIONS):
            raise ValueError("it defines functions or a training")
        if number == _GRAPH:
            for inner, entry in _fields(part):
                if inner == _SPARSE:
                    raise ValueError("it has sparse weights")
                if inner == _NODE:
                    nodes += 1
                    _check_node(entry)
    if nodes > MOST_NODES:
        raise ValueError(f"it has {nodes} operators, at most {MOST_NODES} are allowed")


def _check_node(raw: bytes) -> None:
    fields = list(_fields(raw))
    name = b" ".join(part for number, part in fields if number == _OPERATOR).decode(errors="replace")
    for number, part in fields:
        if number == _DOMAIN and part not in _STANDARD:
            raise ValueError(f"operator {name[:80]!r} is none of the ONNX standard")
        if number == _ATTRIBUTE and any(inner in _SUBGRAPHS for inner, _ in _fields(part)):
            raise ValueError(f"operator {name[:80]!r} holds a graph of its own, a loop or a branch")


def _fields(raw: bytes) -> Iterator[tuple[int, bytes]]:
    """Number and content of each field of a Protocol Buffers message; numbers have no content.

    Raises:
        ValueError: it is not such a message.
    """
    at = 0
    while at < len(raw):
        key, at = _varint(raw, at)
        kind, size = key & 7, 0
        if kind == _VARINT:
            _, at = _varint(raw, at)
        elif kind == _BYTES:
            size, at = _varint(raw, at)
        elif kind in (_EIGHT, _FOUR):
            size = 8 if kind == _EIGHT else 4
        else:
            raise ValueError("no Protocol Buffers message")
        if at + size > len(raw):
            raise ValueError("a Protocol Buffers message that is cut")
        yield key >> 3, raw[at : at + size] if kind == _BYTES else b""
        at += size


def _varint(raw: bytes, at: int) -> tuple[int, int]:
    """A number in base 128, the lowest digit first, and where it ends."""
    value = 0
    for place in range(10):
        if at + place >= len(raw):
            break
        digit = raw[at + place]
        value |= (digit & 127) << (7 * place)
        if digit < 128:
            return value, at + place + 1
    raise ValueError("a Protocol Buffers message that is cut")
