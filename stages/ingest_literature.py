"""ingest_literature: the recordings of ETH and UCY, as the files of the field hold them, become scenes."""

from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import configured, stage
from pedpred.scenes import Scene
from pedpred.sources.eth_ucy import read_text
from pedpred.sources.mirrors import NOTE
from pedpred.storage.scenes import write_scene
from stages.literature import comparison_of


@stage
def main(cfg: DictConfig) -> None:
    """Write data/eth_ucy/<recording>; scenes without people where the files are not available."""
    settings, out = comparison_of(cfg), Path(cfg.get("out", "data/eth_ucy"))
    note = Path(settings.raw, NOTE)
    for name in settings.recordings:
        if note.exists():
            scene = Scene.without_people(name, note.read_text().partition("\n")[0])
        else:
            with configured("literature.reader"):
                scene = read_text(Path(settings.raw), name, {**settings.reader, "recording": name})
        write_scene(scene, out / name)


if __name__ == "__main__":
    main()
