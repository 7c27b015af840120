"""Forecasters under the protocol of the literature, on the native annotations of the real places."""

from pathlib import Path

from omegaconf import DictConfig

from pedpred.baselines.registry import baselines
from pedpred.config import configured, one_of, plain, stage
from pedpred.evaluation.literature import LiteratureSettings, literature_figures, request_about, stretches
from pedpred.fields import parsed
from pedpred.files import write_json
from pedpred.forecasting import Methods
from pedpred.storage.scenes import read_scene
from stages.features import kalman_of


@stage
def main(cfg: DictConfig) -> None:
    """Read data/scenes/real/<place>, write reports/metrics/literature.json (or `metrics`)."""
    figures: dict = {}
    with configured("literature"):
        how: LiteratureSettings = parsed(LiteratureSettings, plain(cfg.literature))
    methods = Methods.parse(plain(cfg.methods))
    forecasters = baselines(methods.applied_to("literature"))
    for place in how.places:
        kalman = kalman_of(cfg, one_of("literature.places", place, cfg.places).tracker)
        scene = read_scene(Path("data/scenes/real", place))
        if scene.unavailable is not None:
            continue
        found = stretches(scene.trajectories, how.observed_steps, how.predicted_steps, how.step_s)
        request = request_about(scene, found, kalman)
        figures[place] = literature_figures(
            request, found, forecasters, methods.reference.key, how.resampling()
        )
    write_json(Path(cfg.get("metrics", "reports/metrics/literature.json")), figures)


if __name__ == "__main__":
    main()
