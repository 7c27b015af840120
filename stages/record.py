"""record@scene: one test scene with its forecasts as an MCAP recording and an animation."""

from pathlib import Path

from matplotlib.colors import to_rgb
from omegaconf import DictConfig

from pedpred.config import configured, plain, stage
from pedpred.evaluation.forecasts import read_windows
from pedpred.fields import parsed
from pedpred.forecasting import Methods
from pedpred.report.animation import Animation, write_animation
from pedpred.ros import write_recording
from pedpred.ros.foxglove import write_layout
from pedpred.storage.scenes import read_scene


@stage
def main(cfg: DictConfig) -> None:
    """Write data/recordings/<scene>.mcap, its Foxglove layout and reports/walking/<scene>.gif.

    `scene` is a scene's folder, `forecasts` the file of the forecasts in it, `out` another root than here.
    Without that file, as of a place that is not available, both show the scene alone.
    """
    scene, forecasts = read_scene(Path(cfg.scene)), Path(cfg.forecasts)
    windows = read_windows(forecasts) if forecasts.exists() else None
    root, options = Path(cfg.get("out", ".")), cfg.recording
    recording = root / "data/recordings" / scene.name
    methods = Methods.parse(plain(cfg.methods))
    shown = {name: to_rgb(methods[name].colour) for name in methods.ordered(options.methods)}
    with configured("recording.animation"):
        animation = parsed(Animation, plain(options.animation))
    write_recording(scene, recording.with_suffix(".mcap"), windows, shown if windows else None)
    write_layout(scene.occupancy, set(shown) - {animation.method}, recording.with_suffix(".foxglove.json"))
    write_animation(scene, windows, animation, methods, root / f"reports/walking/{scene.name}.gif")


if __name__ == "__main__":
    main()
