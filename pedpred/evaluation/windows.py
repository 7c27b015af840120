"""The evaluation windows of a scene: every detection with a past to go by and a known future."""

from __future__ import annotations

import logging

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.features import FeatureTable, ForecastProtocol, extract, extract_at_detections
from pedpred.features.perception import Perception, perceived
from pedpred.forecasting import ForecastRequest
from pedpred.scenes import Scene
from pedpred.simulation.settings import SocialForceSettings
from pedpred.tracking import KalmanBank
from pedpred.tracking.tracks import TIME_TOLERANCE_S

_LOG = logging.getLogger(__name__)
_WORTH_SAYING = 0.01


def ask_about_windows(
    scene: Scene,
    how: Perception,
    sizes: ForecastProtocol,
    social_force: SocialForceSettings | None = None,
    memory: bool = True,
) -> ForecastRequest:
    """Ask for a forecast of every evaluation window of a scene.

    Args:
        scene: a place; detections at any rate, regular or not.
        how: how its people are perceived.
        sizes: time step, horizon, ages; the clock of networks has one phase, whatever training uses.
        social_force: the model of walking there; None where there is none.
        memory: compute the steps of networks with a memory.
    """
    seen, tracks = perceived(scene, how, sizes)
    table = extract_at_detections(seen, tracks, sizes, scene.trajectories)
    clock = extract(seen, tracks, sizes, truth=scene.trajectories) if memory else None
    tracker = how.kalman.filters[0] if isinstance(how.kalman, KalmanBank) else how.kalman
    tracker = None if sizes.noncausal else tracker
    rows = find_windows(table, sizes)
    every_s, noise_m = seen.detection_dt_s, how.sensor.position_noise_m
    return ForecastRequest(scene, table, sizes, rows, tracker, every_s, social_force, clock, tracks, noise_m)


def find_windows(table: FeatureTable, sizes: ForecastProtocol) -> np.ndarray:
    """Find the evaluation windows in a table at detections.

    A window is a detection with at least `min_history` earlier ones of the same life and a true position at
    every step of the horizon.

    Returns:
        Rows. [W]
    """
    return np.flatnonzero(_with_history(table, sizes) & (table.future_steps == sizes.horizon_steps))


def count_without_truth(table: FeatureTable, sizes: ForecastProtocol, place: str) -> int:
    """Count the detections that lack nothing but truth to be windows: their person stays, unseen at times.

    Args:
        table: at detections.
        sizes: of the table.
        place: it is named in a warning if these are many, and in the error.

    Raises:
        ValueRuleError: the table has no window at all.
    """
    windows = find_windows(table, sizes)
    last = np.append(table.step[1:] == 0, True)[: len(table)]  # of each life
    end_s = table.time_s[last][np.cumsum(last) - last]
    ahead_s = sizes.horizon_steps * sizes.dt_s
    stays = _with_history(table, sizes) & (table.time_s + ahead_s <= end_s + TIME_TOLERANCE_S)
    lost = len(np.setdiff1d(np.flatnonzero(stays), windows))
    gap = f"between detections more than {sizes.truth_gap_s:g} s apart (truth_gap_s) there is no truth"
    if not len(windows):
        nobody = f"nobody in {place} is detected {sizes.min_history + 1} times and {ahead_s:g} s longer"
        nobody += f" without being lost for more than {sizes.lost_after_s:g} s"
        cause = f"none of {lost} is left in {place}: {gap}" if lost else nobody
        raise ValueRuleError("windows", 0, cause + _usual(table))
    eligible = len(windows) + lost
    if lost > _WORTH_SAYING * eligible:
        _LOG.warning("%s: %d of %d windows are lost: %s", place, lost, eligible, gap)
    return lost


def _usual(table: FeatureTable) -> str:
    """Say how often people are detected, which tells whether the times are what they should be."""
    same = np.diff(table.track_id) == 0
    if not same.any():
        return ""
    usual_s = float(np.median(np.diff(table.time_s)[same]))
    return f"; detections of a person are usually {usual_s:g} s apart (time stamps must be in seconds)"


def _with_history(table: FeatureTable, sizes: ForecastProtocol) -> np.ndarray:
    return table.step >= sizes.min_history
