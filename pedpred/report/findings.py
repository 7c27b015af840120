"""What was expected of the metrics, and whether it holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from pedpred.errors import ValueRuleError
from pedpred.report.document import NOTHING
from pedpred.report.methods import Methods
from pedpred.report.results import ADE_GAP, Figures, Result
from pedpred.settings import In, OneOf, Settings, check_mapping, load

Verdict = Literal["met", "missed", "not measured"]


@dataclass(frozen=True)
class Expectation(Settings):
    """A statement about the ADE of two methods, given by their keys.

    Kind `below`: the first is below the second; `gains`: the same, reported as a relative gain;
    `ratio_at_least`: first / second is not below the bound.
    """

    kind: Annotated[str, OneOf(("below", "gains", "ratio_at_least"))]
    first: str
    second: str
    bound: Annotated[float, In("(0, 1e6]")] = 1.0


def _expectations(plain: Any, path: str) -> dict[str, list[Expectation]]:
    """Parse the expectations of each study."""
    check_mapping(path, plain)
    expected = {}
    for study, rows in plain.items():
        if not isinstance(rows, list):
            raise ValueRuleError(f"{path}.{study}", rows, "a list is needed")
        expected[study] = [load(Expectation, row, f"{path}.{study}[{n}]") for n, row in enumerate(rows)]
    return expected


@dataclass(frozen=True)
class Paper(Settings):
    """The publication that results are compared with, by study."""

    ade_m: Mapping[str, Annotated[Mapping[str, float], In("(0, 1e6]")]] = field(
        default_factory=dict
    )  # {study: {method: error, m}}
    remarks: Mapping[str, str] = field(default_factory=dict)
    expectations: Mapping[str, Sequence[Expectation]] = field(
        default_factory=dict, metadata={"parse": _expectations}
    )
    at: Mapping[str, Sequence[str]] = field(default_factory=dict)  # test sets it is about; all by default

    def about(self, result: Result) -> bool:
        """Whether the publication says something about a test set."""
        return result.name in self.at.get(result.study, [result.name])

    def errors_m(self, result: Result) -> Mapping[str, float]:
        """The published errors of a test set's study by method, m; none if they are about other sets."""
        return self.ade_m.get(result.study, {}) if self.about(result) else {}


@dataclass(frozen=True)
class Finding:
    """One expectation."""

    claim: str  # what was expected
    measured: str  # the figures that decide
    verdict: Verdict  # the decision


def judge_expectations(result: Result, paper: Paper, methods: Methods) -> list[tuple[str, Finding]]:
    """Judge all expectations of the test set's study; each comes with the name of the test set."""
    expected = paper.expectations.get(result.study, ()) if paper.about(result) else ()
    return [(result.name, judge(expectation, result.figures, methods)) for expectation in expected]


def judge(expected: Expectation, figures: Figures, methods: Methods) -> Finding:
    """Judge an expectation by the figures of a test set."""
    first, second = methods[expected.first], methods[expected.second]
    is_ratio = expected.kind == "ratio_at_least"
    claim = f"{first.label} below {second.label}"
    if is_ratio:
        claim = f"{first.label} / {second.label} at least {expected.bound:.2f}"
    found = [figures.get(method.key, "ade_m") for method in (first, second)]
    one, two = (figure.value if figure else 0.0 for figure in found)
    if None in found or not two:
        return Finding(claim, NOTHING, "not measured")
    measured, holds = f"{one:.3f} m {'<' if one < two else '≥'} {two:.3f} m", one < two
    if is_ratio:
        measured, holds = f"{one / two:.3f}", one / two >= expected.bound
    elif expected.kind == "gains":
        unsure = ", but the interval of the difference includes 0" * in_the_noise(figures, first.key)
        measured = better_than(one, two) + unsure
    return Finding(claim, measured, "met" if holds else "missed")


def better_than(one: float, other: float) -> str:
    """An error relative to another in words, e.g. `1.3 % better`; without a share where the other is 0."""
    if not other:
        return "worse" if one else "no better"
    gain = 1.0 - one / other
    return f"{abs(gain):.1%} {'better' if gain >= 0 else 'worse'}".replace("%", " %")


def in_the_noise(figures: Figures, method: str) -> bool:
    """Whether the interval of a method's paired difference to the reference includes zero."""
    gap = figures.get(method, ADE_GAP)
    return gap is not None and gap.bounds is not None and gap.bounds[0] <= 0.0 <= gap.bounds[1]


def sum_up(findings: Sequence[tuple[str, Finding]]) -> str:
    """Sum up all expectations; each comes with the test set that it is about."""
    judged = [(name, f) for name, f in findings if f.verdict != "not measured"]
    missed = [f"{name}, {f.claim} (measured: {f.measured})" for name, f in judged if f.verdict == "missed"]
    if not judged:
        return "None of the expectations could be checked: their methods were not evaluated."
    text = f"All {len(judged)} expectations that could be checked are met."
    if missed:
        verb = "is" if len(missed) == 1 else "are"
        text = f"**{len(missed)} of {len(judged)} expectations {verb} missed**: {'; '.join(missed)}."
    unchecked = len(findings) - len(judged)
    return text + f" {unchecked} could not be checked, because a method was not evaluated." * (unchecked > 0)
