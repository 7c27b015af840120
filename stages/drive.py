"""drive@row: all forecasters drive a robot through the same episodes, at a place or in simulated worlds."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from pedpred.config import configured, one_of, part, stage, stage_key
from pedpred.driving.study import StudySettings, drive_block, write_study
from pedpred.settings import load
from pedpred.workers import in_parallel


def study_of(cfg: Mapping[str, Any]) -> StudySettings:
    """Read which drives are done."""
    with configured("driving"):
        values = {key: value for key, value in part(cfg, "driving").items() if key != "exports"}
        settings: StudySettings = load(StudySettings, values)
    return settings


@stage("name")
def main(cfg: DictConfig) -> None:
    """Write data/drives/<name> and reports/metrics/driving/<name>.json, several episodes at once."""
    name, settings, out = stage_key(cfg), study_of(cfg), Path(cfg.get("out", "."))
    one_of("name", name, settings.places)
    tasks = [(settings, name, block) for block in settings.blocks()]
    rows = [row for done in in_parallel(drive_block, tasks, f"drive {name}", "block") for row in done]
    metrics = out / f"reports/metrics/driving/{name}.json"
    write_study(settings, name, rows, out / "data/drives" / name, metrics)


if __name__ == "__main__":
    main()
