"""Stage `ingest@<scene>`: a raw recording becomes a scene on disk."""

from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import stage, stage_key
from pedpred.errors import ConfigError
from pedpred.sources import SOURCES
from pedpred.storage.scenes import write_scene


@stage
def main(cfg: DictConfig) -> None:
    """Write data/scenes/<scene>."""
    name = stage_key(cfg)
    settings = cfg.scenes[name]
    if settings.source not in SOURCES:
        raise ConfigError(f"scenes.{name}.source", settings.source, f"choose one of {', '.join(SOURCES)}")
    raw = Path("data/raw", settings.source, settings.sequence)
    scene = SOURCES[settings.source](raw, name, settings)
    write_scene(scene, Path(cfg.get("out") or f"data/scenes/{name}"))


if __name__ == "__main__":
    main()
