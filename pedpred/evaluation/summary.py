"""From scores per window to the figures of the metric files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.evaluation.scores import Resampling, Scores, check_alike, pool_scores
from pedpred.metrics.calibration import REGIONS, coverage

_DIGITS = 5
Figures = dict[str, dict[str, Any]]
"""{method: {figure: value}}, as in the metric files."""


@dataclass(frozen=True)
class TrackBootstrap:
    """Replicates of a pool of windows; one draw serves all metrics.

    Windows of one track are not independent; tracks nearly are.

    Attributes:
        track: index of each window's track. [W]
        weight: how often each track occurs in each replicate. [S, T]
    """

    track: np.ndarray
    weight: np.ndarray

    @classmethod
    def draw(cls, track: np.ndarray, samples: int, rng: np.random.Generator) -> TrackBootstrap:
        """Draw `samples` replicates of the tracks of some windows [W]."""
        names, index = np.unique(track, return_inverse=True)
        count = len(names)
        return cls(index, rng.multinomial(count, np.full(count, 1.0 / count), size=samples))

    @property
    def tracks(self) -> int:
        """Number of tracks T."""
        return self.weight.shape[1]

    def interval(self, values: np.ndarray) -> tuple[float, float]:
        """Find the 95 % interval of the mean over the windows that have a value.

        Args:
            values: one per window, NaN where there is none. [W]
        """
        valid = ~np.isnan(values)
        if not valid.any():
            return float("nan"), float("nan")
        sums = np.bincount(self.track[valid], weights=values[valid], minlength=self.tracks)
        counts = np.bincount(self.track[valid], minlength=self.tracks)
        total = self.weight @ counts
        some = total > 0
        if not some.any():
            return float("nan"), float("nan")
        low, high = np.percentile((self.weight @ sums)[some] / total[some], [2.5, 97.5])
        return float(low), float(high)


def summarise_test_set(
    test: str,
    scores: Mapping[str, Mapping[str, Scores]],
    reference: str,
    settings: Resampling,
) -> dict[str, Figures]:
    """Make the metric entries of a test set: all scenes pooled, and each one when there are several.

    Args:
        test: name of the test set.
        scores: scene name -> method -> scores.
        reference: the method that the others are compared with: differences are method minus reference.
        settings: of the bootstrap.

    Raises:
        ValueRuleError: scenes have scores of different methods, or these cannot be compared.
    """
    methods = next(iter(scores.values()))
    for name, of_methods in scores.items():
        check_alike(f"methods at {name}", of_methods, methods)
    pools = {test: {m: pool_scores([s[m] for s in scores.values()]) for m in methods}}
    if len(scores) > 1:
        pools |= {f"{test}_{name}": dict(of_methods) for name, of_methods in scores.items()}
    return {entry: summarise_methods(pool, reference, settings) for entry, pool in pools.items()}


def summarise_methods(pool: Mapping[str, Scores], reference: str, settings: Resampling) -> Figures:
    """Summarise all methods in the same windows.

    Args:
        pool: method -> scores.
        reference: the method that the others are compared with: differences are method minus reference.
        settings: of the bootstrap; all figures share one draw.

    Raises:
        ValueRuleError: methods were measured with different metrics, or in different windows.
    """
    for method, scores in pool.items():
        check_alike(f"metrics of {method}", scores.values, pool[reference].values)
        if not np.array_equal(scores.track, pool[reference].track):
            rule = f"the windows of {reference} are {len(pool[reference].track)} others; evaluate both again"
            raise ValueRuleError(f"windows of {method}", len(scores.track), rule)
    rng = np.random.default_rng(settings.seed)
    resampling = TrackBootstrap.draw(pool[reference].track, settings.bootstrap, rng)
    return {method: _summary(scores, pool[reference], resampling) for method, scores in pool.items()}


def _summary(scores: Scores, reference: Scores, resampling: TrackBootstrap) -> dict[str, Any]:
    """Summarise one method; a metric that applies to no window is left out, differences are paired."""
    values: dict[str, Any] = {"noncausal": True} if scores.noncausal else {}
    for key, measured in scores.values.items():
        for name, each in ((key, measured), (f"{key}_minus_reference", measured - reference.values[key])):
            valid = ~np.isnan(each)
            if valid.any():
                values |= {name: each[valid].mean(), f"{name}_ci95": resampling.interval(each)}
    eligible = len(scores.track) + scores.without_truth
    values |= {"windows": len(scores.track), "eligible": eligible, "tracks": resampling.tracks}
    values |= _per_step(scores)
    return {name: _plain(value) for name, value in values.items()}


def _per_step(scores: Scores) -> dict[str, Any]:
    """Errors at each step, and the calibration of a method that gives covariances."""
    quartiles = np.percentile(scores.error_m, [25, 50, 75], axis=0)
    values = {"per_step_m": scores.error_m.mean(axis=0)}
    values |= {f"per_step_q{q}_m": quartile for q, quartile in zip((25, 50, 75), quartiles, strict=True)}
    if scores.nll.shape[1]:
        values["per_step_nll"] = scores.nll.mean(axis=0)
    return values | coverages(scores.inside)


def coverages(inside: np.ndarray) -> dict[str, Any]:
    """Coverage of the reported regions at each step; none without covariances. inside: [W, P] or [W, 0]."""
    if not inside.shape[1]:
        return {}
    return {f"per_step_coverage_{100 * share:.0f}": _plain(coverage(inside, share)) for share in REGIONS}


def _plain(value: Any) -> Any:
    """Round to plain JSON numbers, so that a metric file can be read and compared; None for NaN or inf."""
    if isinstance(value, bool):
        return value
    if isinstance(value, (int, np.integer)):
        return int(value)
    rounded = np.round(np.asarray(value, dtype=np.float64), _DIGITS)
    return np.ma.masked_invalid(rounded).tolist()
