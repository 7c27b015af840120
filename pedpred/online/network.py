"""An exported network: a folder that says all about itself, run by onnxruntime."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np
import onnxruntime

from pedpred.errors import StorageError, ValueRuleError
from pedpred.features import FeatureSettings
from pedpred.files import read_bytes, read_json, translate_errors, write_json
from pedpred.tracking import KalmanSettings

MODEL_SCHEMA = 1
_MOST_UNITS = 10_000
_GRAPH, _ABOUT = "network.onnx", "model.json"
_REMEDY = "Export the model again (dvc repro export) or fetch the folder anew"


@dataclass(frozen=True)
class ModelDescription:
    """What a robot must know to use a network.

    Attributes:
        inputs: names of the graph's inputs, in order.
        memory: names of its memory tensors, in order, and their units.
        features: sizes and clock of the inputs.
        tracker: noise of the tracker that the positions go through.
        standstill_mps: below this speed a pedestrian keeps its heading, m/s.
        spread: the graph tells the covariance of its positions.
    """

    inputs: tuple[str, ...]
    memory: dict[str, int]
    features: FeatureSettings
    tracker: KalmanSettings
    standstill_mps: float
    spread: bool = False

    def __post_init__(self) -> None:
        strangers = set(self.inputs) - {"state", "crop", "angular"}
        if strangers or not self.inputs:
            raise ValueRuleError("inputs", self.inputs, "known inputs are state, crop and angular")
        for name, units in self.memory.items():
            if not 0 < units <= _MOST_UNITS:
                raise ValueRuleError(f"memory.{name}", units, f"it must be between 1 and {_MOST_UNITS}")
        if not 0 <= self.standstill_mps < np.inf:
            raise ValueRuleError("standstill_mps", self.standstill_mps, "it must not be negative")

    def ends(self) -> tuple[dict[str, tuple[int, ...]], list[tuple[int, ...]]]:
        """Sizes per person of the graph's inputs, by name, and of its outputs, in order."""
        sizes = self.features
        crop = (sizes.grid_cells, sizes.grid_cells)
        known = {"state": (2,), "crop": crop, "angular": (sizes.angular_cells,)}
        memory = {name: (units,) for name, units in self.memory.items()}
        steps = sizes.horizon_steps
        told = [(steps, 2), (steps, 2, 2)] if self.spread else [(steps, 2)]
        return {name: known[name] for name in self.inputs} | memory, [*told, *memory.values()]


def write_description(folder: Path, description: ModelDescription, origin: Mapping[str, object]) -> None:
    """Describe `folder`'s network.onnx in model.json, with its checksum and where it comes from."""
    about = {
        "schema": MODEL_SCHEMA,
        "units": {
            "state": "m/s, agent frame (forward, left)",
            "crop": "0 free, 1 occupied, cell (i forward, j left)",
            "angular": "1 - distance / max_range_m",
            "velocities": "m/s, agent frame, [people, horizon_steps, 2]",
            "covariance": "m^2, agent frame, of the position after each step, [people, horizon_steps, 2, 2]",
        },
        "network_sha256": _digest(folder / _GRAPH),
        **asdict(description),
        "origin": dict(origin),
    }
    write_json(folder / _ABOUT, about)


def read_description(folder: Path) -> ModelDescription:
    """Read model.json and check that network.onnx is the one it describes.

    Raises:
        StorageError: a file is missing, altered, or of another schema version; it names file and field.
    """
    path = folder / _ABOUT
    wording = partial(StorageError, path, "description", remedy=_REMEDY)
    about = read_json(path, wording)
    with translate_errors(wording):
        if about["schema"] != MODEL_SCHEMA:
            raise StorageError(path, "schema", f"{about['schema']!r}, expected {MODEL_SCHEMA}", _REMEDY)
        if about["network_sha256"] != _digest(folder / _GRAPH):
            raise StorageError(folder / _GRAPH, "checksum", f"it is not what {_ABOUT} describes", _REMEDY)
        return ModelDescription(
            tuple(about["inputs"]),
            {str(name): int(units) for name, units in about["memory"].items()},
            FeatureSettings(**about["features"]),
            KalmanSettings(**about["tracker"]),
            float(about["standstill_mps"]),
            bool(about.get("spread", False)),  # a folder from before networks told any
        )


class ExportedNetwork:
    """The network of a model folder; one thread, no state of its own."""

    def __init__(self, folder: Path, description: ModelDescription):
        """Load the graph.

        Raises:
            StorageError: it is missing or damaged, or its inputs and outputs are not those described.
        """
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        path = folder / _GRAPH
        with translate_errors(partial(StorageError, path, "graph", remedy=_REMEDY)):
            self._session = onnxruntime.InferenceSession(
                str(path), options, providers=["CPUExecutionProvider"]
            )
        self._memory, self._spread = list(description.memory), description.spread
        ends = {end.name: tuple(end.shape[1:]) for end in self._session.get_inputs()}
        sizes = [tuple(end.shape[1:]) for end in self._session.get_outputs()]
        if (ends, sizes) != description.ends():
            raise StorageError(path, "graph", f"it has {ends} -> {sizes}, not {_ABOUT}'s", _REMEDY)

    def step(
        self, inputs: Mapping[str, np.ndarray], memory: Mapping[str, np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray | None, dict[str, np.ndarray]]:
        """One step of N people.

        Args:
            inputs: name -> [N, ...] float32.
            memory: name -> [N, units] float32, before the step.

        Returns:
            Future velocities, agent frames, m/s [N, P, 2]; the covariance of positions, agent frames, m^2
            [N, P, 2, 2], or None from a network that tells none; the memory after the step.
        """
        velocities, *others = self._session.run(None, {**inputs, **memory})
        covariance = others.pop(0) if self._spread else None
        return velocities, covariance, dict(zip(self._memory, others, strict=True))


def _digest(path: Path) -> str:
    return hashlib.sha256(read_bytes(path)).hexdigest()
