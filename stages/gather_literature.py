"""gather_literature: the figures of all folds of the comparison with the literature."""

from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from pedpred.baselines.present_motion import STRONGEST
from pedpred.config import configured, plain, stage
from pedpred.evaluation.scores import Resampling, pool_scores, read_scores
from pedpred.evaluation.summary import summarise_methods
from pedpred.fields import parsed
from pedpred.files import write_json
from pedpred.literature.settings import ComparisonSettings, LiteratureFold
from stages.literature import comparison_of


def figures_of(
    comparison: ComparisonSettings, name: str, fold: LiteratureFold, settings: Resampling
) -> dict[str, Any]:
    """Figures at the scenes of a fold, whose recordings are pooled: scene -> method -> figures."""
    figures: dict[str, Any] = {}
    for scene in fold.test:
        top, recordings = Path("data/literature", name, scene), comparison.scenes[scene]
        pools = {
            folder.name: pool_scores(
                [read_scores(folder / f"{recording}.parquet") for recording in recordings]
            )
            for folder in sorted(top.glob("*"))
        }
        if not pools:
            continue
        seeds = [f"{comparison.network}_{seed}" for seed in comparison.seeds]
        spread = [float(pools.pop(seed).values["ade_m"].mean()) for seed in seeds]
        figures[scene] = summarise_methods(pools, STRONGEST, settings)
        figures[scene][comparison.network]["ade_m_of_seeds"] = spread
    return figures


@stage
def main(cfg: DictConfig) -> None:
    """Write reports/metrics/literature.json, entries <scene>, or <scene>_<fold>; and reports/ade."""
    comparison, out = comparison_of(cfg), Path(cfg.get("out", "reports"))
    choices = plain(cfg.comparison)
    choices.pop("reference")
    with configured("comparison"):
        settings = parsed(Resampling, choices)
    gathered: dict[str, Any] = {}
    for name, fold in comparison.folds.items():
        for scene, figures in figures_of(comparison, name, fold, settings).items():
            gathered[scene if (scene,) == fold.test == (name,) else f"{scene}_{name}"] = figures
    write_json(out / "metrics/literature.json", gathered)
    errors_m = {
        key: {method: summary["ade_m"] for method, summary in rows.items()} for key, rows in gathered.items()
    }
    write_json(out / "ade/literature.json", errors_m)


if __name__ == "__main__":
    main()
