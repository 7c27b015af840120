"""`pedpred predict`: record the forecasts of a network in a scene."""

from __future__ import annotations

import argparse
import logging
from functools import partial
from pathlib import Path

from pedpred.command.conversion import layout_of, read_given, warn_without_obstacles
from pedpred.command.forecast_tables import SUFFIXES, write_forecasts
from pedpred.errors import InputError, ValueRuleError
from pedpred.fields import parsed
from pedpred.files import read_yaml, translate_errors
from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.online.replay import as_windows, replay_with_progress
from pedpred.online.settings import MOST_PEOPLE
from pedpred.reading.names import TrackNames
from pedpred.ros import check_recordable, write_recording
from pedpred.ros.foxglove import write_layout
from pedpred.scenes import Scene
from pedpred.tracking import KalmanSettings

_log = logging.getLogger(__name__)
_METHOD = "pedpred"
_COLOUR = (0.84, 0.37, 0.0)


def predict(arguments: argparse.Namespace) -> None:
    """Replay a scene frame by frame and write it with the forecasts as MCAP, or the forecasts as a table."""
    if arguments.output.suffix not in (".mcap", *SUFFIXES):
        rule = "the name of a recording ends in .mcap, that of a table of forecasts in .csv or .parquet"
        raise ValueRuleError("output", str(arguments.output), rule)
    is_table = arguments.output.suffix in SUFFIXES
    if is_table and arguments.grid is not None:
        raise ValueRuleError(
            "--grid", arguments.grid, "a table has no occupancy: the output must end in .mcap"
        )
    tracker = None if arguments.tracker is None else read_tracker(Path(arguments.tracker))
    names = TrackNames()
    scene = read_given(arguments, names)
    warn_without_obstacles(scene, arguments)
    predictor = robot_for(scene, arguments.model, tracker, arguments.detection_noise_m, arguments.trust)
    if not is_table:
        check_recordable(scene, predictor.protocol.horizon_steps, arguments.grid)
    windows = as_windows(scene, replay_with_progress(scene, predictor), _METHOD, predictor.protocol)
    if is_table:
        write_forecasts(windows, _METHOD, arguments.output, names)
        _log.info("%s: forecasts in %s", scene.name, arguments.output)
        return
    write_recording(scene, arguments.output, windows, {_METHOD: _COLOUR}, _METHOD, arguments.grid)
    write_layout(scene.occupancy, set(), layout_of(arguments.output))
    _log.info("%s: recorded with forecasts in %s", scene.name, arguments.output)


def robot_for(
    scene: Scene,
    model: Path | None,
    tracker: KalmanSettings | None = None,
    detection_noise_m: float = 0.0,
    learn_trust: bool = True,
) -> OnlinePredictor:
    """Load a predictor whose `max_age_s` covers the time between two detections of this scene; for any crowd.

    Args:
        scene: the scene.
        model: a model folder; None: the default one.
        tracker: in place of the model's.
        detection_noise_m: see `OnlineSettings`.
        learn_trust: see there.
    """
    max_age_s = max(0.5, 1.25 * scene.detection_dt_s)
    settings = OnlineSettings(
        max_age_s,
        tracker=tracker,
        detection_noise_m=detection_noise_m,
        learn_trust=learn_trust,
        most_people=MOST_PEOPLE,
    )
    return OnlinePredictor.load(model, settings)


def read_tracker(path: Path) -> KalmanSettings:
    """Read the parameters of a tracker.

    Raises:
        InputError: the file is missing or damaged, or a value breaks its rule.
    """
    wording = partial(InputError, path, "tracker", remedy="Correct the file")
    plain = read_yaml(path, wording)
    plain.pop("kind", None)  # as rows of conf/trackers have it
    with translate_errors(wording):
        return parsed(KalmanSettings, plain)
