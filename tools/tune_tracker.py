"""Tune the tracker on one place by maximum likelihood: `python -m tools.tune_tracker +name=eth`.

By hand, after `dvc repro ingest`: the result is configuration, conf/tracker/tuned_on_<name>.yaml, which
the *other* places are tracked with. Run `make params` afterwards.
"""

import logging
from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import stage, stage_key
from pedpred.files import write_text
from pedpred.storage.scenes import read_scene
from pedpred.tracking import log_likelihood, tune_kalman

# As far as forecasts reach: 3.2 s of annotations. A filter tuned for the next detection alone trusts the
# annotations more than the walking: its constant-velocity error is larger even on the place it was tuned on.
_AHEAD = 8
_PAGE = """\
# Maximum likelihood of the next {ahead} detections on {name}, {fit:.3f} each; written by
# python -m tools.tune_tracker +name={name}
kind: kalman
acceleration_noise: {acceleration_noise:.4f} # q, m^2/s^3
position_noise_m: {position_noise_m:.4f} # r
initial_speed_mps: {initial_speed_mps:.4f}
"""


@stage
def main(cfg: DictConfig) -> None:
    """Read data/scenes/<name>, write conf/tracker/tuned_on_<name>.yaml."""
    name = stage_key(cfg)
    trajectories = read_scene(Path("data/scenes") / name).trajectories
    ahead = int(cfg.get("ahead", _AHEAD))
    best = tune_kalman(trajectories, ahead)
    fit = log_likelihood(trajectories, best, ahead)
    page = _PAGE.format(name=name, ahead=ahead, fit=fit, **vars(best))
    out = Path(cfg.get("out", "conf/tracker")) / f"tuned_on_{name}.yaml"
    write_text(out, page)
    logging.getLogger(__name__).info("%s\n%s", out, page)


if __name__ == "__main__":
    main()
