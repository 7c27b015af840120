"""Forecasters under the protocol of the literature, on the native annotations of the real places."""

from pathlib import Path

from omegaconf import DictConfig

from pedpred.baselines.registry import baselines
from pedpred.config import plain, row, stage
from pedpred.evaluation import EvaluationSettings
from pedpred.evaluation.literature import literature_figures, request_about, stretches
from pedpred.files import write_json
from pedpred.forecasting import Methods
from pedpred.storage.scenes import read_scene
from pedpred.tracking import KalmanSettings


@stage
def main(cfg: DictConfig) -> None:
    """Read data/scenes/real/<place>, write reports/metrics/literature.json (or `metrics`)."""
    options, figures = cfg.literature, {}
    settings = EvaluationSettings(bootstrap=options.bootstrap, seed=options.seed)
    methods = Methods.parse(plain(cfg.methods))
    forecasters = baselines(methods.applied_to("literature"))
    for place in options.places:
        tracker = row(cfg, "trackers", cfg.places[place].tracker)
        tracker.pop("kind")
        scene = read_scene(Path("data/scenes/real", place))
        if scene.unavailable is not None:
            continue
        found = stretches(scene.trajectories, options.observed_steps, options.predicted_steps, options.step_s)
        request = request_about(scene, found, KalmanSettings(**tracker))
        figures[place] = literature_figures(request, found, forecasters, methods.reference.key, settings)
    write_json(Path(cfg.get("metrics", "reports/metrics/literature.json")), figures)


if __name__ == "__main__":
    main()
