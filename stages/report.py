"""Draw and write the page on simulated or on real people: `reports/<key>.md` and its pictures."""

from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import stage, stage_key
from pedpred.files import write_text
from pedpred.report.canvas import write_png
from pedpred.report.curves import read_curve
from pedpred.report.gallery import real_gallery, simulation_gallery
from pedpred.report.metrics import read_metrics
from pedpred.report.pages import real_page, simulation_page
from pedpred.storage.scenes import read_scenes
from pedpred.storage.windows import read_windows

PAGES = {"sim": (simulation_gallery, simulation_page), "real": (real_gallery, real_page)}
TRAINED_IN = {"sim": ["corridor", "main"], "real": []}
"""Scene sets that no forecast is about, shown nevertheless."""


@stage
def main(cfg: DictConfig) -> None:
    """Read metrics, forecasts, scenes and training curves; write one page."""
    key = stage_key(cfg)
    gallery, page = PAGES[key]
    out = Path(cfg.get("out", "reports"))
    metrics = read_metrics(Path("reports/metrics") / f"{key}.json")
    windows = {p.stem: read_windows(p) for p in sorted(Path("data/forecasts", key).glob("*.parquet"))}
    tested = [name for name in metrics if Path("data/scenes", name).is_dir()]
    scenes = {name: list(read_scenes(Path("data/scenes", name))) for name in [*tested, *TRAINED_IN[key]]}
    curves = {table.stem: read_curve(table) for table in sorted(Path("reports/curves", key).glob("*.tsv"))}
    sections = gallery(metrics, scenes, windows, curves)
    for picture in (picture for section in sections for picture in section.pictures):
        write_png(picture.figure, out / key / f"{picture.name}.png")
    write_text(out / f"{key}.md", page(metrics, sections, key))


if __name__ == "__main__":
    main()
