"""Join the real places side by side and the pages on all studies into `reports/report.md`."""

from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import plain, stage
from pedpred.files import write_text
from pedpred.forecasting import Methods
from pedpred.report.canvas import write_png
from pedpred.report.document import joined
from pedpred.report.gather import gather
from pedpred.report.places import places_section


@stage
def main(cfg: DictConfig) -> None:
    """Compare the places, read the other pages, write one; links to pictures stay relative to `reports/`."""
    out, methods = Path(cfg.get("out", "reports")), Methods.parse(plain(cfg.methods))
    places = places_section([gather(study, plain(folds)) for study, folds in cfg.folds.items()], methods)
    (out / "places").mkdir(parents=True, exist_ok=True)  # also if no place is available
    for picture in places.pictures:
        write_png(picture.figure, out / "places" / f"{picture.name}.png")
    pages = [Path("reports", f"{key}.md").read_text() for key in ("sim", "real", "simulation")]
    write_text(out / "report.md", joined([places.markdown("places"), *pages]))


if __name__ == "__main__":
    main()
