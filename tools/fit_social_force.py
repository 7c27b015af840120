"""Fit the social forces to one place: `python -m tools.fit_social_force +name=eth`.

By hand, after `dvc repro features@<name>`: the result is configuration,
conf/social_force/fitted_on_<name>.yaml, which the *other* places are forecast with. Run `make
params` afterwards.
"""

import logging
from pathlib import Path

import numpy as np
from omegaconf import DictConfig

from pedpred.baselines.fitting import fitted
from pedpred.baselines.social_force import initial_state_of
from pedpred.baselines.together import seen_together
from pedpred.config import plain, stage, stage_key
from pedpred.evaluation.scores import true_paths
from pedpred.files import write_text
from pedpred.simulation.settings import social_force_settings
from pedpred.storage.scenes import read_scene
from pedpred.storage.shards import read_manifest, read_shard

_TRIALS = 300  # one to two minutes on one core
_PAGE = """\
# Least average displacement error on {name}: {reached_m:.4f} m ({start_m:.4f} m before the fit); written by
# python -m tools.fit_social_force +name={name}
defaults: [helbing1995, _self_]
forces:
"""


@stage
def main(cfg: DictConfig) -> None:
    """Read data/scenes/<name> and data/features/<name>, write conf/social_force/fitted_on_<name>.yaml."""
    name = stage_key(cfg)
    scene = read_scene(Path("data/scenes") / name)
    features = Path("data/features") / name
    settings, _ = read_manifest(features)
    table = read_shard(features, name, settings)
    model = social_force_settings(plain(cfg.social_force))
    together = seen_together(table, table.window)
    start = initial_state_of(scene, table.select(together), model.routing)
    windows = np.flatnonzero(table.window)
    truth = true_paths(table.select(windows), settings.dt_s)
    asked = np.searchsorted(together, windows)
    fit = fitted(start, asked, truth, model, settings.dt_s, int(cfg.get("trials", _TRIALS)))
    page = _PAGE.format(name=name, **vars(fit))
    page += "".join(f"  {key}: {value:.4g}\n" for key, value in fit.forces.items())
    out = Path(cfg.get("out", "conf/social_force")) / f"fitted_on_{name}.yaml"
    write_text(out, page)
    logging.getLogger(__name__).info("%s\n%s", out, page)


if __name__ == "__main__":
    main()
