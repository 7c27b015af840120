"""fetch@source: the raw files of a data set, unaltered, or a note that no mirror has them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from pedpred.config import configured, one_of, part, read_table, stage, stage_key
from pedpred.sources.mirrors import Mirrors, provide


def mirrors_of(cfg: Mapping[str, Any], name: str) -> Mirrors:
    """Read where the raw files of a data set may lie, from the file that its row names."""
    file = one_of("mirrors", name, part(cfg, "mirrors"))
    with configured(file):
        return Mirrors.parse(name, read_table(file))


@stage("name")
def main(cfg: DictConfig) -> None:
    """Write data/raw/<name>."""
    name = stage_key(cfg)
    provide(mirrors_of(cfg, name), Path(cfg.get("out") or f"data/raw/{name}"))


if __name__ == "__main__":
    main()
