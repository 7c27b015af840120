"""eth_ucy_gather: the figures of all folds of the comparison with the literature."""

from pathlib import Path

import numpy as np
from omegaconf import DictConfig

from pedpred.baselines.present_motion import STRONGEST
from pedpred.config import stage
from pedpred.errors import InputError
from pedpred.evaluation.scores import Resampling, pool_scores, read_scores
from pedpred.evaluation.summary import Figures, coverages, summarise_methods
from stages.gather import resampling_of, write_figures
from stages.sets import tables_of


def figures_of(cfg: DictConfig, folder: Path, scene: str, settings: Resampling) -> Figures:
    """Figures at a scene, whose recordings are pooled, of the scores of a fold; none without recordings."""
    recordings = [f"{recording}.parquet" for recording in cfg.scenes[scene]]
    pools = {
        method.name: pool_scores([read_scores(method / file) for file in recordings])
        for method in sorted(folder.iterdir())
    }
    if not pools:
        return {}
    seeds = {network: [pools.pop(f"{network}_{seed}") for seed in cfg.seeds] for network in cfg.networks}
    figures = summarise_methods(pools, STRONGEST, settings)
    for network, scores in seeds.items():
        errors_m = [float(each.values["ade_m"].mean()) for each in scores]
        regions = coverages(np.concatenate([each.inside for each in scores]))
        figures[network] |= {"ade_m_of_seeds": errors_m} | regions
    return figures


@stage("study")
def main(cfg: DictConfig) -> None:
    """Write reports/metrics/literature.json, entries <scene>, or <scene>_<fold>; and reports/ade."""
    cfg = tables_of(cfg)
    settings = resampling_of(cfg)
    gathered: dict[str, Figures] = {}
    for name, fold in cfg.folds.eth_ucy.items():
        if not (folder := Path("data/eth_ucy/scores", name)).is_dir():
            raise InputError(folder, "scores", "there are none")
        whole = [key for key, parts in cfg.scenes.items() if {f"real/{it}" for it in parts} <= {*fold.test}]
        figures = {scene: figures_of(cfg, folder, scene, settings) for scene in whole}
        gathered |= {key if key == name else f"{key}_{name}": own for key, own in figures.items() if own}
    write_figures(Path(cfg.get("out", "reports")), "literature", gathered, gathered)


if __name__ == "__main__":
    main()
