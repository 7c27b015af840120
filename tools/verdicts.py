"""What a model folder must hold, and whether figures hold it; see `tools.judge`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pedpred.baselines.present_motion import PRESENT_MOTION, STRONGEST
from pedpred.metrics.calibration import shown_steps
from stages.row_types import PromiseRow
from tools import laws
from tools.latency import ALLOWED, best_updates, paper_work
from tools.law_worlds import RATES_HZ

Figures = Mapping[str, Mapping[str, Any]]
"""Method -> figure -> value, as in the metric files."""

STRAIGHT_ON = next(iter(PRESENT_MOTION))
LEVEL, SURE = 1.00, 1.03
"""Most that the error over the better simple method's may be, and the end of its interval."""
_WORLDS = 5  # drawn for the laws
_SHORT_S = 8.0  # straight walks of people who have just appeared
SETTLED_S = 2.5
"""Age from which the last seconds of a track are known, s."""
REGIONS = {"50": (45, 55), "90": (86, 94), "95": (92, 98)}
"""Region, % -> least and most of the true positions in it, %."""
ROOMS = {"mode_collision_share": 0.07, "obstacle_share": 0.003}
TRUE_STATES = {"ade_m": 0.45, "min_ade_m_k6": 0.22, **ROOMS}
"""Figure in simulated test rooms -> most that it may be."""
SEEDS = 0.01
"""Share of the error by which it may differ between seeds of the fine-tuning (docs/experiments.md)."""
SENSED = 0.85
"""Most that the error in rooms through sensor and tracker may be over that of the paper's network."""


@dataclass(frozen=True)
class Verdict:
    """Whether a promise is kept.

    Attributes:
        about: place, law or crowd.
        what: was measured.
        found: the measured number, or numbers.
        limit: what it must be.
        holds: whether it is.
        remark: what to know about it.
        counted: a model is worse in such promises if it breaks more promises, of any kind, than another one.
            Their limits have no intervals, so that single ones are broken by chance.
    """

    about: str
    what: str
    found: str
    limit: str
    holds: bool
    remark: str = ""
    counted: bool = False


def at_most(about: str, what: str, value: float, most: float, remark: str = "", digits: int = 3) -> Verdict:
    """A number that must not exceed another one."""
    return Verdict(about, what, f"{value:.{digits}f}", f"<= {most:.{digits}f}", bool(value <= most), remark)


def newly_broken(candidate: Sequence[Verdict], present: Sequence[Verdict]) -> list[Verdict]:
    """The broken promises of a new model that the present one keeps, or that compare the two."""
    broken = {(verdict.about, verdict.what) for verdict in present if not verdict.holds}
    new, old = (sum(not v.holds for v in verdicts) for verdicts in (candidate, present))
    return [
        v
        for v in candidate
        if not v.holds and (v.about, v.what) not in broken and (new > old or not v.counted)
    ]


def no_worse(about: str, ade_m: float, other: float, ci95: Sequence[float]) -> Verdict:
    """Whether an error is above another model's by more than seeds differ, beyond the paired interval, m."""
    most, (low, high) = SEEDS * other, ci95
    measured = f"{ade_m:.3f} for {other:.3f}, {low:+.4f} ... {high:+.4f}"
    limit = f"interval from <= {most:.4f}"
    return Verdict(about, "ADE against the other model, m", measured, limit, bool(low <= most))


def place_verdicts(
    place: str, figures: Figures, method: str, promise: PromiseRow | None = None, remark: str = ""
) -> Iterator[Verdict]:
    """Errors beside the simple methods at a real place."""
    network, reference = figures[method], figures[STRONGEST]
    simple = [figures[key] for key in (STRAIGHT_ON, STRONGEST)]
    least = min(row["ade_m"] for row in simple)
    yield at_most(place, "ADE / better simple method", network["ade_m"] / least, LEVEL, remark)
    yield at_most(place, "end of its interval", _end_of_ratio(network, simple, reference), SURE, remark)
    if "standing_ade_m" in network:
        standing = min(row["standing_ade_m"] for row in simple)
        yield at_most(place, "the same, standing people", network["standing_ade_m"] / standing, LEVEL, remark)
    if promise is not None:
        ratio = network["ade_m"] / figures[promise.method]["ade_m"]
        yield at_most(place, f"ADE / {promise.method}", ratio, promise.most, remark)
    if "nll" in network and "nll" in reference:
        yield at_most(place, f"NLL (limit: {STRONGEST})", network["nll"], reference["nll"], remark)


def _end_of_ratio(
    network: Mapping[str, Any], simple: Sequence[Mapping[str, Any]], reference: Mapping[str, Any]
) -> float:
    """Upper end of the interval of the error over the better simple one's.

    That of the paired difference where the better one is the reference of differences.
    """
    least = min(row["ade_m"] for row in simple)
    if reference["ade_m"] == least:
        return float(1.0 + network["ade_m_minus_reference_ci95"][1] / least)
    return float(network["ade_m_ci95"][1] / least)


def region_verdicts(place: str, network: Mapping[str, Any], remark: str = "") -> Iterator[Verdict]:
    """Shares of the true positions in the 50, 90 and 95 % regions at three horizons."""
    for step in shown_steps(len(network["per_step_m"])):
        shares = {p: 100 * network[f"per_step_coverage_{p}"][step] for p in REGIONS}
        holds = all(low <= shares[p] <= high for p, (low, high) in REGIONS.items())
        limit = ", ".join(f"{low}-{high}" for low, high in REGIONS.values())
        measured = ", ".join(f"{share:.0f}" for share in shares.values())
        what = f"% in regions after step {step + 1}"
        yield Verdict(place, what, measured, limit, holds, remark, counted=True)


def room_verdicts(rooms: str, network: Mapping[str, Any], limits: Mapping[str, float]) -> Iterator[Verdict]:
    """Figures in simulated test rooms."""
    for key, most in limits.items():
        yield at_most(rooms, key, network.get(key, float("nan")), most, digits=4)


def law_verdicts(folder: Path) -> Iterator[Verdict]:
    """The laws of `tools.laws` in some drawn worlds."""
    low, high = laws.STRAIGHT
    for rate in RATES_HZ:
        rng, name = np.random.default_rng([0, round(10 * rate)]), f"{rate:g} Hz"
        walks = [
            laws.straight_shares(folder, rng, rate, seconds)
            for seconds in (300.0 if rate < 3 else 30.0, *[_SHORT_S] * (_WORLDS - 1))
        ]
        age_s, share = (np.concatenate([walked[key] for walked in walks]) for key in ("age_s", "share"))
        for since_s in (1.0, SETTLED_S):
            shares = share[age_s >= since_s]
            measured = f"{shares.min():.3f} ... {shares.max():.3f}"
            holds = bool(low <= shares.min() and shares.max() <= high)
            what = f"share of their way, {name}, from {since_s:g} s on"
            yield Verdict("straight walkers", what, measured, f"{low} ... {high}", holds)
        for noise in (0.0, 0.02):
            newborn, later = laws.standing_errors_m(folder, rng, rate, noise)
            what = f"m, {name}, noise {100 * noise:.0f} cm"
            yield at_most("standing newborns", what, float(newborn.max()), laws.STANDING_M)
            yield at_most("standing people", what, float(later.max()), laws.STANDING_M)
    draws = [np.random.default_rng([0, k]) for k in range(_WORLDS)]
    for what, (gap_m, most_m) in laws.GAPS.items():
        found_m = max(gap_m(folder, rng) for rng in draws)
        yield at_most("worlds", f"{what}, m", found_m, most_m, digits=4)


def latency_verdicts(folder: Path) -> Iterator[Verdict]:
    """Time of an update on one thread over the bound of the paper's network; the best of five tries."""
    work = paper_work()
    for count, allowed in ALLOWED.items():
        rate, times = best_updates(folder, count, 60, tries=5)
        median = float(np.median(times["update"]))
        ratio = median / (count * work / rate * 1e3)
        remark = f"{median:.1f} ms"
        yield at_most(f"{count} people", "update / bound of the paper's network", ratio, allowed, remark)
