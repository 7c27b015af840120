"""record@scene: one test scene with its forecasts as an MCAP recording and an animation."""

from pathlib import Path

from matplotlib.colors import to_rgb
from omegaconf import DictConfig

from pedpred.config import configured, plain, stage
from pedpred.evaluation.forecasts import read_forecasts
from pedpred.report.animation import Animation, write_animation
from pedpred.report.methods import Methods
from pedpred.ros import write_recording
from pedpred.ros.foxglove import write_layout
from pedpred.settings import load
from pedpred.storage.scenes import read_scene


@stage("scene", "networks")
def main(cfg: DictConfig) -> None:
    """Write data/recordings/<scene>.mcap, its Foxglove layout and reports/walking/<scene>.gif.

    `scene` is its folder below data/scenes, `networks` the folder of the networks below data/forecasts, `out`
    another root than here. Without forecasts, as of a place that is not available, both show the scene alone.
    """
    scene, at = read_scene(Path("data/scenes", cfg.scene)), "/".join(cfg.scene.split("/")[:2])
    root, options = Path(cfg.get("out", ".")), cfg.recording
    asked = dict.fromkeys([*options.methods, options.animation.method])
    windows = read_forecasts(Path(), cfg.networks, at, asked, scene.name).get(scene.name)
    recording = root / "data/recordings" / scene.name
    methods = Methods.read(Path(), cfg.comparison.reference)
    shown = {name: to_rgb(methods[name].colour) for name in methods.ordered(options.methods)}
    with configured("recording.animation"):
        animation = load(Animation, plain(options.animation))
    write_recording(scene, recording.with_suffix(".mcap"), windows, shown if windows else None)
    write_layout(scene.occupancy, set(shown) - {animation.method}, recording.with_suffix(".foxglove.json"))
    write_animation(scene, windows, animation, methods, root / f"reports/walking/{scene.name}.gif")


if __name__ == "__main__":
    main()
