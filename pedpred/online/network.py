"""An exported network: a self-contained folder, run by onnxruntime."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np

from pedpred.errors import InputError, ValueRuleError, brief
from pedpred.features import ForecastProtocol, ModelFeatures
from pedpred.files import read_bytes, read_json, translate_errors, write_json
from pedpred.forecasting.tensors import TENSORS, predictions_of, sound_rows
from pedpred.models.features import RowFormat
from pedpred.online.graph import Shape, load_graph
from pedpred.scenes import Predictions
from pedpred.settings import In, Settings
from pedpred.tracking import KalmanSettings

MODEL_SCHEMA = 4
_LARGEST_MEMORY = 100_000
_LARGEST_BYTES = 2**28
_CHECKSUM = "description_sha256"
_PROTOCOL = {"dt_s": "[0.01, 10]", "horizon_steps": "[1, 1000]", "lost_after_s": "(0, 60]"}
"""What a robot can compute between two frames."""
_NOISE = {"acceleration_noise": "(0, 1000]", "position_noise_m": "(0, 100]", "initial_speed_mps": "(0, 100]"}
GRAPH, ABOUT = "network.onnx", "model.json"
_REMEDY = "Export the model again or copy the folder again"
_FEWER = "Lack of memory: let OnlineSettings.most_people be less. Anything else: export the model again"


def output_shapes(steps: int, modes: int) -> dict[str, Shape]:
    """Shapes per person of `pedpred.forecasting.tensors`."""
    path = (modes, steps, 2)
    return dict(zip(TENSORS, [(steps, 2), path, (modes,), (*path, 2)], strict=True))


@dataclass(frozen=True)
class ModelDescription(Settings):
    """What a robot must know to use a network.

    Attributes:
        inputs: names of the graph's inputs, in order; see `ModelFeatures.shapes`.
        memory: tensors of its recurrent state, which starts as zeros: name -> shape per person, in order.
        outputs: its outputs, in order: name -> shape per person; see `pedpred.forecasting.tensors`.
        made_with: protocol of the forecasts, and what the inputs are.
        tracker: noise of the tracker that filters the positions.
        standstill_mps: below this speed a pedestrian keeps its heading, m/s.
        learn_noise: whether the tracker learns the noise of each person's detections.
    """

    inputs: tuple[str, ...]
    memory: dict[str, Shape]
    outputs: dict[str, Shape]
    made_with: RowFormat
    tracker: KalmanSettings
    standstill_mps: Annotated[float, In("[0, 100]")]
    learn_noise: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        for part, ranges in ((self.protocol, _PROTOCOL), (self.tracker, _NOISE)):
            for name, interval in ranges.items():
                In(interval).check(name, getattr(part, name), "a number")
        known = self.features.shapes()
        if set(self.inputs) - set(known) or not self.inputs:
            raise ValueRuleError("inputs", self.inputs, f"known inputs are {list(known)}")
        for name, shape in self.memory.items():
            if min(shape, default=1) < 1 or math.prod(shape) > _LARGEST_MEMORY:
                raise ValueRuleError(f"memory.{name}", shape, f"it must have 1 to {_LARGEST_MEMORY} numbers")
        modes = self.outputs.get("weight", (1,))[0]
        allowed = output_shapes(self.protocol.horizon_steps, modes)
        if "velocities" not in self.outputs or ("path" in self.outputs) != ("weight" in self.outputs):
            raise ValueRuleError("outputs", list(self.outputs), "velocities, or path and weight are missing")
        for name, shape in self.outputs.items():
            if shape != allowed.get(name):
                raise ValueRuleError(f"outputs.{name}", shape, f"known outputs are {allowed}")

    @property
    def protocol(self) -> ForecastProtocol:
        """Time step, horizon and ages."""
        return self.made_with.protocol

    @property
    def features(self) -> ModelFeatures:
        """What the inputs are."""
        return self.made_with.features

    def ends(self) -> tuple[dict[str, Shape], list[Shape]]:
        """Shapes per person of the graph's inputs, by name, and of its outputs, in order."""
        known = self.features.shapes()
        inputs = {name: known[name] for name in self.inputs} | self.memory
        return inputs, [*self.outputs.values(), *self.memory.values()]


def write_description(folder: Path, description: ModelDescription, origin: Mapping[str, object]) -> None:
    """Describe `folder`'s network.onnx in model.json, with checksums of both and where it comes from."""
    about = {
        "schema": MODEL_SCHEMA,
        "units": {
            "state": "m/s, agent frame (forward, left)",
            "crop": "0 free, 1 occupied, cell (i forward, j left)",
            "angular": "1 - distance / max_range_m",
            "history": "m, agent frame, (forward, left, known), now and every dt_s before",
            "track": "last velocity (m/s), tracker's P_pp, P_pv, P_vv of each axis, age / 10 detections",
            "neighbours": "(forward, left) m and m/s, agent frame, and weight, the nearest first",
            "beams": "m, to the next obstacle, counter-clockwise from the heading",
            "velocities": "m/s, agent frame, of the point forecast, [people, horizon_steps, 2]",
            "path": "m, agent frame, [people, modes, horizon_steps, 2]; absent: one mode, the point forecast",
            "weight": "probability of each mode, [people, modes]",
            "covariance": "m^2, agent frame, in each mode, [people, modes, horizon_steps, 2, 2]",
        },
        "network_sha256": _digest(read_bytes(folder / GRAPH)),
        **_plain(description),
        "origin": dict(origin),
    }
    write_json(folder / ABOUT, about | {_CHECKSUM: digest_of(about)})


def _plain(description: ModelDescription) -> dict[str, Any]:
    """A description as it is written."""
    fields = {name: value for name, value in vars(description).items() if name != "made_with"}
    return {**fields, "tracker": asdict(description.tracker), **description.made_with.plain()}


def read_description(folder: Path) -> ModelDescription:
    """Read model.json and check that network.onnx is the one it describes.

    Raises:
        InputError: a file is missing, altered, or of another schema version; it names file and field.
    """
    about = _read_about(folder)
    with translate_errors(partial(InputError, folder / ABOUT, "description", remedy=_REMEDY)):
        if about["network_sha256"] != _digest(read_bytes(folder / GRAPH)):
            raise InputError(folder / GRAPH, "checksum", f"it is not what {ABOUT} describes", _REMEDY)
        return ModelDescription(
            tuple(about["inputs"]),
            _shapes(about["memory"]),
            _shapes(about["outputs"]),
            RowFormat.parse(about),
            KalmanSettings(**about["tracker"]),
            float(about["standstill_mps"]),
            bool(about.get("learn_noise", True)),
        )


def read_origin(folder: Path) -> dict[str, Any]:
    """Where a model folder's network comes from, as the stage `export` notes it.

    Raises:
        InputError: model.json is missing or altered.
    """
    return dict(_read_about(folder)["origin"])


def _read_about(folder: Path) -> dict[str, Any]:
    """What model.json says, after a check that it is what was written."""
    path = folder / ABOUT
    wording = partial(InputError, path, "description", remedy=_REMEDY)
    about = read_json(path, wording)
    with translate_errors(wording):
        if about["schema"] != MODEL_SCHEMA:
            raise InputError(path, "schema", f"{brief(about['schema'])}, expected {MODEL_SCHEMA}", _REMEDY)
        if about.pop(_CHECKSUM) != digest_of(about):
            raise InputError(path, "checksum", "its values are not those that were written", _REMEDY)
    return about


def digest_of(about: Mapping[str, Any]) -> str:
    """The checksum of the values in a JSON file, whatever their order and layout."""
    return _digest(json.dumps(about, sort_keys=True).encode())


def _digest(raw: bytes) -> str:
    return hashlib.sha256(raw).hexdigest()


def _shapes(plain: Mapping[str, list[int]]) -> dict[str, Shape]:
    return {str(name): tuple(int(side) for side in shape) for name, shape in plain.items()}


class Answer(NamedTuple):
    """Outputs of a network for the people that it forecasts.

    Attributes:
        sound: who of the people asked about; the network gave no numbers, or none that are a forecast, for
            the others. [N] bool
        predictions: agent frames. R rows
        velocities: of the point forecast, agent frames, m/s. [R, P, 2]
        memory: after the step, name -> [R, ...]
    """

    sound: np.ndarray
    predictions: Predictions
    velocities: np.ndarray
    memory: dict[str, np.ndarray]


class ExportedNetwork:
    """The network of a model folder; one thread, no state of its own. Pickled, it is read again there.

    Attributes:
        checksum: of the graph, SHA-256.
    """

    def __init__(self, folder: Path, description: ModelDescription):
        """Load the graph.

        Raises:
            InputError: it is missing, damaged or refused (`pedpred.online.graph`), its inputs and outputs
                are not those described, or weights are in other files.
        """
        path = folder / GRAPH
        raw = read_bytes(path, _LARGEST_BYTES)
        self._folder, self.checksum = folder.absolute(), _digest(raw)
        wording = partial(InputError, path, "graph")
        self._failed = partial(wording, remedy=_FEWER)
        with translate_errors(partial(wording, remedy=_REMEDY)):
            self._session = load_graph(raw, *description.ends())
        self._about = description

    def __deepcopy__(self, memo: dict[int, object]) -> ExportedNetwork:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return _read_again, (self._folder, self._about, self.checksum)

    def step(self, inputs: Mapping[str, np.ndarray], memory: Mapping[str, np.ndarray]) -> Answer:
        """One step of N people.

        Args:
            inputs: name -> [N, ...] float32.
            memory: name -> [N, ...] float32, before the step.

        Raises:
            InputError: the graph fails, as when it would take more than `MOST_MEMORY_BYTES`.
        """
        with translate_errors(self._failed):
            values = self._session.run(None, {**inputs, **memory})
        return self._answer(values)

    def nobody(self) -> Answer:
        """The answer for no people."""
        _, shapes = self._about.ends()
        return self._answer([np.zeros((0, *shape), np.float32) for shape in shapes])

    def _answer(self, values: list[np.ndarray]) -> Answer:
        tensors = dict(zip((*self._about.outputs, *self._about.memory), values, strict=True))
        sound = sound_rows(tensors)
        if not sound.all():
            tensors = {name: tensor[sound] for name, tensor in tensors.items()}
        outputs = {name: tensors[name] for name in self._about.outputs}
        memory = {name: tensors[name] for name in self._about.memory}
        return Answer(
            sound, predictions_of(outputs, self._about.protocol.dt_s), outputs["velocities"], memory
        )


def _read_again(folder: Path, description: ModelDescription, checksum: str) -> ExportedNetwork:
    """The network that was pickled.

    Raises:
        InputError: the folder holds none any more, or another one.
    """
    network = ExportedNetwork(folder, description)
    if network.checksum != checksum:
        raise InputError(folder / GRAPH, "checksum", "it is another network than the pickled one", _REMEDY)
    return network
