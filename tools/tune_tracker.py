"""Tune the tracker on one place by maximum likelihood: `python -m tools.tune_tracker <place>`.

It sees what the place's sensor lets through, as the tracker will. Run it after `dvc repro ingest`. It writes
the row tuned_on_<place> of conf/trackers, which *other* places are tracked with. Then run `make params`.
"""

from __future__ import annotations

import argparse
import logging
from pathlib import Path

from pedpred.config import config_errors, read_params, row
from pedpred.features.perception import sensed
from pedpred.files import check_output
from pedpred.simulation.sensor import SensorSettings
from pedpred.tracking import log_likelihood, tune_kalman
from tools.arguments import count
from tools.places import recording
from tools.rows import write_row

# As far as forecasts reach: 3.2 s of annotations. A filter tuned for the next detection alone trusts the
# annotations more than the walking: its constant-velocity error is larger even on the place it was tuned on.
_AHEAD = 8
_ROW = """\
# Maximum likelihood of the next {ahead} detections on {place}, {fit:.3f} each; written by
# python -m tools.tune_tracker {place}
tuned_on_{place}:
  kind: kalman
  acceleration_noise: {acceleration_noise:.4f} # q, m^2/s^3
  position_noise_m: {position_noise_m:.4f} # r
  initial_speed_mps: {initial_speed_mps:.4f}
"""


@config_errors()
def main(arguments: list[str] | None = None) -> None:
    """Read data/scenes/real/<place>, write its row of conf/trackers/kalman.yaml."""
    parser = argparse.ArgumentParser(prog="python -m tools.tune_tracker", description=__doc__)
    parser.add_argument("place", help="a row of conf/places")
    parser.add_argument("--ahead", type=count, default=_AHEAD, help="detections that are forecast")
    parser.add_argument("--out", type=Path, default=Path("conf/trackers/kalman.yaml"), help="file of rows")
    options = parser.parse_args(arguments)
    check_output(options.out)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    params = read_params(Path())
    sensor = SensorSettings(**row(params, "sensors", params.places[options.place].sensor))
    scene = recording(options.place)
    trajectories = sensed(scene, sensor).trajectories
    best = tune_kalman(trajectories, options.ahead)
    fit = log_likelihood(trajectories, best, options.ahead)
    text = _ROW.format(place=options.place, ahead=options.ahead, fit=fit, **vars(best))
    write_row(options.out, f"tuned_on_{options.place}", text)
    logging.getLogger(__name__).info("%s\n%s", options.out, text)


if __name__ == "__main__":
    main()
