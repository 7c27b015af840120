"""Stage `fetch`: the raw recordings, from the first mirror that has them unaltered."""

from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import stage
from pedpred.sources import mirrors


@stage
def main(cfg: DictConfig) -> None:
    """Fill data/raw/ewap."""
    target = Path(cfg.get("out") or "data/raw/ewap")
    mirrors.fetch("ewap", target, cfg.mirrors.folders, cfg.mirrors.archives, cfg.mirrors.timeout_s)


if __name__ == "__main__":
    main()
