"""eth_ucy_gather: the figures of all folds of the comparison with the literature."""

from pathlib import Path

import numpy as np
from omegaconf import DictConfig

from pedpred.baselines.present_motion import STRONGEST
from pedpred.config import stage
from pedpred.errors import InputError
from pedpred.evaluation.scores import Resampling, pool_scores, read_scores
from pedpred.evaluation.summary import Figures, coverages, summarise_methods
from stages.eth_ucy import TOP
from stages.gather import resampling_of, write_figures


def figures_of(cfg: DictConfig, name: str, settings: Resampling) -> dict[str, Figures]:
    """Figures at the scenes of a fold, whose recordings are pooled: scene -> method -> figures."""
    figures: dict[str, Figures] = {}
    if not (evaluated := TOP / "scores" / name).is_dir():
        raise InputError(evaluated, "scores", "there are none")
    for scene in cfg.literature.folds[name].test:
        recordings = [f"{recording}.parquet" for recording in cfg.literature.scenes[scene]]
        pools = {
            folder.name: pool_scores([read_scores(folder / file) for file in recordings])
            for folder in sorted((evaluated / scene).glob("*"))
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
    settings, gathered = resampling_of(cfg), {}
    for name, fold in cfg.literature.folds.items():
        for scene, figures in figures_of(cfg, name, settings).items():
            gathered[scene if [scene] == list(fold.test) == [name] else f"{scene}_{name}"] = figures
    write_figures(Path(cfg.get("out", "reports")), "literature", gathered, gathered)


if __name__ == "__main__":
    main()
