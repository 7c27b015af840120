"""report@study: the Markdown page on a study, `reports/<study>.md`, and its pictures."""

from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import plain, stage, stage_key
from pedpred.files import write_text
from pedpred.forecasting import Methods
from pedpred.report.canvas import write_png
from pedpred.report.error_plots import horizon_table
from pedpred.report.findings import Paper
from pedpred.report.gallery import gallery
from pedpred.report.gather import document, gather


@stage
def main(cfg: DictConfig) -> None:
    """Write the page, its pictures, and the figures that `dvc plots` compares."""
    key, out = stage_key(cfg), Path(cfg.get("out", "reports"))
    methods, paper = Methods.parse(plain(cfg.methods)), Paper.parse(plain(cfg.paper))
    evaluated = gather(key, plain(cfg.folds[key]))
    page = document(evaluated, gallery(evaluated, methods), methods, paper)
    for folder in (out / key, out / "horizon" / key):
        folder.mkdir(parents=True, exist_ok=True)  # also if no place is available
    for picture in page.pictures:
        write_png(picture.figure, out / key / f"{picture.name}.png")
    write_text(out / f"{key}.md", page.markdown(key) + "\n")
    for result in evaluated.results:
        table = horizon_table(result, methods).to_csv(sep="\t", index=False, float_format="%.4f")
        write_text(out / "horizon" / key / f"{result.name}.tsv", table)


if __name__ == "__main__":
    main()
