"""Write the page: `reports/index.html`, one file with the answer, plots, pictures and replays."""

from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import configured, plain, stage
from pedpred.fields import parsed
from pedpred.files import write_text
from pedpred.forecasting import Methods
from pedpred.report.ablation import ablation_sections
from pedpred.report.comparison import metrics_now
from pedpred.report.document import Section
from pedpred.report.findings import Paper
from pedpred.report.gather import gather
from pedpred.report.page.build import Contents, page
from pedpred.report.page.player import ReplaySettings, replay
from pedpred.report.places import places_section
from pedpred.report.simulation_page import flow_section


@stage
def main(cfg: DictConfig) -> None:
    """Gather what the other stages wrote; write the page to `out`."""
    methods, figures = Methods.parse(plain(cfg.methods)), metrics_now(Path("reports/metrics"))
    evaluated = {study: gather(study, plain(folds)) for study, folds in cfg.folds.items()}
    kept = plain(cfg.page)
    chosen = kept.pop("replays")
    with configured("page"):
        shown = parsed(ReplaySettings, kept)
    replays = [
        replay(evaluated[key].scene(name), evaluated[key].windows[name], shown, methods)
        for key, names in chosen.items()
        for name in names
        if name in evaluated[key].windows
    ]
    ablations = ablation_sections(Path("conf/ablations"), Path("reports/ablations"), methods)
    contents = Contents(
        [evaluated["sim"], evaluated["real"]],
        replays,
        methods,
        Paper.parse(plain(cfg.paper)),
        [Section("Ablations", ablations), flow_section(figures["walking"]["corridor_flow"])],
        figures.get("literature", {}),
        plain(cfg.literature)["published"],
        figures.get("latency", {}).get("updates", []),
        places_section(list(evaluated.values()), methods).blocks,
    )
    write_text(Path(cfg.get("out", "reports/index.html")), page(contents))


if __name__ == "__main__":
    main()
