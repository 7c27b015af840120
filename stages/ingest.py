"""ingest@place: a raw recording becomes a scene folder; one that is not available, a scene without people."""

import logging
from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import configured, one_of, plain, stage, stage_key
from pedpred.scenes import Scene, checked_placement
from pedpred.sources import SOURCES
from pedpred.sources.mirrors import NOTE
from pedpred.storage.scenes import write_scene
from stages.sets import tables_of


@stage("name", "study")
def main(cfg: DictConfig) -> None:
    """Write data/scenes/real/<name>, a place of the main pipeline or of `study`."""
    name = stage_key(cfg)
    place = tables_of(cfg).places[name]
    read = one_of(f"places.{name}.source", place.source, SOURCES)
    note = Path(place.folder, NOTE)
    if note.exists():
        scene = Scene.without_people(name, note.read_text().partition("\n")[0])
    else:
        with configured(f"places.{name}.settings"):
            scene = read(Path(place.folder), name, plain(place.settings))
        logging.getLogger(__name__).info("%s: %s", name, checked_placement(scene))
    write_scene(scene, Path(cfg.get("out") or f"data/scenes/real/{name}"))


if __name__ == "__main__":
    main()
