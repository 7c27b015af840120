"""The command `pedpred warm-up`: compile what updates and, where files can be read, other commands call."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

from pedpred.models.features import FEATURES
from pedpred.online.predictor import OnlinePredictor
from pedpred.online.warming import meeting, say_where, warm_up
from pedpred.scenes import Scene


def add_model(command: argparse.ArgumentParser) -> None:
    """Add the option of the model folder."""
    command.add_argument("--model", type=Path, help="a model folder (default: the one of the package)")


def add_warm_up(commands: Any) -> argparse.ArgumentParser:
    """Add the subcommand to those of `pedpred`."""
    about = "Compile loops now, so that no later command and no robot waits for it."
    command: argparse.ArgumentParser = commands.add_parser("warm-up", help=about, description=about)
    command.set_defaults(action=warm_up_commands, check=lambda arguments: None)
    return command


def warm_up_commands(arguments: argparse.Namespace) -> None:
    """Do `warm_up`, and compile what `pedpred predict` and `pedpred evaluate` call, with models of any kind.

    Raises:
        InputError: see `warm_up`.
    """
    begun_s = time.monotonic()
    warm_up(arguments.model)
    try:
        from pedpred.evaluation import EvaluationSettings, find_windows
        from pedpred.features.perception import Perception
        from pedpred.online.assessment import assess
    except ModuleNotFoundError:  # of the extra `files`: no other command runs here
        return
    predictor, (people, occupancy) = OnlinePredictor.load(arguments.model), meeting()
    scene = Scene("warm-up", people, occupancy, 0.1)
    assess(scene, predictor, EvaluationSettings(bootstrap=1))
    how = Perception(predictor.filters, predictor.description.standstill_mps)
    request = find_windows(scene, how, predictor.protocol, memory=False).request
    for features in FEATURES.values():  # of models of other kinds, too
        request.inputs(features(), request.rows, request.table.time_s[request.rows])
    say_where(begun_s)
