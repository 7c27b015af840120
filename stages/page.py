"""Write the page: `reports/index.html`, one file with the answer, plots, pictures and replays."""

import json
from pathlib import Path

from omegaconf import DictConfig
from pandas import DataFrame

from pedpred.config import stage
from pedpred.files import write_text
from pedpred.report.curves import read_curve
from pedpred.report.gallery import real_gallery, simulation_gallery
from pedpred.report.metrics import read_metrics
from pedpred.report.page.build import Contents, page
from pedpred.report.page.replay import replay
from pedpred.storage.scenes import read_scenes
from pedpred.storage.windows import read_windows

GALLERIES = {"sim": ("Simulated people", simulation_gallery), "real": ("Real people", real_gallery)}


@stage
def main(cfg: DictConfig) -> None:
    """Read metrics, forecasts, scenes and training curves; write the page to `out`."""
    metrics, sections, replays = {}, {}, {}
    curves: dict[str, DataFrame] = {}
    for key, (title, gallery) in GALLERIES.items():
        metrics[key] = read_metrics(Path("reports/metrics") / f"{key}.json")
        windows = {p.stem: read_windows(p) for p in sorted(Path("data/forecasts", key).glob("*.parquet"))}
        folders = [folder for name in metrics[key] if (folder := Path("data/scenes", name)).is_dir()]
        scenes = {scene.name: scene for folder in folders for scene in read_scenes(folder)}
        own = {table.stem: read_curve(table) for table in sorted(Path("reports/curves", key).glob("*.tsv"))}
        sections[title] = gallery(metrics[key], scenes, windows, own)
        curves |= own
        for name in cfg.page.replays[key]:
            replays[name] = replay(scenes[name], windows[name], cfg.page.duration_s)
    shown = [replays[name] for names in cfg.page.replays.values() for name in names]
    others = {path.stem: json.loads(path.read_text()) for path in Path("reports/metrics").glob("*.json")}
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
