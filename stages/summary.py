"""Join the pages on simulated forecasts, real ones and the simulation itself into `reports/report.md`."""

from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import stage
from pedpred.files import write_text
from pedpred.report.document import joined


@stage
def main(cfg: DictConfig) -> None:
    """Read the pages, write one; links to pictures stay relative to `reports/`."""
    pages = [Path("reports", f"{key}.md").read_text() for key in ("sim", "real", "simulation")]
    write_text(Path(cfg.get("out", "reports/report.md")), joined(pages))


if __name__ == "__main__":
    main()
