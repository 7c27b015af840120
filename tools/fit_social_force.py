"""Fit the social forces to one place: `python -m tools.fit_social_force <place>`.

Run it after `dvc repro ingest`. It writes the row fitted_on_<place> of conf/social_forces, which the
*other* places are forecast with. Run `make params` afterwards.
"""

from __future__ import annotations

import argparse
import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize

from pedpred.baselines.social_force import InitialState, initial_state, people_present
from pedpred.config import config_errors, read_params, row
from pedpred.errors import shape_error
from pedpred.evaluation import find_windows
from pedpred.files import check_output
from pedpred.simulation.settings import SocialForceSettings, social_force_settings
from stages.perception import perception_of
from tools.arguments import count
from tools.places import recording
from tools.rows import write_row

_ROW = """\
# Least average displacement error on {place}: {reached_m:.4f} m ({start_m:.4f} m before the fit); written by
# python -m tools.fit_social_force {place}
fitted_on_{place}:
  base: {base}
  forces:
"""


FITTED = (
    "relaxation_time_s",
    "pedestrian_strength",
    "pedestrian_range_m",
    "border_strength",
    "border_range_m",
    "group_gaze",
    "group_attraction",
    "group_repulsion",
)
"""Parameters that are fitted; all positive."""

_SPAN = 4.0  # values stay in [start / 4, start * 4], where the terms keep their meaning ...
_GROUP_LEAST = 0.02  # ... but the group terms, which not all people follow, may fall to this share


@dataclass(frozen=True)
class Fit:
    """Result of a fit.

    Attributes:
        forces: fitted values by name.
        start_m: average displacement error with the parameters that the search started from.
        reached_m: the same with the fitted ones.
    """

    forces: dict[str, float]
    start_m: float
    reached_m: float


def fit_forces(
    start: InitialState,
    asked: np.ndarray,
    truth: np.ndarray,
    model: SocialForceSettings,
    dt_s: float,
    most_trials: int,
) -> Fit:
    """Search from the model's own parameters (Nelder & Mead 1965, in logarithms).

    Args:
        start: all people at the instants of the windows, of the *training* place. [W]
        asked: rows of `start` whose error counts. [A]
        truth: their true paths, world frame, m. [A, P, 2]
        model: start values, and all that is not fitted.
        dt_s: time between two steps of the paths, s.
        most_trials: parameter sets to try at most.

    Raises:
        ValueRuleError: `truth` is not that of `asked`.
    """
    if len(truth) != len(asked):
        raise shape_error("truth", truth.shape, f"[{len(asked)}, P, 2]")
    first = np.array([getattr(model.forces, name) for name in FITTED])
    first_log = np.log(first)
    simplex = np.vstack([first_log, first_log + np.log(2.0) * np.eye(len(first))])  # twice each value

    def error_m(logarithms: np.ndarray) -> float:
        values = dict(zip(FITTED, np.exp(logarithms).tolist(), strict=True))
        tried = replace(model, forces=model.forces._replace(**values))
        paths = start.paths(tried, truth.shape[1], dt_s)[asked]
        return float(np.linalg.norm(paths - truth, axis=-1).mean())

    low = np.where([name.startswith("group_") for name in FITTED], _GROUP_LEAST, 1.0 / _SPAN)
    result = minimize(
        error_m,
        first_log,
        method="Nelder-Mead",
        bounds=np.log(np.stack([first * low, first * _SPAN], axis=1)),
        options={
            "maxfev": most_trials,
            "xatol": 1e-2,
            "fatol": 1e-5,
            "adaptive": True,
            "initial_simplex": simplex,
        },
    )
    forces = dict(zip(FITTED, np.exp(result.x).tolist(), strict=True))
    return Fit(forces, error_m(first_log), float(result.fun))


def fit_place(place: str, model: SocialForceSettings, trials: int) -> Fit:
    """Fit the forces to the evaluation windows of a place.

    Args:
        place: a row of conf/places.
        model: the parameters that the search starts from.
        trials: parameter sets to try at most.
    """
    params = read_params(Path())
    how = perception_of(params, params.places[place])
    scene = recording(place)
    windows = find_windows(scene, *how)
    people, asked = people_present(windows.request)
    start = initial_state(scene, *people, model.routing)
    return fit_forces(start, asked, windows.truth, model, windows.request.sizes.dt_s, trials)


def base_of(place: str, base: str, rows: Mapping[str, Any]) -> dict[str, Any]:
    """The row that the search starts from, as it is below the row that will be written.

    Raises:
        ConfigError: there is none, or it is based on the row that will be written.
    """
    name = f"fitted_on_{place}"
    return row({"social_forces": {**rows, name: {"base": base}}}, "social_forces", name)


@config_errors()
def main(arguments: list[str] | None = None) -> None:
    """Read data/scenes/real/<place>, write the row."""
    parser = argparse.ArgumentParser(prog="python -m tools.fit_social_force", description=__doc__)
    parser.add_argument("place", help="a row of conf/places")
    parser.add_argument("--base", default="helbing1995", help="the row that the search starts from")
    parser.add_argument("--trials", type=count, default=300, help="parameter sets to try (300: 2 minutes)")
    parser.add_argument("--out", type=Path, default=Path("conf/social_forces/walking.yaml"), help="rows")
    options = parser.parse_args(arguments)
    check_output(options.out)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    model = social_force_settings(base_of(options.place, options.base, read_params(Path()).social_forces))
    fit = fit_place(options.place, model, options.trials)
    text = _ROW.format(place=options.place, base=options.base, **vars(fit))
    text += "".join(f"    {key}: {value:.4g}\n" for key, value in fit.forces.items())
    write_row(options.out, f"fitted_on_{options.place}", text)
    logging.getLogger(__name__).info("%s\n%s", options.out, text)


if __name__ == "__main__":
    main()
