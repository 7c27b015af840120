"""Lone walkers, straight and curving, beside the best filter of each case: `python -m benchmarks.curves`.

People walk alone on free ground at 0.9 to 1.6 m/s; their turn rate wanders, correlated over 1.5 s. The Kalman
filter knows the noise of the detections, and its process noise is the best of a grid for each case, chosen by
its own error: more than a tracker can know. A network that has learned how people turn is not worse.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks import pages
from benchmarks.accuracy import ade_m
from benchmarks.timing import tell
from pedpred.baselines.kalman import kalman_velocity
from pedpred.errors import user_errors
from pedpred.evaluation.scores import integrate_truth
from pedpred.evaluation.windows import ask_about_windows
from pedpred.features import ForecastProtocol
from pedpred.features.perception import Perception
from pedpred.online.settings import OnlineSettings
from pedpred.scenes import Scene
from pedpred.simulation.sensor import SensorSettings
from pedpred.simulation.worlds.lone import LoneSettings, simulate_lone_people
from pedpred.tracking import KalmanSettings
from tools.arguments import count

TURNS_RADPS, RATES_HZ, NOISES_M = (0.0, 0.15, 0.4), (2.5, 10.0, 25.0), (0.0, 0.05, 0.1)
PROCESS_NOISES = np.geomspace(1e-4, 3.0, 12)
_STEP_S, _EXACT_M = 0.02, 0.002
_LEVEL_M = 0.005
"""Errors below this are nothing to compare."""


def walkers(turn_radps: float, people: int) -> Scene:
    """Lone people who turn so, every 0.02 s."""
    never = (1e-6, 1e-6)
    settings = LoneSettings(
        duration_s=20.0,
        people=people,
        standing_share=0.0,
        speed_mps=(0.9, 1.6),
        straight_share=0.0 if turn_radps else 1.0,
        turn_radps=(turn_radps or 1.0,) * 2,
        turn_s=(1.5, 1.5),
        unsteady=never,
        halting_share=0.0,
        halt_rate_hz=never,
        halt_s=(1.0, 1.0),
        relaxation_s=(1.0, 1.0),
    )
    scene = simulate_lone_people(settings, _STEP_S, f"turning_{turn_radps}", np.random.default_rng(1))
    return replace(scene, trajectories=replace(scene.trajectories, velocity=None))


def filter_m(scene: Scene, sensor: SensorSettings) -> float:
    """Error of the best Kalman filter, m."""
    sizes, noise_m = ForecastProtocol(), max(sensor.position_noise_m, _EXACT_M)
    errors = []
    for q in PROCESS_NOISES:
        how = Perception(KalmanSettings(float(q), noise_m), 0.2, sensor)
        request = ask_about_windows(scene, how, sizes, memory=False)
        miss = kalman_velocity()(request).mean - integrate_truth(request.asked, sizes.dt_s)
        errors.append(np.linalg.norm(miss, axis=-1).mean())
    return float(min(errors))


def beside(network: float, best: float) -> str:
    """Error of the network / that of the filter, and their ratio if there is something to compare."""
    ratio = f" ({network / best:.2f})" if best > _LEVEL_M else ""
    return f"{network:.3f} / {best:.3f}{ratio}"


@user_errors()
def main() -> None:
    """Measure and print."""
    parser = pages.table_parser(__doc__)
    parser.add_argument("--people", type=count, default=60)
    pages.add_trust(parser)
    options = pages.table_options(parser, "benchmarks.curves")
    rows = []
    for turn_radps in TURNS_RADPS:
        scene = walkers(turn_radps, options.people)
        for noise_m in NOISES_M:
            row = {"turn rate, rad/s": f"{turn_radps:g}", "noise, m": f"{noise_m:g}"}
            for rate_hz in RATES_HZ:
                sensor = SensorSettings(rate_hz=rate_hz, position_noise_m=noise_m)
                settings = OnlineSettings(1.25 / rate_hz, learn_trust=options.trust)
                errors_m = ade_m(scene, options.model, settings, sensor)
                row[f"{rate_hz:g} Hz"] = beside(errors_m["network"], filter_m(scene, sensor))
            rows.append(row)
    tell("ADE of the network / of the best filter, m (ratio)", rows)
    if options.write:
        pages.put("curves", rows)


if __name__ == "__main__":
    main()
