"""Fit the social forces to one place: `python -m tools.fit_social_force <place>`.

Run it after `dvc repro features_real`. It writes the row fitted_on_<place> of conf/social_forces, which the
*other* places are forecast with. Run `make params` afterwards.
"""

from __future__ import annotations

import argparse
import logging
from pathlib import Path

import numpy as np

from pedpred.baselines.fitting import Fit, fit_forces
from pedpred.baselines.social_force import initial_state_of
from pedpred.baselines.together import seen_together
from pedpred.config import read_params, row
from pedpred.evaluation.scores import true_paths
from pedpred.simulation.settings import SocialForceSettings, social_force_settings
from pedpred.storage.scenes import read_scene
from pedpred.storage.shards import read_manifest, read_shard
from tools.rows import write_row

_ROW = """\
# Least average displacement error on {place}: {reached_m:.4f} m ({start_m:.4f} m before the fit); written by
# python -m tools.fit_social_force {place}
fitted_on_{place}:
  base: {base}
  forces:
"""


def fit_place(place: str, model: SocialForceSettings, trials: int) -> Fit:
    """Fit the forces to the evaluation windows of a place.

    Args:
        place: a row of conf/places.
        model: the parameters that the search starts from.
        trials: parameter sets to try at most.
    """
    features = Path("data/features/real", place)
    sizes, _ = read_manifest(features)
    table = read_shard(features, place, sizes)
    windows = np.flatnonzero(table.window)
    together = seen_together(table, windows)
    scene = read_scene(Path("data/scenes/real", place))
    start = initial_state_of(scene, table.select(together), model.routing)
    truth = true_paths(table.select(windows), sizes.dt_s)
    return fit_forces(start, np.searchsorted(together, windows), truth, model, sizes.dt_s, trials)


def main(arguments: list[str] | None = None) -> None:
    """Read data/scenes/real/<place> and data/features/real/<place>, write the row."""
    parser = argparse.ArgumentParser(prog="python -m tools.fit_social_force", description=__doc__)
    parser.add_argument("place", help="a row of conf/places")
    parser.add_argument("--base", default="helbing1995", help="the row that the search starts from")
    parser.add_argument("--trials", type=int, default=300, help="parameter sets to try (300: 2 minutes)")
    parser.add_argument("--out", type=Path, default=Path("conf/social_forces/walking.yaml"), help="rows")
    given = parser.parse_args(arguments)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    model = social_force_settings(row(read_params(Path()), "social_forces", given.base))
    fit = fit_place(given.place, model, given.trials)
    text = _ROW.format(place=given.place, base=given.base, **vars(fit))
    text += "".join(f"    {key}: {value:.4g}\n" for key, value in fit.forces.items())
    write_row(given.out, f"fitted_on_{given.place}", text)
    logging.getLogger(__name__).info("%s\n%s", given.out, text)


if __name__ == "__main__":
    main()
