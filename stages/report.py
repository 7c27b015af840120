"""Everything that people read about the results: Markdown pages, their pictures, and `reports/index.html`."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from pedpred.config import configured, plain, read_table, stage
from pedpred.files import write_text
from pedpred.report.ablation import ablation_sections
from pedpred.report.document import Section, join_pages, write_pictures
from pedpred.report.findings import Paper
from pedpred.report.gallery import draw_gallery
from pedpred.report.gather import Evaluated, gather, study_page
from pedpred.report.methods import Methods
from pedpred.report.page.build import Contents, render_page
from pedpred.report.page.player import Replay, ReplaySettings, replay
from pedpred.report.places import places_section
from pedpred.report.plots import horizon_table
from pedpred.report.results import metrics_now
from pedpred.report.simulation_page import flow_section
from pedpred.settings import load, load_together
from stages.folds import trained_sets
from stages.row_types import PageRows

REPORT = Path("conf/report")
PAGES = ("sim", "real")
"""Studies with a page of their own; the others are compared with these."""


def write_study(evaluated: Evaluated, text: Section, methods: Methods, out: Path) -> None:
    """Write the page on a study, its pictures, and the figures that `dvc plots` compares."""
    write_pictures(text, out / evaluated.study)
    write_text(out / f"{evaluated.study}.md", text.markdown(evaluated.study) + "\n")
    (out / "horizon" / evaluated.study).mkdir(parents=True, exist_ok=True)
    for result in evaluated.results:
        table = horizon_table(result, methods).to_csv(sep="\t", index=False, float_format="%.4f")
        write_text(out / "horizon" / evaluated.study / f"{result.name}.tsv", table)


def replays_of(
    rows: PageRows, shown: ReplaySettings, evaluated: Mapping[str, Evaluated], methods: Methods
) -> list[Replay]:
    """Choose what the page replays: scenes that were tested."""
    named = [(evaluated[s], name) for s, names in rows.replays.items() if s in evaluated for name in names]
    tested = [(study.scene(name), study.windows[name]) for study, name in named if name in study.windows]
    return [replay(*one, shown, methods) for one in tested]


def read_paper() -> Paper:
    """Read what the publication reports and leads to expect."""
    with configured("conf/report/paper.yaml"):
        return load(Paper, read_table(REPORT / "paper.yaml"))


def read_page() -> tuple[PageRows, ReplaySettings]:
    """Read what the page replays."""
    with configured("conf/report/page.yaml"):
        rows, shown = load_together([PageRows, ReplaySettings], read_table(REPORT / "page.yaml"))
    return rows, shown


def expanded(folds: Mapping[str, Any], places: Iterable[str]) -> dict[str, Any]:
    """Folds with the names of the sets that they train on."""
    places = list(places)
    return {
        name: {**fold, "train": trained_sets(fold, places)} if "train" in fold else fold
        for name, fold in folds.items()
    }


@stage()
def main(cfg: DictConfig) -> None:
    """Gather what the other stages wrote, draw every picture once, write all pages below `out`."""
    out, figures = Path(cfg.get("out", "reports")), metrics_now(Path("reports/metrics"))
    methods, paper, (page, shown) = Methods.read(Path(), cfg.comparison.reference), read_paper(), read_page()
    studies = {name: expanded(plain(folds), cfg.places) for name, folds in cfg.folds.items()}
    evaluated = {study: gather(study, folds) for study, folds in studies.items()}
    pages = {study: evaluated[study] for study in PAGES if study in evaluated}
    galleries = {study: draw_gallery(results, methods) for study, results in pages.items()}
    for study, results in pages.items():
        write_study(results, study_page(results, galleries[study], methods, paper), methods, out)
    places = places_section(list(evaluated.values()), methods)
    write_pictures(places, out / "places")
    texts = [(out / f"{study}.md").read_text() for study in pages]
    walking = Path("reports/simulation.md").read_text()
    write_text(out / "report.md", join_pages([places.markdown("places"), *texts, walking]))
    ablations = ablation_sections(Path("conf/ablations"), Path("reports/ablations"), methods)
    contents = Contents(
        evaluated=list(pages.values()),
        galleries=list(galleries.values()),
        replays=replays_of(page, shown, evaluated, methods),
        methods=methods,
        paper=paper,
        avif_speed=page.avif_speed,
        further=[Section("Ablations", ablations), flow_section(figures["walking"]["corridor_flow"])],
        latency=figures.get("latency", {}).get("updates", []),
        places=places.blocks,
    )
    if any(contents.results for contents in pages.values()):
        write_text(out / "index.html", render_page(contents))


if __name__ == "__main__":
    main()
