"""A trained network as one self-contained ONNX graph: inputs and state in, forecasts and state out.

`torch.onnx` traces the graph. Its older exporter is used (dynamo=False): it writes the same bytes each time
and no paths, and needs no further package.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnx.helper
import onnx.numpy_helper
import onnxruntime
import torch
from torch import Tensor, nn

from pedpred.errors import ValueRuleError
from pedpred.files import atomic_write
from pedpred.forecasting.tensors import TENSORS
from pedpred.models.contract import ForecastNetwork, Tensors
from pedpred.models.lstm.autoencoder import GridEncoder

_OPSET = 17
_SENSOR_INPUT = {"grid": "crop"}
"""Channels that the graph computes itself -> the graph's input; the other channels are inputs."""


class ExportedStep(nn.Module):
    """One step of N people, with the frozen convolutions in front of the network.

    Attributes:
        inputs: names of the graph's inputs but the state.
        memory: tensors of the state, name -> shape per person.
    """

    def __init__(self, network: ForecastNetwork, encoder: GridEncoder | None, dt_s: float):
        super().__init__()
        self.network, self.encoder, self.dt_s = network, encoder, dt_s
        self.eval()
        self.inputs = tuple(_SENSOR_INPUT.get(name, name) for name in network.settings.channels_read)
        self.memory = network.state_shapes

    def forward(self, *values: Tensor) -> tuple[Tensor, ...]:
        """Inputs, then state, in order -> outputs, then state. [N, ...] each."""
        decoded, after = self.advance(*values)
        return (*decoded.values(), *(after[name] for name in self.memory))

    def advance(self, *values: Tensor) -> tuple[Tensors, Tensors]:
        """The same, by name; the outputs in the order of `TENSORS`."""
        channels = dict(zip(self.inputs, values, strict=False))  # the values of the state follow
        state: Tensors = dict(zip(self.memory, values[len(self.inputs) :], strict=True))
        if "crop" in channels and self.encoder is not None:
            channels["grid"] = self.encoder.embedding(channels.pop("crop"))
        outputs, after = self.network.step(channels, state)
        decoded = self.network.decode(outputs, self.dt_s)
        return {name: decoded[name] for name in TENSORS if name in decoded}, after


def export_onnx(
    network: ForecastNetwork,
    encoder: GridEncoder | None,
    shapes: Mapping[str, tuple[int, ...]],
    dt_s: float,
    path: Path,
) -> dict[str, Any]:
    """Write the graph of one step of N people.

    Args:
        network: trained; it decides which inputs the graph has.
        encoder: whose embeddings the network reads; None if it does not read the grid.
        shapes: of the sensor inputs of one person, by name (`RowFormat.features.shapes`).
        dt_s: time between two steps, s.
        path: the file to write.

    Returns:
        "inputs": their names; "outputs" and "memory": name -> shape per person; all in order.
    """
    step = ExportedStep(network, encoder, dt_s)
    sizes = [shapes[name] for name in step.inputs] + list(step.memory.values())
    example = tuple(torch.zeros(2, *size) for size in sizes)  # two: a size of 1 would be taken for fixed
    with torch.inference_mode():
        decoded, _ = step.advance(*example)
    sources = [*step.inputs, *step.memory]
    sinks = [*decoded, *(f"{name}_next" for name in step.memory)]
    with atomic_write(path) as new, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the exporter is deprecated; LSTMs with other numbers of people work
        torch.onnx.export(
            step,
            example,
            str(new),
            dynamo=False,
            opset_version=_OPSET,
            input_names=sources,
            output_names=sinks,
            dynamic_axes={name: {0: "people"} for name in sources + sinks},
        )
        onnx.checker.check_model(str(new), full_check=True)
        _check_graph(step, sizes, sources, new)
    outputs = {name: tuple(value.shape[1:]) for name, value in decoded.items()}
    return {"inputs": step.inputs, "memory": step.memory, "outputs": outputs}


def _check_graph(step: ExportedStep, sizes: list[tuple[int, ...]], sources: list[str], path: Path) -> None:
    """Compare graph and network for another number of people than the traced one.

    Raises:
        ValueRuleError: they differ: the network computes a shape or a branch that tracing takes for fixed.
    """
    rng = np.random.default_rng(0)
    values = [rng.random((5, *size), np.float32) for size in sizes]
    with torch.inference_mode():
        expected = step(*map(torch.from_numpy, values))
    try:
        session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
        outputs = session.run(None, dict(zip(sources, values, strict=True)))
    except Exception as error:  # onnxruntime documents none
        raise ValueRuleError("graph", path.name, "it fails for other numbers of people") from error
    for mine, tensor in zip(outputs, expected, strict=True):
        if mine.shape != tensor.shape or not np.allclose(mine, tensor.numpy(), rtol=1e-3, atol=1e-4):
            raise ValueRuleError("graph", path.name, "it is wrong for other numbers of people")


def store_half(path: Path) -> None:
    """Store the weights of a graph in half precision; it computes in single precision as before.

    That takes half of the bytes. The runtime converts the weights once, when it loads the graph. Nothing is
    rounded at run time, so that nobody's forecast depends on who else is in the batch.
    """
    graph = onnx.load(path)
    halves, casts = [], []
    for stored in list(graph.graph.initializer):
        values = onnx.numpy_helper.to_array(stored)
        if values.dtype == np.float32:
            halves.append(onnx.numpy_helper.from_array(values.astype(np.float16), f"{stored.name}.half"))
            casts.append(
                onnx.helper.make_node("Cast", [halves[-1].name], [stored.name], to=onnx.TensorProto.FLOAT)
            )
            graph.graph.initializer.remove(stored)
    nodes = [*casts, *graph.graph.node]
    graph.graph.initializer.extend(halves)
    del graph.graph.node[:]
    graph.graph.node.extend(nodes)
    onnx.checker.check_model(graph, full_check=True)
    with atomic_write(path) as new:
        new.write_bytes(graph.SerializeToString(deterministic=True))
