"""Metric files, {test set: {method: {"ade_m": ..., ...}}}, and results made of them."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from pedpred.errors import InputError, ValueRuleError
from pedpred.files import read_json, translate_errors

Figures = Mapping[str, Mapping[str, Any]]
"""The figures of each method in one test set, by the method's key."""

_QUARTILES = tuple(f"per_step_q{q}_m" for q in (25, 50, 75))
_MANY = 3
_FIELDS = ("ade_m", "ade_m_ci95", "windows", "tracks", "per_step_m", *_QUARTILES)


@dataclass(frozen=True)
class Result:
    """What was measured in one test set; `parts` are its single scenes by name, where it pools several."""

    name: str
    study: str  # that it belongs to: the name of its metric file
    kind: str  # of test set, "simulated" or "real"
    place: str  # the test set in words, with what its networks were trained on, as in "at home (...)"
    figures: Figures
    dt_s: float  # between two steps of the forecasts, s
    parts: Mapping[str, Figures] = field(default_factory=dict)
    fine_tuned: bool = False  # whether its networks were, on sets that are here

    @property
    def title(self) -> str:
        """The place as a heading."""
        return self.place[0].upper() + self.place[1:]

    @property
    def noncausal(self) -> bool:
        """Whether these are figures of the protocol whose inputs know the future."""
        return any(metrics.get("noncausal") for metrics in self.figures.values())


def bounds_of(metrics: Mapping[str, Any], key: str) -> tuple[float, float] | None:
    """The 95 % interval of a figure; None where there is none, or no replicate had a value."""
    bounds = metrics.get(f"{key}_ci95")
    return None if bounds is None or None in bounds else tuple(bounds)


def read_metrics(path: Path) -> dict[str, Figures]:
    """Read a metric file.

    Raises:
        InputError: it is no JSON, or a method lacks a figure; the error names it.
    """
    wording = partial(InputError, path, "file")
    sets = read_json(path, wording)
    with translate_errors(wording):
        for name, figures in sets.items():
            for method, metrics in figures.items():
                missing = [field for field in _FIELDS if field not in metrics]
                if missing:
                    raise InputError(path, f"{name}/{method}/{missing[0]}", "it is missing")
    return sets


def results_of(
    metrics: Mapping[str, Figures],
    folds: Iterable[Mapping[str, Sequence[str]]],
    study: str,
    dt_s: float,
    missing: Collection[str] = (),
) -> list[Result]:
    """The test sets of the folds of a study, in their order; see `Result` for the arguments.

    A fold has `test` and, where networks were fine-tuned for it, `train`: sets named <kind>/<name>. In the
    metrics, single scenes of a test set are named `<test set>_<scene>`. Sets without recording, `missing`,
    are left out.

    Raises:
        ValueRuleError: a test set has no figures.
    """
    results, folds = [], list(folds)
    tested = {entry.split("/")[1] for fold in folds for entry in fold["test"]}
    owner = {  # the longest name fits: `hall_wide_a` is a scene of `hall_wide`, neither is one of `hall`
        key: max((name for name in tested if key.startswith(f"{name}_")), key=len, default="")
        for key in metrics.keys() - tested
    }
    for fold in folds:
        trained = [entry for entry in fold.get("train", ()) if entry not in missing]
        for entry in fold["test"]:
            kind, name = entry.split("/")
            if entry in missing:
                continue
            if name not in metrics:
                raise ValueRuleError("metrics", sorted(metrics), f"the test set {name!r} must be among them")
            place = "in simulated rooms that no training saw" if kind == "simulated" else f"at {name}"
            parts = {k.removeprefix(f"{name}_"): v for k, v in metrics.items() if owner.get(k) == name}
            words = place + _tuned(trained)
            results.append(Result(name, study, kind, words, metrics[name], dt_s, parts, bool(trained)))
    return results


def _tuned(sets: Sequence[str]) -> str:
    """The places that networks were fine-tuned on, in brackets; more than two are counted."""
    names = [name for kind, name in (entry.split("/") for entry in sets) if kind == "real"]
    words = " and ".join(names) if len(names) < _MANY else f"{len(names)} other recordings"
    return f" (fine-tuned on {words})" if names else ""
