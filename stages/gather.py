"""gather@kind: the metrics of all folds of one kind in one file."""

from functools import partial
from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import stage
from pedpred.errors import ConfigError, StorageError
from pedpred.files import read_json, write_json


@stage
def main(cfg: DictConfig) -> None:
    """Read data/metrics/<kind>/<fold>.json, write them to `out` in the order of conf/folds."""
    gathered: dict = {}
    for fold in cfg.folds[cfg.kind]:
        path = Path("data/metrics", cfg.kind, f"{fold}.json")
        found = read_json(path, partial(StorageError, path, "file"))
        if twice := sorted(set(found) & set(gathered)):
            raise ConfigError(
                f"folds.{cfg.kind}.{fold}.test", twice, "another fold tests it too; name it once"
            )
        gathered |= found
    write_json(Path(cfg.out), gathered)


if __name__ == "__main__":
    main()
