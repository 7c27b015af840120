"""`pedpred predict`: record the forecasts of a network in a scene."""

from __future__ import annotations

import argparse
import logging
from functools import partial
from pathlib import Path

from pedpred.command.conversion import MCAP, stem_of, write_layout_beside
from pedpred.command.forecast_tables import SUFFIXES, write_forecasts
from pedpred.command.recordings import open_recording, warn_without_obstacles
from pedpred.errors import InputError, ValueRuleError
from pedpred.files import check_input, read_yaml, translate_errors
from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.online.network import read_description
from pedpred.online.replay import as_windows, replay_with_progress
from pedpred.online.settings import MOST_PEOPLE
from pedpred.online.shipped import default_model
from pedpred.ros import check_recordable, write_recording
from pedpred.scenes import Scene
from pedpred.settings import load
from pedpred.tracking import KalmanSettings

METHOD = "pedpred"
"""What forecasts of the network are called in recordings and tables."""
_COLOUR = (0.84, 0.37, 0.0)
_log = logging.getLogger(__name__)


def check_prediction(arguments: argparse.Namespace) -> None:
    """Check the output, and name one if none is given.

    Raises:
        ValueRuleError: its name is of no kind that is written, or a table is to hold occupancy.
    """
    if arguments.output is None:
        arguments.output = Path(f"{stem_of(arguments.scene)}_forecasts{MCAP}")
    if arguments.output.suffix not in (MCAP, *SUFFIXES):
        rule = "the name of a recording ends in .mcap, that of a table of forecasts in .csv or .parquet"
        raise ValueRuleError("output", str(arguments.output), rule)
    if arguments.grid is not None and arguments.output.suffix in SUFFIXES:
        rule = "a table has no occupancy: the output must end in .mcap"
        raise ValueRuleError("grid", arguments.grid, rule)


def predict(arguments: argparse.Namespace) -> None:
    """Replay a scene frame by frame and write it with the forecasts as MCAP, or the forecasts as a table."""
    tracker = None if arguments.tracker is None else read_tracker(arguments.tracker)
    recording, output = open_recording(arguments.scene, arguments.options), arguments.output
    scene, is_table = recording.scene, output.suffix in SUFFIXES
    warn_without_obstacles(scene, arguments.options)
    predictor = predictor_for(scene, arguments.model, tracker, arguments.detection_noise_m, arguments.trust)
    if not is_table:
        check_recordable(scene, predictor.protocol.horizon_steps, arguments.grid)
    windows = as_windows(scene, replay_with_progress(scene, predictor), METHOD, predictor.protocol)
    if is_table:
        write_forecasts(windows, METHOD, output, recording.names)
    else:
        write_recording(scene, output, windows, {METHOD: _COLOUR}, METHOD, arguments.grid)
        write_layout_beside(output, scene)
    _log.info("%s: forecasts in %s", scene.name, output)


def predictor_for(
    scene: Scene,
    model: Path | None,
    tracker: KalmanSettings | None = None,
    detection_noise_m: float = 0.0,
    learns: bool = True,
) -> OnlinePredictor:
    """Load a predictor whose `max_age_s` covers the time between two detections of this scene; for any crowd.

    Args:
        scene: the scene.
        model: a model folder; None: the default one.
        tracker: in place of the model's.
        detection_noise_m: see `OnlineSettings`.
        learns: `learn_trust` and `learn_local_errors`, see there.

    Raises:
        InputError: a file of the model is missing or damaged.
    """
    folder = default_model() if model is None else model
    check_input(folder, folder=True)
    lost_after_s = read_description(folder).protocol.lost_after_s
    settings = OnlineSettings(
        min(max(0.5, 1.25 * scene.detection_dt_s), lost_after_s),
        tracker=tracker,
        detection_noise_m=detection_noise_m,
        learn_trust=learns,
        learn_local_errors=learns,
        most_people=MOST_PEOPLE,
    )
    return OnlinePredictor.load(folder, settings)


def read_tracker(path: Path) -> KalmanSettings:
    """Read the parameters of a tracker.

    Raises:
        InputError: the file is missing or damaged, or a value breaks its rule.
    """
    wording = partial(InputError, path, "tracker", remedy="Correct the file")
    plain = read_yaml(path, wording)
    plain.pop("kind", None)  # as rows of conf/trackers have it
    with translate_errors(wording):
        return load(KalmanSettings, plain)
