"""eth_ucy_gather: the figures of all folds of the comparison with the literature."""

from pathlib import Path
from typing import Any

import numpy as np
from omegaconf import DictConfig

from pedpred.baselines.present_motion import STRONGEST
from pedpred.config import configured, plain, stage
from pedpred.errors import InputError
from pedpred.evaluation.scores import Resampling, pool_scores, read_scores
from pedpred.evaluation.summary import coverages, summarise_methods
from pedpred.files import write_json
from pedpred.settings import load
from stages.eth_ucy import TOP


def figures_of(cfg: DictConfig, name: str, settings: Resampling) -> dict[str, Any]:
    """Figures at the scenes of a fold, whose recordings are pooled: scene -> method -> figures."""
    figures: dict[str, Any] = {}
    if not (evaluated := TOP / "scores" / name).is_dir():
        raise InputError(evaluated, "scores", "there are none")
    for scene in cfg.literature.folds[name].test:
        top, recordings = TOP / "scores" / name / scene, cfg.literature.scenes[scene]
        pools = {
            folder.name: pool_scores(
                [read_scores(folder / f"{recording}.parquet") for recording in recordings]
            )
            for folder in sorted(top.glob("*"))
        }
        if not pools:
            continue
        seeds = {
            network: [pools.pop(f"{network}_{s}") for s in cfg.literature.seeds]
            for network in cfg.literature.networks
        }
        figures[scene] = summarise_methods(pools, STRONGEST, settings)
        for network, scores in seeds.items():
            errors_m = [float(each.values["ade_m"].mean()) for each in scores]
            regions = coverages(np.concatenate([each.inside for each in scores]))
            figures[scene][network] |= {"ade_m_of_seeds": errors_m} | regions
    return figures


@stage()
def main(cfg: DictConfig) -> None:
    """Write reports/metrics/literature.json, entries <scene>, or <scene>_<fold>; and reports/ade."""
    out, choices = Path(cfg.get("out", "reports")), plain(cfg.comparison)
    choices.pop("reference")
    with configured("comparison"):
        settings = load(Resampling, choices)
    gathered: dict[str, Any] = {}
    for name, fold in cfg.literature.folds.items():
        for scene, figures in figures_of(cfg, name, settings).items():
            gathered[scene if [scene] == list(fold.test) == [name] else f"{scene}_{name}"] = figures
    write_json(out / "metrics/literature.json", gathered)
    errors_m = {
        key: {method: summary["ade_m"] for method, summary in rows.items()} for key, rows in gathered.items()
    }
    write_json(out / "ade/literature.json", errors_m)


if __name__ == "__main__":
    main()
