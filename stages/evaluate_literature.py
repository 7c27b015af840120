"""Forecasters under the protocol of the literature, on the native annotations of the real places."""

from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import row, stage
from pedpred.evaluation.literature import measures, methods, stretches
from pedpred.files import write_json
from pedpred.storage.scenes import read_scene
from pedpred.tracking import KalmanSettings


@stage
def main(cfg: DictConfig) -> None:
    """Read data/scenes/real/<place>, write reports/metrics/literature.json (or `metrics`)."""
    options, figures = cfg.literature, {}
    for place in options.places:
        tracker = row(cfg, "trackers", cfg.places[place].tracker)
        tracker.pop("kind")
        trajectories = read_scene(Path("data/scenes/real", place)).trajectories
        found = stretches(trajectories, options.observed_steps, options.predicted_steps, options.step_s)
        figures[place] = {
            name: measures(found, forecast(found), options.bootstrap, options.seed)
            for name, forecast in methods(KalmanSettings(**tracker)).items()
        }
    write_json(Path(cfg.get("metrics", "reports/metrics/literature.json")), figures)


if __name__ == "__main__":
    main()
