"""The command `pedpred warm-up`: compile what updates and, where files can be read, other commands call."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

from pedpred.command.libraries import missing_libraries
from pedpred.models.features import FEATURES
from pedpred.online.predictor import OnlinePredictor
from pedpred.online.warming import meeting, say_where, warm_up
from pedpred.scenes import Scene


def named_path(text: str) -> Path:
    """Take the path that an argument names.

    Raises:
        ArgumentTypeError: it is empty.
    """
    if not text.strip():
        raise argparse.ArgumentTypeError("the name is empty")
    return Path(text)


def add_model(command: argparse.ArgumentParser) -> None:
    """Add the option of the model folder."""
    command.add_argument("--model", type=named_path, help="a model folder (default: the one of the package)")


def add_warm_up(commands: Any) -> argparse.ArgumentParser:
    """Add the subcommand to those of `pedpred`."""
    about = "Compile loops now, so that no later command and no robot waits for it."
    command: argparse.ArgumentParser = commands.add_parser("warm-up", help=about, description=about)
    command.set_defaults(action=lambda arguments: warm_up_commands(arguments.model), scene=[])
    return command


def warm_up_commands(model: Path | None) -> None:
    """Do `warm_up`, and compile what `pedpred predict` and `pedpred evaluate` call, with models of any kind.

    Raises:
        InputError: see `warm_up`.
    """
    begun_s = time.monotonic()
    warm_up(model)
    if not missing_libraries():
        _warm_up_evaluation(OnlinePredictor.load(model))
        say_where(begun_s)


def _warm_up_evaluation(predictor: OnlinePredictor) -> None:
    from pedpred.evaluation import EvaluationSettings  # late: they need libraries that read files
    from pedpred.evaluation.windows import ask_about_windows
    from pedpred.features.perception import Perception
    from pedpred.online.assessment import assess

    people, occupancy = meeting()
    scene = Scene("warm-up", people, occupancy, 0.1)
    assess(scene, predictor, EvaluationSettings(bootstrap=1))
    how = Perception(predictor.filters, predictor.description.standstill_mps)
    request = ask_about_windows(scene, how, predictor.protocol, memory=False)
    for features in FEATURES.values():  # of models of other kinds, too
        request.inputs(features(), request.rows, request.table.time_s[request.rows])
