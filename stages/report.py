"""Draw and write the page on simulated or on real people: `reports/<key>.md` and its pictures."""

from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import stage, stage_key
from pedpred.files import write_json, write_text
from pedpred.networks.autoencoder import read_autoencoder
from pedpred.report.canvas import write_png
from pedpred.report.curves import read_curve
from pedpred.report.gallery import real_gallery, simulation_gallery
from pedpred.report.measures import read_metrics
from pedpred.report.overview import errors_m, horizon_table, overall
from pedpred.report.pages import real_page, simulation_page
from pedpred.storage.scenes import read_scenes
from pedpred.storage.windows import read_windows

PAGES = {"sim": (simulation_gallery, simulation_page), "real": (real_gallery, real_page)}
KINDS = {"sim": "simulated", "real": "real"}


def gathered(key: str) -> tuple:
    """Metrics, scenes by data set, forecasts and curves of simulated or real people; the auto-encoder."""
    metrics = read_metrics(Path("reports/metrics") / f"{key}.json")
    folder = Path("data/scenes", KINDS[key])
    tested = [name for name in metrics if (folder / name).is_dir()]
    others = sorted({path.name for path in folder.iterdir() if path.is_dir()} - set(tested))  # of trainings
    scenes = {name: list(read_scenes(folder / name)) for name in [*tested, *others]}
    forecasts = sorted(Path("data/forecasts", KINDS[key]).glob("*/*.parquet"), key=lambda path: path.stem)
    windows = {path.stem: read_windows(path) for path in forecasts}
    curves = {table.stem: read_curve(table) for table in sorted(Path("reports/curves", key).glob("*.tsv"))}
    curves = {name: curve for name, curve in curves.items() if len(curve)}  # a copied network has none
    return metrics, scenes, windows, curves, read_autoencoder(Path("models/autoencoder"))[0]


@stage
def main(cfg: DictConfig) -> None:
    """Write one page and its pictures."""
    key = stage_key(cfg)
    gallery, page = PAGES[key]
    out = Path(cfg.get("out", "reports"))
    metrics, *others = gathered(key)
    sections = gallery(metrics, *others)
    for picture in (picture for section in sections for picture in section.pictures):
        write_png(picture.figure, out / key / f"{picture.name}.png")
    write_text(out / f"{key}.md", page(metrics, sections, key))
    for name, methods in overall(metrics).items():
        table = horizon_table(methods).to_csv(sep="\t", index=False, float_format="%.4f")
        write_text(out / "horizon" / key / f"{name}.tsv", table)
    write_json(out / "ade" / f"{key}.json", {name: errors_m(m) for name, m in overall(metrics).items()})


if __name__ == "__main__":
    main()
