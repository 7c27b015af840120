"""report_study@study: the page on a study beside the main pipeline, and its pictures."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import one_of, stage, stage_key
from pedpred.files import write_text
from pedpred.report.document import Section, write_pictures
from pedpred.report.drives import drives_section, read_shown
from pedpred.report.literature import literature_section, read_published
from pedpred.report.methods import Methods
from pedpred.report.results import metrics_now, results_frame


def drives_of(places: Iterable[str]) -> Section:
    """Read what is known of drives at rows of conf/driving; a section without blocks where nobody drove.

    Files of a row that was taken out stay until somebody deletes them.
    """
    known, drives = metrics_now(Path("reports/metrics/driving")), Path("data/drives")
    driven = [name for name in sorted(places) if known.get(name) and (drives / name).exists()]
    return drives_section({name: (known[name], read_shown(drives / name)) for name in driven})


def drives(cfg: DictConfig) -> Section:
    """Write the section on robots with forecasters in the loop."""
    return drives_of(cfg.driving.places)


def eth_ucy(cfg: DictConfig) -> Section:
    """Write the section that compares with the literature."""
    figures = {"literature": metrics_now(Path("reports/metrics")).get("literature")}
    methods = Methods.read(Path(), cfg.comparison.reference)
    return literature_section(results_frame(figures), read_published(Path()), methods)


SECTIONS = {"drives": drives, "eth_ucy": eth_ucy}


@stage("name")
def main(cfg: DictConfig) -> None:
    """Write reports/<name>.md and the folder of its pictures."""
    name, out = stage_key(cfg), Path(cfg.get("out", "reports"))
    section = one_of("name", name, SECTIONS)(cfg)
    write_pictures(section, out / name)
    write_text(out / f"{name}.md", section.markdown(name) + "\n")


if __name__ == "__main__":
    main()
