"""How the compared methods are called, ordered and coloured, and what the paper reports of them."""

from __future__ import annotations

from collections.abc import Iterable

MODEL = "lstm"
"""The method that the report is about."""
YARDSTICK = "kalman_cv"
"""The strongest simple method, that a learned model has to beat."""

NOTHING = "-"
"""Stands where a table has no figure."""

LABELS = {
    "cv": "CV",
    "ca": "CAcc",
    "kalman_cv": "Kalman CV",
    "social_force": "SF, true goal",
    "goal_blind": "SF, goal inferred",
    "goal_unseen": "SF, room unseen",
    "lstm_nogrid": "LSTM-noGrid",
    "lstm": "LSTM",
}
"""In the order of display: from what knows least to the model that the report is about."""

# Okabe & Ito's palette, distinguishable with every common colour blindness.
_COLOURS = {
    "cv": "#7F7F7F",
    "ca": "#CC79A7",
    "kalman_cv": "#0072B2",
    "social_force": "#009E73",
    "goal_blind": "#56B4E9",
    "goal_unseen": "#F0E442",
    "lstm_nogrid": "#E69F00",
    "lstm": "#D55E00",
}
_FURTHER_COLOURS = ("#332288", "#882255", "#44AA99", "#DDCC77")

PAPER_ADE_M = {
    "sim": {"social_force": 0.071, "lstm": 0.169, "lstm_nogrid": 0.220, "cv": 0.652, "ca": 0.659},
    "real": {"social_force": 0.667, "lstm": 0.179, "lstm_nogrid": 0.193, "cv": 0.676, "ca": 0.682},
}
"""Average prediction error, m. Pfeiffer et al. 2018, table I."""


def ordered(names: Iterable[str]) -> list[str]:
    """Method names in the order of display; unknown ones come last, by name."""
    names = set(names)
    return [name for name in LABELS if name in names] + sorted(names - set(LABELS))


def label(name: str) -> str:
    """What a reader sees for a method."""
    return LABELS.get(name, name)


def colours(names: Iterable[str]) -> dict[str, str]:
    """One colour per method: fixed for known ones, by rank of the name for others."""
    names = ordered(names)
    unknown = [name for name in names if name not in _COLOURS]
    further = {name: _FURTHER_COLOURS[k % len(_FURTHER_COLOURS)] for k, name in enumerate(unknown)}
    return {name: _COLOURS.get(name) or further[name] for name in names}
