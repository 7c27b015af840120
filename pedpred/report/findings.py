"""What was expected of the numbers, and whether it came true."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from pedpred.report.measures import MethodMetrics
from pedpred.report.methods import MODEL, NOTHING, YARDSTICK, label

GRID_GAIN = 1.15
"""By what factor the error without the obstacle grid is expected to be larger, in simulation."""
ABOVE_BOUND = 1.2
"""By what factor, at most, the model's error is expected to exceed that of inferred goals and targets."""

Verdict = Literal["met", "missed", "not measured"]


@dataclass(frozen=True)
class Finding:
    """One expectation.

    Attributes:
        claim: what was expected.
        measured: the figures that decide.
        verdict: the decision.
    """

    claim: str
    measured: str
    verdict: Verdict


def simulation_findings(methods: MethodMetrics) -> list[Finding]:
    """Expectations in simulation: what knows more is closer, and the obstacle grid pays."""
    return [
        below(methods, "social_force", "goal_blind"),
        below(methods, "goal_blind", "goal_unseen"),
        below(methods, "goal_unseen", MODEL),
        ratio_at_most(methods, MODEL, "goal_unseen", ABOVE_BOUND),
        below(methods, MODEL, "lstm_nogrid"),
        below(methods, "lstm_nogrid", YARDSTICK),
        ratio_at_least(methods, "lstm_nogrid", MODEL, GRID_GAIN),
    ]


def real_findings(methods: MethodMetrics) -> list[Finding]:
    """Expectations at a real location that the network was not tuned on."""
    return [below(methods, MODEL, "cv"), gains(methods, MODEL, YARDSTICK)]


def below(methods: MethodMetrics, better: str, worse: str) -> Finding:
    """The ADE of one method is below another's."""
    claim = f"{label(better)} below {label(worse)}"
    if not {better, worse} <= methods.keys():
        return Finding(claim, NOTHING, "not measured")
    first, second = methods[better]["ade_m"], methods[worse]["ade_m"]
    sign = "<" if first < second else "≥"
    return Finding(claim, f"{first:.3f} m {sign} {second:.3f} m", "met" if first < second else "missed")


def ratio_at_least(methods: MethodMetrics, numerator: str, denominator: str, bound: float) -> Finding:
    """The ADE of one method is at least `bound` times another's."""
    return _ratio(methods, numerator, denominator, f"at least {bound:.2f}", lambda ratio: ratio >= bound)


def ratio_at_most(methods: MethodMetrics, numerator: str, denominator: str, bound: float) -> Finding:
    """The ADE of one method is at most `bound` times another's."""
    return _ratio(methods, numerator, denominator, f"at most {bound:.2f}", lambda ratio: ratio <= bound)


def _ratio(
    methods: MethodMetrics, numerator: str, denominator: str, wanted: str, holds: Callable[[float], bool]
) -> Finding:
    claim = f"{label(numerator)} / {label(denominator)} {wanted}"
    if not {numerator, denominator} <= methods.keys():
        return Finding(claim, NOTHING, "not measured")
    ratio = methods[numerator]["ade_m"] / methods[denominator]["ade_m"]
    return Finding(claim, f"{ratio:.3f}", "met" if holds(ratio) else "missed")


def gains(methods: MethodMetrics, model: str, reference: str) -> Finding:
    """The ADE of a model is below a reference's; tells the relative gain and whether it is noise."""
    found = below(methods, model, reference)
    if found.verdict == "not measured":
        return found
    gain = percent_better(relative_gain(methods, model, reference))
    return replace(found, measured=gain + noise(methods[model]))


def relative_gain(methods: MethodMetrics, model: str, reference: str) -> float:
    """(reference - model) / reference, of the ADE."""
    return 1.0 - methods[model]["ade_m"] / methods[reference]["ade_m"]


def percent_better(gain: float) -> str:
    """A relative gain in words, e.g. `1.3 % better`."""
    return f"{abs(gain):.1%} {'better' if gain >= 0 else 'worse'}".replace("%", " %")


def in_the_noise(measures: dict) -> bool:
    """Whether the interval of the paired difference to the yardstick holds zero."""
    interval = measures.get("ade_m_minus_reference_ci95")
    return interval is not None and interval[0] <= 0.0 <= interval[1]


def noise(measures: dict) -> str:
    """A remark where a difference cannot be told from none."""
    return ", but the interval of the difference includes 0" if in_the_noise(measures) else ""


def summed_up(findings: Sequence[tuple[str, Finding]]) -> str:
    """An honest paragraph on all expectations; each comes with the scene it is about."""
    judged = [(scene, f) for scene, f in findings if f.verdict != "not measured"]
    missed = [(scene, f) for scene, f in judged if f.verdict == "missed"]
    if not judged:
        return "None of the expectations could be checked: the methods they are about were not evaluated."
    if missed:
        verb = "is" if len(missed) == 1 else "are"
        text = f"**{len(missed)} of {len(judged)} expectations {verb} missed**: {_listed(missed)}."
    else:
        text = f"All {len(judged)} expectations that could be checked are met."
    if len(judged) < len(findings):
        text += f" {len(findings) - len(judged)} could not be checked, because a method was not evaluated."
    return text


def below_in(scenes: Mapping[str, MethodMetrics], model: str, others: Sequence[str]) -> str:
    """In how many scenes a model's ADE is below each of some others'; empty if nowhere comparable."""
    counts = []
    for other in others:
        both = [methods for methods in scenes.values() if {model, other} <= methods.keys()]
        wins = sum(methods[model]["ade_m"] < methods[other]["ade_m"] for methods in both)
        if both:
            counts.append(f"below the {label(other)} in {wins} of {len(both)}")
    return f"The {label(model)} is {' and '.join(counts)}." if counts else ""


def _listed(findings: Sequence[tuple[str, Finding]]) -> str:
    return "; ".join(f"{scene}, {found.claim} (measured: {found.measured})" for scene, found in findings)
