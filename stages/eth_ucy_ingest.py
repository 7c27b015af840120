"""eth_ucy_ingest: the recordings of ETH and UCY, as the files of the field hold them, become scenes."""

from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import configured, part, stage
from pedpred.scenes import Scene
from pedpred.sources.eth_ucy import read_text
from pedpred.sources.mirrors import NOTE
from pedpred.storage.scenes import write_scene
from stages.eth_ucy import RECORDINGS


@stage()
def main(cfg: DictConfig) -> None:
    """Write data/eth_ucy/recordings/<recording>; scenes without people where the files are not available."""
    raw, out = Path(cfg.literature.raw), Path(cfg.get("out", RECORDINGS))
    note, reader = raw / NOTE, part(cfg, "literature", "reader")
    for name in cfg.literature.recordings:
        if note.exists():
            scene = Scene.without_people(name, note.read_text().partition("\n")[0])
        else:
            with configured("literature.reader"):
                scene = read_text(raw, name, {**reader, "recording": name})
        write_scene(scene, out / name)


if __name__ == "__main__":
    main()
