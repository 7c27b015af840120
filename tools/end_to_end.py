"""Is the obstacle encoder better frozen or trained with the network? `python -m tools.end_to_end`.

By hand, after `dvc repro`; the figures go to reports/encoder.{json,md}. The network that reads occupancy
crops is trained in the rooms, without the corridor before, with a pre-trained encoder and with one as drawn,
each frozen and trained on. Frozen points read embeddings that are computed once, as in the pipeline. The
others compute those of every batch anew, and the gradient goes on into the convolutions.
"""

from __future__ import annotations

import argparse
import logging
from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np
import torch
from omegaconf import DictConfig
from torch import Tensor
from tqdm import tqdm

from pedpred.baselines.registry import baselines
from pedpred.config import config_errors, configured, plain, read_params, row
from pedpred.datasets import MotionData, split_sequences
from pedpred.datasets.lanes import SplitSettings
from pedpred.datasets.motion import load_motion_data
from pedpred.errors import ValueRuleError
from pedpred.evaluation import EvaluationSettings
from pedpred.evaluation.summary import Figures, figures
from pedpred.files import check_output, write_json, write_text
from pedpred.forecasting import Forecaster, Methods
from pedpred.forecasting.methods import Method
from pedpred.networks import GridEncoder, parse_settings
from pedpred.networks.contract import NetworkSettings
from pedpred.networks.encoding import encode, float_crops, load_encoder
from pedpred.networks.forecasting import NetworkForecaster
from pedpred.report.document import markdown_table
from pedpred.report.tables import interval
from pedpred.simulation.fields import parsed, parsed_together
from pedpred.simulation.settings import social_force_settings
from pedpred.storage.mapped import MappedRows
from pedpred.storage.scenes import scene_folders
from pedpred.storage.shards import read_crops, read_manifest
from pedpred.training import RecurrentLearner, TrainingSettings, train
from pedpred.training.distributed import DistributedContext, distributed_context
from pedpred.training.variation import VariedBatch
from pedpred.workers import in_parallel
from stages.evaluate import Comparison, compare_in
from stages.features import perception_of

_LOG = logging.getLogger(__name__)
_STEPS, _FEWEST = 1000, 2  # with one step there is no time between two
_RARELY = 5  # steps between validations, so that most steps are timed without
_TEST = "sim_test"
_CROPS_AT_ONCE = 64  # of a training step: larger outputs of the first layer leave the cache
_ROWS_AT_ONCE = 4096
POINTS = {
    "pre-trained, frozen": (True, False),
    "pre-trained, trained on": (True, True),
    "as drawn, frozen": (False, False),
    "as drawn, trained on": (False, True),
}
"""Name -> whether the encoder is pre-trained, and whether it is trained with the network."""


@dataclass(frozen=True, kw_only=True)
class CropData(MotionData):
    """Rows whose grid input is what the encoder, as it is at the moment, makes of their crops.

    Attributes:
        packed: crop of each row. [M, cells^2 / 8] uint8
        encoder: it gets a gradient wherever one is recorded.
        context: its precision is that of training; without gradient, embeddings are exact.
    """

    packed: np.ndarray
    encoder: GridEncoder
    context: DistributedContext

    @property
    def widths(self) -> dict[str, int]:
        """Channel -> numbers per step."""
        return super().widths | {"grid": self.encoder.fc.in_features}

    def inputs(self, rows: Tensor, instead: Mapping[str, Tensor] | None = None) -> dict[str, Tensor]:
        """The network's inputs at some rows, see `MotionData.inputs`."""
        seen = (instead or {}).get("grid", rows)
        crops = self._embedded(seen.flatten().cpu().numpy()).unflatten(0, seen.shape)
        return super().inputs(rows, instead) | {"grid": crops}

    def _embedded(self, rows: np.ndarray) -> Tensor:
        """Embeddings; row < 0 has no obstacle. [N] -> [N, C] float32."""
        packed = np.where(rows[:, None] >= 0, self.packed[rows.clip(min=0)], np.uint8(0))
        parts = (packed[at : at + _CROPS_AT_ONCE] for at in range(0, len(packed), _CROPS_AT_ONCE))
        crops = (float_crops(part, self.encoder.sides[0]).to(self.context.device) for part in parts)
        with self.context.precision() if torch.is_grad_enabled() else nullcontext():
            return torch.cat([self.encoder.embedding(some) for some in crops]).float()


@dataclass(eq=False)
class TimedLearner(RecurrentLearner):
    """A learner that notes when each step begins, s."""

    began_s: list[float] = field(default_factory=list)

    def batches(self, done: int) -> Iterator[VariedBatch]:
        """The stream of lanes."""
        for batch in super().batches(done):
            self.began_s.append(perf_counter())
            yield batch


def embedded(motion: MotionData, packed: np.ndarray, encoder: GridEncoder, title: str) -> MotionData:
    """The rows with the embeddings of their crops [M, cells^2 / 8], in half precision as in the pipeline."""
    found, cells = MappedRows("embedding"), encoder.sides[0]
    for at in tqdm(range(0, len(packed), _ROWS_AT_ONCE), desc=title, unit=f"{_ROWS_AT_ONCE} crops"):
        found.append(encode(encoder, packed[at : at + _ROWS_AT_ONCE], cells).astype(np.float16))
    empty = torch.from_numpy(encode(encoder, np.zeros_like(packed[:1]), cells)[0])
    embedding, empty = (table.to(motion.future.device) for table in (torch.from_numpy(found.array()), empty))
    return replace(motion, embedding=embedding, empty_embedding=empty)


@dataclass(frozen=True)
class Training:
    """What all points have in common.

    Attributes:
        network: settings of the network.
        motion: all rows without embeddings, on the context's device.
        packed: their crops. [M, cells^2 / 8] uint8
        parts: rows [first, last) of the sequences for training and for validation. [S, 2] each
        settings: of the training.
        context: where to train.
    """

    network: NetworkSettings
    motion: MotionData
    packed: np.ndarray
    parts: tuple[np.ndarray, np.ndarray]
    settings: TrainingSettings
    context: DistributedContext

    def learner(self, encoder: GridEncoder, trained: bool, title: str = "") -> TimedLearner:
        """A learner at its start; its network takes the encoder's last layer, and the others if trained."""
        encoder.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        own, packed = self.motion, self.packed
        live = partial(CropData, packed=packed, encoder=encoder, context=self.context)
        data = live(**vars(own)) if trained else embedded(own, packed, encoder, title)
        torch.manual_seed(self.settings.seed)
        network = self.network.build(data.widths, data.horizon_steps)
        network.take_encoder(encoder)
        if trained:
            network.add_module("encoder", encoder)
        return TimedLearner(network.to(self.context.device), data, *self.parts, self.settings, self.context)


def training_of(
    cfg: DictConfig, root: Path, method: Method, steps: int, here: DistributedContext
) -> Training:
    """Load the rooms of a checkout, with the settings of its parameters but for the number of steps."""
    folder, phase = root / "data/features/simulated/main", plain(cfg.training.main)
    every = max(_RARELY, phase["validate_every"] * steps // phase["steps"])
    with configured("training.main"):
        own = phase | {"steps": steps, "validate_every": every}
        split, settings = parsed_together([SplitSettings, TrainingSettings], own)
    motion, rows = load_motion_data([folder]).to(here.device), MappedRows("occupancy")
    sizes, shards = read_manifest(folder)
    for shard in tqdm(shards, desc="crops", unit="scene"):
        rows.extend(read_crops(folder, shard, sizes))
    parts = split_sequences(motion, split, np.random.default_rng(settings.seed))
    return Training(parse_settings(method.settings), motion, rows.array(), parts, settings, here)


def measured(cfg: DictConfig, root: Path, forecasters: Mapping[str, Forecaster], first: str) -> Figures:
    """Figures of forecasters in the unseen rooms; differences are to those of the first point."""
    source = cfg.simulations[_TEST]
    how, sizes = perception_of(cfg, source)
    walking = social_force_settings(row(cfg, "social_forces", source.social_force))
    settings = parsed(EvaluationSettings, plain(cfg.evaluation))
    with TemporaryDirectory() as scratch:
        given = Comparison(how, sizes, walking, forecasters, settings, Path(scratch))
        tasks = [(folder, given) for folder in scene_folders(root / "data/scenes/simulated" / _TEST)]
        scores = dict(in_parallel(compare_in, tasks, f"evaluate {_TEST}", "scene"))
    return figures(_TEST, scores, first, settings)[_TEST]


def table(rows: Sequence[Mapping[str, Any]], reference: Mapping[str, Any], titles: Sequence[str]) -> str:
    """Write a Markdown table, a row per point, beside the reference's figures; titles: of both."""

    def error(own: Mapping[str, Any], key: str = "ade_m", sign: str = "") -> str:
        return f"{own[key]:{sign}.3f} ({interval(own[f'{key}_ci95'], sign)})"

    body = []
    for own in rows:
        errors = [error(reference), error(own), error(own, "ade_m_minus_reference", "+")]
        body.append([own["point"], *errors, f"{own['validation_ade_m']:.3f}", f"{own['step_ms']:.0f}"])
    rest = ["minus the first point", "validation, m", "ms per training step"]
    return markdown_table(["obstacle encoder", *titles, *rest], body)


@config_errors()
def main(arguments: list[str] | None = None) -> None:
    """Train and measure all points, write the figures."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--steps", type=int, default=_STEPS, help="of each training")
    parser.add_argument("--data", type=Path, default=Path(), help="checkout whose data and models are read")
    parser.add_argument("--out", type=Path, default=Path("reports"), help="folder for the figures")
    given = parser.parse_args(arguments)
    if given.steps < _FEWEST:
        raise ValueRuleError("--steps", given.steps, f"use {_FEWEST} or more")
    check_output(given.out, folder=True)
    params = read_params(given.data)
    torch.set_num_threads(params.training.threads)
    methods = Methods.parse(plain(params.methods))
    method = next((m for m in methods.networks if "grid" in m.settings.get("channels", ())), None)
    if method is None:
        raise ValueRuleError("methods", [m.key for m in methods.networks], "one must have the channel grid")
    rows: list[dict[str, Any]] = []
    forecasters = baselines([methods.reference])
    with distributed_context(params.training.device, params.training.autocast) as here:
        training = training_of(params, given.data, method, given.steps, here)
        for point, (pretrained, trained) in POINTS.items():
            encoder = load_encoder(given.data / "models/autoencoder")
            if not pretrained:  # as the auto-encoder is before its first step
                torch.manual_seed(params.autoencoder.seed)
                encoder = GridEncoder(encoder.sides[0], encoder.fc.out_features)
            learner = training.learner(encoder, trained, f"embeddings, {point}")
            curve = train(learner, None, f"{method.label}, {point}")
            forecasters[point] = NetworkForecaster(learner.network.cpu().eval(), encoder)
            best_m = min(entry["validation_ade_m"] for entry in curve)
            step_ms = 1000 * float(np.median(np.diff(learner.began_s)))  # validations do not move a median
            own = {"point": point, "method": method.key, "steps": given.steps}
            rows.append(own | {"step_ms": round(step_ms, 1), "validation_ade_m": round(best_m, 5)})
    found = measured(params, given.data, forecasters, next(iter(POINTS)))
    for own in rows:
        own |= {key: value for key, value in found[own["point"]].items() if key.startswith("ade_m")}
    text = table(rows, found[methods.reference.key], [methods.reference.label, method.label])
    write_json(given.out / "encoder.json", rows)
    write_text(given.out / "encoder.md", text + "\n")
    _LOG.info("\n%s", text)


if __name__ == "__main__":
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    main()
