"""gather@study: the figures of all methods at the test sets of a study."""

import itertools
from collections.abc import Iterable, Mapping
from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import configured, plain, stage, stage_key
from pedpred.errors import ConfigError, InputError
from pedpred.evaluation.forecasts import result_folders
from pedpred.evaluation.scores import Resampling, Scores, read_scores
from pedpred.evaluation.summary import Figures, summarise_test_set
from pedpred.files import write_json
from pedpred.settings import load


def scores_at(cfg: DictConfig, models: str, at: str) -> dict[str, dict[str, Scores]]:
    """Scores at a test set, kind/name, with the weights of the main training, or of a fold.

    Returns scene -> method -> scores, methods in the order of the configuration.
    """
    by_test: dict[str, dict[str, Scores]] = {}
    for method in itertools.chain(*cfg.methods.values()):
        for folder in result_folders(Path("data/scores"), method, models):
            for path in sorted((folder / at).glob("*.parquet")):
                by_test.setdefault(path.stem, {})[method] = read_scores(path)
    return by_test


def resampling_of(cfg: DictConfig) -> Resampling:
    """Read the size of the bootstrap behind intervals."""
    choices = {key: value for key, value in plain(cfg.comparison).items() if key != "reference"}
    with configured("comparison"):
        settings: Resampling = load(Resampling, choices)
    return settings


def write_figures(out: Path, study: str, figures: Mapping[str, Figures], tested: Iterable[str]) -> None:
    """Write metrics/<study>.json: entry -> method -> figures, and ade/<study>.json of test sets alone."""
    errors_m = {key: {method: row["ade_m"] for method, row in figures[key].items()} for key in tested}
    write_json(out / "metrics" / f"{study}.json", figures)
    write_json(out / "ade" / f"{study}.json", errors_m)


@stage("name")
def main(cfg: DictConfig) -> None:
    """Read data/scores, write reports/metrics/<study>.json in the order of conf/folds.

    The ADE of the test sets alone goes to reports/ade/<study>.json.
    """
    study, out = stage_key(cfg), Path(cfg.get("out", "reports"))
    reference, settings = cfg.comparison.reference, resampling_of(cfg)
    if not (of_reference := Path("data/scores/baselines", reference)).is_dir():
        raise InputError(of_reference, "scores", "there are none")
    gathered: dict[str, Figures] = {}
    tested: list[str] = []
    for name, fold in cfg.folds[study].items():
        models = name if "train" in fold else "main"
        for at in fold.test:
            key, scores = at.split("/")[1], scores_at(cfg, models, at)
            if any(reference not in of_methods for of_methods in scores.values()):
                raise ConfigError("comparison.reference", reference, f"it was not evaluated at {at}")
            summary = summarise_test_set(key, scores, reference, settings) if scores else {}
            if twice := sorted(set(summary) & set(gathered)):
                rule = "another fold tests it too; name it once"
                raise ConfigError(f"folds.{study}.{name}.test", twice, rule)
            gathered |= summary
            tested += [key] if summary else []
    write_figures(out, study, gathered, tested)


if __name__ == "__main__":
    main()
