"""gather@study: the metrics of all folds of a study in one file."""

from functools import partial
from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import stage, stage_key
from pedpred.errors import ConfigError, StorageError
from pedpred.files import read_json, write_json


@stage
def main(cfg: DictConfig) -> None:
    """Read data/metrics/<study>/<fold>.json, write reports/metrics/<study>.json in the order of conf/folds.

    The ADE of the test sets alone goes to reports/ade/<study>.json.
    """
    study, out = stage_key(cfg), Path(cfg.get("out", "reports"))
    gathered: dict = {}
    tested: dict = {}
    for name, fold in cfg.folds[study].items():
        path = Path("data/metrics", study, f"{name}.json")
        found = read_json(path, partial(StorageError, path, "file"))
        if twice := sorted(set(found) & set(gathered)):
            raise ConfigError(f"folds.{study}.{name}.test", twice, "another fold tests it too; name it once")
        gathered |= found
        tested |= {key: found[key] for key in (test.split("/")[1] for test in fold.test) if key in found}
    write_json(out / "metrics" / f"{study}.json", gathered)
    errors_m = {key: {m: own["ade_m"] for m, own in found.items()} for key, found in tested.items()}
    write_json(out / "ade" / f"{study}.json", errors_m)


if __name__ == "__main__":
    main()
