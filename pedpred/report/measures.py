"""Metrics as `evaluate` wrote them: {scene: {method: {"ade_m": ..., ...}}}."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path

from pedpred.errors import StorageError
from pedpred.files import read_json, translate_errors

MethodMetrics = dict[str, dict]
"""The measures of each method in one scene, by the method's name."""

LEAKY = "paper_protocol/"
"""Prefix of scenes that were evaluated under the protocol that lets the future in."""

_FIELDS = (
    "ade_m",
    "ade_m_ci95",
    "fde_m",
    "moving_ade_m",
    "windows",
    "tracks",
    "per_step_m",
    "per_step_q25_m",
    "per_step_q50_m",
    "per_step_q75_m",
    "obstacle_share",
    "collision_share",
)
_REMEDY = "Evaluate again (dvc repro)"


def read_metrics(path: Path) -> dict[str, MethodMetrics]:
    """Read a metrics file.

    Raises:
        StorageError: it is no JSON, or a method of a scene lacks a measure; the error names it.
    """
    wording = partial(StorageError, path, "file", remedy=_REMEDY)
    scenes = read_json(path, wording)
    with translate_errors(wording):
        for scene, methods in scenes.items():
            for method, measures in methods.items():
                missing = [field for field in _FIELDS if field not in measures]
                if missing:
                    raise StorageError(path, f"{scene}/{method}/{missing[0]}", "it is missing", _REMEDY)
    return scenes


def noncausal(scenes: Mapping[str, MethodMetrics]) -> bool:
    """Whether these are figures of the protocol whose inputs know the future."""
    return any(measures.get("noncausal") for methods in scenes.values() for measures in methods.values())
