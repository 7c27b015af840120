"""Markdown tables of metrics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pedpred.metrics.calibration import REGIONS, shown_steps
from pedpred.report.findings import Finding
from pedpred.report.measures import MethodMetrics
from pedpred.report.methods import MODEL, NOTHING, YARDSTICK, label, ordered


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]], texts: int = 1) -> str:
    """A Markdown table; the first `texts` columns are text, the others are figures."""
    rule = ["---"] * texts + ["---:"] * (len(header) - texts)
    return "\n".join("| " + " | ".join(cells) + " |" for cells in [header, rule, *rows])


def methods_table(methods: MethodMetrics, paper_ade_m: Mapping[str, float]) -> str:
    """All measures of one scene, a row per method, with the paper's error beside ours."""
    header = [
        "method",
        "ADE [m] (95 % interval)",
        "FDE [m]",
        "ADE, moving [m]",
        "points in obstacles",
        "paths that collide",
        f"ADE minus {label(YARDSTICK)} [m]",
        "paper's ADE [m]",
    ]
    rows = []
    for name in ordered(methods):
        found = methods[name]
        title = f"**{label(name)}**" if name == MODEL else label(name)
        paper = f"{paper_ade_m[name]:.3f}" if name in paper_ade_m else NOTHING
        rows.append(
            [
                title,
                f"{found['ade_m']:.3f} ({interval(found['ade_m_ci95'])})",
                f"{found['fde_m']:.3f}",
                f"{found['moving_ade_m']:.3f}",
                _share(found["obstacle_share"]),
                _share(found["collision_share"]),
                difference(name, found),
                paper,
            ]
        )
    return markdown_table(header, rows)


def scenes_table(scenes: Mapping[str, MethodMetrics], first_column: str) -> str:
    """ADE of every method in every scene, a row per scene."""
    names = ordered({name for methods in scenes.values() for name in methods})
    header = [first_column, "windows", *map(label, names), f"{label(MODEL)} minus {label(YARDSTICK)}"]
    rows = []
    for scene, methods in scenes.items():
        windows = max(found["windows"] for found in methods.values())
        errors = [f"{methods[name]['ade_m']:.3f}" if name in methods else NOTHING for name in names]
        gap = difference(MODEL, methods[MODEL]) if MODEL in methods else NOTHING
        rows.append([scene, str(windows), *errors, gap])
    return markdown_table(header, rows)


def calibration_table(methods: MethodMetrics, step_s: float = 0.3) -> str:
    """What error ellipses hold, a row per method that tells them; nothing if none does.

    Args:
        methods: measures of one scene.
        step_s: duration of a prediction step, s.
    """
    names = telling(methods)
    if not names:
        return ""
    rows = [[label(name), *calibration_cells(methods[name])] for name in names]
    return markdown_table(calibration_header(methods[names[0]], step_s), rows)


def calibration_header(found: dict, step_s: float = 0.3) -> list[str]:
    """What stands above a method's name and its `calibration_cells`."""
    steps = shown_steps(len(found["per_step_nll"]))
    times = " / ".join(f"{(step + 1) * step_s:.1f}" for step in steps)
    regions = [f"in the {100 * share:.0f} % ellipse [%]" for share in REGIONS]
    return [f"after {times} s", *regions, "negative log likelihood [nats]"]


def telling(methods: MethodMetrics) -> list[str]:
    """Methods that told covariances, in the order of display."""
    return [name for name in ordered(methods) if "per_step_nll" in methods[name]]


def calibration_cells(found: dict) -> list[str]:
    """A method's share of true positions in each region, %, then its surprise, nats: at `shown_steps`."""
    steps = shown_steps(len(found["per_step_nll"]))
    shares = [[100.0 * s for s in found[f"per_step_coverage_{100 * share:.0f}"]] for share in REGIONS]
    cells = [" / ".join(f"{values[step]:.0f}" for step in steps) for values in shares]
    return [*cells, " / ".join(f"{found['per_step_nll'][step]:.2f}" for step in steps)]


def findings_table(findings: Sequence[tuple[str, Finding]]) -> str:
    """Expectations, the figures that decide, and the decision."""
    rows = [[scene, f.claim, f.measured, f.verdict] for scene, f in findings]
    return markdown_table(["where", "expected", "measured", "verdict"], rows, texts=4)


def difference(name: str, measures: dict) -> str:
    """Paired difference to the yardstick with its interval, signed."""
    if name == YARDSTICK or measures.get("ade_m_minus_reference") is None:
        return NOTHING
    gap = f"{measures['ade_m_minus_reference']:+.3f}"
    bounds = measures.get("ade_m_minus_reference_ci95")
    return f"{gap} ({interval(bounds, '+')})" if bounds else gap


def interval(bounds: Sequence[float], sign: str = "") -> str:
    """Two ends of an interval, e.g. `0.371 to 0.392`."""
    return f"{bounds[0]:{sign}.3f} to {bounds[1]:{sign}.3f}"


def _share(share: float | None) -> str:
    return NOTHING if share is None else f"{100.0 * share:.2f} %"
