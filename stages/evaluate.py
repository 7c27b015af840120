"""evaluate_<study>: every forecaster in every window of the test scenes of a fold."""

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import torch
from omegaconf import DictConfig

from pedpred.baselines.registry import baselines
from pedpred.config import SETS, configured, one_of, plain, row, stage
from pedpred.evaluation import EvaluationSettings, Scores
from pedpred.evaluation.compare import compare
from pedpred.evaluation.forecasts import write_windows
from pedpred.evaluation.summary import figures
from pedpred.evaluation.windows import window_request
from pedpred.features import ForecastProtocol
from pedpred.features.perception import Perception
from pedpred.fields import parsed
from pedpred.files import write_json
from pedpred.forecasting import Forecaster, Methods
from pedpred.models.forecaster import forecaster
from pedpred.models.lstm.features import LstmFeatures
from pedpred.simulation.settings import SocialForceSettings, social_force_settings
from pedpred.storage.scenes import read_scene, scene_folders
from pedpred.workers import in_parallel
from stages.features import features_of, perception_of

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class Comparison:
    """What all scenes of a test set are forecast with.

    Attributes:
        how: how people are perceived.
        protocol: time step, horizon, ages.
        social_force: the model of walking there.
        forecasters: by method.
        settings: of the metrics.
        shown: grids around the people, for pictures.
        out: folder for the forecasts.
    """

    how: Perception
    protocol: ForecastProtocol
    social_force: SocialForceSettings
    forecasters: Mapping[str, Forecaster]
    settings: EvaluationSettings
    shown: LstmFeatures
    out: Path


def compare_in(folder: Path, given: Comparison) -> tuple[str, dict[str, Scores]]:
    """Write the forecasts of one scene, on one thread in every worker.

    Returns:
        Name of the scene, and the scores of each method there; none if its recording is not available.
    """
    torch.set_num_threads(1)
    scene = read_scene(folder)
    if scene.unavailable is not None:
        return scene.name, {}
    request = window_request(scene, given.how, given.protocol, given.social_force)
    windows, scores = compare(request, given.forecasters, given.settings, given.shown)
    write_windows(windows, given.out / f"{scene.name}.parquet")
    return scene.name, scores


def forecasters_of(
    cfg: DictConfig, methods: Methods, kind: str, settings: EvaluationSettings
) -> dict[str, Forecaster]:
    """The methods that are applied to sets of a kind; those with weights come from the folder `networks`."""
    applied = methods.applied_to(kind)
    learned = [method.key for method in applied if "architecture" in method.settings]
    simple = baselines(method for method in applied if method.key not in learned)
    encoder = Path("models/autoencoder")
    choices = {"together": settings.together, "learning": settings.learning}
    return simple | {m: forecaster(Path(cfg.networks, m), encoder, **choices) for m in learned}


@stage
def main(cfg: DictConfig) -> None:
    """Test the networks in the folder `networks` on the sets of `fold` of `study`; write metrics, forecasts.

    Several scenes at once (see `pedpred.workers`).
    """
    methods, fold = Methods.parse(plain(cfg.methods)), f"{cfg.study}/{cfg.fold}"
    out = Path(cfg.get("out", f"data/forecasts/{fold}"))
    out.mkdir(parents=True, exist_ok=True)  # also if no place is available
    metrics: dict = {}
    with configured("evaluation"):
        settings = parsed(EvaluationSettings, plain(cfg.evaluation))
    shown = features_of(cfg, "lstm")
    assert isinstance(shown, LstmFeatures)
    for tested in cfg.folds[cfg.study][cfg.fold].test:
        kind, key = tested.split("/")
        source = cfg[one_of("kind", kind, SETS)][key]
        how, protocol = perception_of(cfg, source)
        walking = social_force_settings(row(cfg, "social_forces", source.social_force))
        forecasters = forecasters_of(cfg, methods, kind, settings)
        given = Comparison(how, protocol, walking, forecasters, settings, shown, out)
        folders = scene_folders(Path("data/scenes", tested))
        found = in_parallel(compare_in, [(f, given) for f in folders], f"evaluate {key}", "scene")
        if scores := {name: own for name, own in found if own}:
            metrics |= figures(key, scores, methods.reference.key, settings, protocol.noncausal)
        else:
            _LOG.warning("%s has no recording, so nothing is measured there", key)
    write_json(Path(cfg.get("metrics", f"data/metrics/{fold}.json")), metrics)


if __name__ == "__main__":
    main()
