"""evaluate_real: the metrics of single places, gathered in one file."""

from functools import partial
from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import stage, stage_key
from pedpred.errors import StorageError
from pedpred.files import read_json, write_json


@stage
def main(cfg: DictConfig) -> None:
    """Read data/metrics/<name>/*.json, write reports/metrics/<name>.json in the order of conf/evaluation."""
    name = stage_key(cfg)
    gathered: dict = {}
    for place in cfg.evaluation[name]:
        path = Path("data/metrics", name, f"{place}.json")
        gathered |= read_json(
            path, partial(StorageError, path, "file", remedy="Evaluate it again (dvc repro)")
        )
    write_json(Path(cfg.get("out", f"reports/metrics/{name}.json")), gathered)


if __name__ == "__main__":
    main()
