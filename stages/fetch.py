"""fetch@source: the raw files of a data set, unaltered, or a note that no mirror has them."""

from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import configured, plain, stage, stage_key
from pedpred.sources.mirrors import Mirrors, provide


@stage("name")
def main(cfg: DictConfig) -> None:
    """Write data/raw/<name>."""
    name = stage_key(cfg)
    with configured(f"mirrors.{name}"):
        provide(Mirrors.parse(name, plain(cfg.mirrors[name])), Path(cfg.get("out") or f"data/raw/{name}"))


if __name__ == "__main__":
    main()
