"""A trained network as one self-contained ONNX graph: inputs of a frame and memory in, both out.

The graph is written by hand, node by node, so that it holds the network and nothing else (an exporter adds
traces of the machine it ran on), and is the same bytes each time.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper
from onnxruntime.quantization import quantize_dynamic
from torch import Tensor, nn

from pedpred.files import atomic_write
from pedpred.networks.autoencoder import GridEncoder
from pedpred.networks.gaussian import FLOOR_M, GaussianHead
from pedpred.networks.lstm import INPUT_WIDTHS, LEAK, MotionLstm

_OPSET, _IR = 17, 9


class _Graph:
    """Nodes and constants in the order in which they are added."""

    def __init__(self) -> None:
        self.nodes: list[onnx.NodeProto] = []
        self.constants: list[onnx.TensorProto] = []

    def constant(self, name: str, value: np.ndarray) -> str:
        self.constants.append(numpy_helper.from_array(np.ascontiguousarray(value), name))
        return name

    def add(self, kind: str, inputs: list[str], output: str, **attributes: Any) -> str:
        self.nodes.append(helper.make_node(kind, inputs, [output], **attributes))
        return output

    def linear(self, name: str, layer: nn.Module, value: str) -> str:
        weights = [self.constant(f"{name}.{k}", _numbers(v)) for k, v in layer.named_parameters()]
        return self.add("Gemm", [value, *weights], f"{name}_linear", transB=1)

    def lstm(self, name: str, layer: nn.Module, value: str) -> str:
        """One step; ONNX orders the gates (in, out, forget, cell), torch (in, forget, cell, out)."""

        def gates(parameter: str) -> np.ndarray:
            i, f, g, o = np.split(_numbers(getattr(layer, parameter)), 4)
            return np.concatenate([i, o, f, g])[None]

        bias = np.concatenate([gates("bias_ih_l0"), gates("bias_hh_l0")], axis=1)
        weights = {"W": gates("weight_ih_l0"), "R": gates("weight_hh_l0"), "B": bias}
        names = [self.constant(f"{name}.{k}", v) for k, v in weights.items()]
        x, h, c = (
            self.add("Unsqueeze", [v, "axis0"], f"{v}_1") for v in (value, f"{name}_hidden", f"{name}_cell")
        )
        after = [f"{name}_hidden_1_next", f"{name}_cell_1_next"]
        node = helper.make_node("LSTM", [x, *names, "", h, c], ["", *after], hidden_size=layer.hidden_size)
        self.nodes.append(node)
        self.add("Squeeze", [after[1], "axis0"], f"{name}_cell_next")
        return self.add("Squeeze", [after[0], "axis0"], f"{name}_hidden_next")

    def covariance(self, head: GaussianHead, memory: str, steps: int) -> str:
        """`covariance_of` what the head makes of a memory, m^2, [people, steps, 2, 2]."""
        shape = self.constant("spread_shape", np.array([-1, steps, 3]))
        raw = self.add("Reshape", [self.linear("spread", head.out, memory), shape], "raw_spread")
        self.nodes.append(helper.make_node("Split", [raw], ["raw_a", "raw_c", "k"], axis=2))
        floor = self.constant("floor_m", np.array(FLOOR_M, dtype=np.float32))
        a, c = (self.add("Add", [self.add("Softplus", [f"raw_{n}"], f"soft_{n}"), floor], n) for n in "ac")
        forward, rest = self.add("Mul", [a, a], "a_a"), self.add("Mul", [c, c], "c_c")
        shared = self.add("Mul", ["k", forward], "k_a_a")
        left = self.add("Add", [self.add("Mul", ["k", shared], "k_k_a_a"), rest], "left")
        entries = self.add("Concat", [forward, shared, shared, left], "entries", axis=2)
        square = self.constant("square", np.array([-1, steps, 2, 2]))
        return self.add("Reshape", [entries, square], "covariance")

    def embedding(self, encoder: GridEncoder) -> str:
        """The frozen convolutions of `crop`."""
        value = self.add("Unsqueeze", ["crop", "axis1"], "image")
        for name in ("conv1", "conv2", "conv3"):
            layer = getattr(encoder, name)
            weights = [self.constant(f"{name}.{k}", _numbers(v)) for k, v in layer.named_parameters()]
            pads = [*layer.padding, *layer.padding]
            value = self.add("Conv", [value, *weights], f"{name}_out", strides=layer.stride, pads=pads)
            value = self.add("Relu", [value], f"{name}_relu")
        return self.add("Flatten", [value], "grid")


def export_onnx(network: MotionLstm, encoder: GridEncoder, cells: int, path: Path) -> dict[str, Any]:
    """Write the graph of one step of N people: state [N, 2], crop [N, cells, cells], angular [N, K].

    Args:
        network: trained; its channels decide which inputs the graph has.
        encoder: of the auto-encoder that the network's codes come from.
        cells: per side of the occupancy crop.
        path: the file to write.

    Returns:
        "inputs": their names in order; "memory": names in order and units; "spread": whether the graph tells
        the covariance of positions.
    """
    graph, settings = _Graph(), network.settings
    graph.constant("axis0", np.array([0]))
    graph.constant("axis1", np.array([1]))
    shapes: dict[str, list[int]] = {}
    hidden = []
    for name, lstm in network.lstms.items():
        grid = name == "grid"
        shapes["crop" if grid else name] = [cells, cells] if grid else [INPUT_WIDTHS[name]]
        value = graph.embedding(encoder) if grid else name
        value = graph.linear(f"{name}_projection", network.projections[name], value)
        value = graph.add("LeakyRelu", [value], f"{name}_projected", alpha=LEAK)
        hidden.append(graph.lstm(name, lstm, value))
    fused = graph.lstm("joint", network.joint, graph.add("Concat", hidden, "channels", axis=1))
    head = graph.add("Relu", [graph.linear("head", network.head, fused)], "head_relu")
    flat = graph.linear("out", network.out, head)
    shape = graph.constant("horizon", np.array([-1, settings.horizon_steps, 2]))
    paths = graph.add("Reshape", [flat, shape], "paths" if settings.residual else "velocities")
    if settings.residual:
        graph.add("Add", [paths, graph.add("Unsqueeze", ["state", "axis1"], "present")], "velocities")
    steps = settings.horizon_steps
    told = {"velocities": [steps, 2]}
    if network.uncertainty is not None:
        told[graph.covariance(network.uncertainty, fused, steps)] = [steps, 2, 2]
    units = {f"{n}_{part}": v[0].shape[2] for n, v in network.start(1).memory.items() for part in _PARTS}
    after = {f"{name}_next": [width] for name, width in units.items()}
    _write(graph, shapes | {k: [v] for k, v in units.items()}, told | after, path)
    return {"inputs": tuple(shapes), "memory": units, "spread": network.uncertainty is not None}


_PARTS = ("hidden", "cell")


def export_int8(source: Path, target: Path) -> None:
    """Write a graph of `export_onnx` with 8-bit weights in its LSTMs and dense layers.

    Weights are w = scale (q - zero), one scale per output; what they are multiplied with is quantised as it
    comes ("dynamically", Jacob et al. 2018, eq. 1). A quarter of the bytes and of the memory traffic. The
    convolutions stay float: in 8 bits they are several times slower on processors without such instructions.

    Args:
        source: the full graph's file.
        target: the file to write.
    """
    with atomic_write(target) as new:
        quantize_dynamic(source, new, per_channel=True, op_types_to_quantize=["LSTM", "MatMul", "Gemm"])


def _write(graph: _Graph, inputs: dict[str, list[int]], outputs: dict[str, list[int]], path: Path) -> None:
    """Check the graph and write it."""
    sources, sinks = (
        [helper.make_tensor_value_info(n, TensorProto.FLOAT, ["people", *shape]) for n, shape in end.items()]
        for end in (inputs, outputs)
    )
    whole = helper.make_graph(graph.nodes, "pedpred", sources, sinks, graph.constants)
    model = helper.make_model(whole, opset_imports=[helper.make_opsetid("", _OPSET)], producer_name="pedpred")
    model.ir_version = _IR
    onnx.checker.check_model(model, full_check=True)
    with atomic_write(path) as new:
        new.write_bytes(model.SerializeToString(deterministic=True))


def _numbers(tensor: Tensor) -> np.ndarray:
    return tensor.detach().numpy()
