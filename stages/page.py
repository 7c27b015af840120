"""Write the page: `reports/index.html`, one file with the answer, plots, pictures and replays."""

from functools import partial
from pathlib import Path

from omegaconf import DictConfig
from pandas import DataFrame

from pedpred.config import stage
from pedpred.errors import StorageError
from pedpred.files import read_json, write_text
from pedpred.report.ablation import ablation_sections
from pedpred.report.gallery import real_gallery, simulation_gallery
from pedpred.report.page.build import Contents, page
from pedpred.report.page.player import replay
from pedpred.report.simulation_page import flow_section
from stages.report import gathered

GALLERIES = {"sim": ("Simulated people", simulation_gallery), "real": ("Real people", real_gallery)}


@stage
def main(cfg: DictConfig) -> None:
    """Gather what the other stages wrote; write the page to `out`."""
    metrics, sections, replays = {}, {}, {}
    curves: dict[str, DataFrame] = {}
    others = {
        path.stem: read_json(path, partial(StorageError, path, "file", remedy="Write it again (dvc repro)"))
        for path in Path("reports/metrics").glob("*.json")
    }
    for key, (title, gallery) in GALLERIES.items():
        metrics[key], scenes, windows, own, autoencoder = gathered(key)
        sections[title] = gallery(metrics[key], scenes, windows, own, autoencoder)
        curves |= own
        place = {scene.name: scene for data_set in scenes.values() for scene in data_set}
        for name in cfg.page.replays[key]:
            replays[name] = replay(place[name], windows[name], cfg.page.duration_s)
    sections["Ablations"] = ablation_sections(Path("conf/ablations"), Path("reports/ablations"))
    sections["The walking itself"] = [flow_section(others["walking"]["corridor_flow"])]
    shown = [replays[name] for names in cfg.page.replays.values() for name in names]
    text = page(
        Contents(
            metrics["sim"],
            metrics["real"],
            sections,
            curves,
            shown,
            others.get("literature", {}),
            others.get("latency", {}).get("updates", []),
        )
    )
    write_text(Path(cfg.get("out", "reports/index.html")), text)


if __name__ == "__main__":
    main()
