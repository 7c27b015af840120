"""Check the walking of all simulated sets, and two opposite streams in a corridor."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omegaconf import DictConfig
from tqdm import tqdm

from pedpred.config import configured, part, row, stage
from pedpred.files import write_json, write_text
from pedpred.report.document import write_pictures
from pedpred.report.simulation_page import crowd_section
from pedpred.settings import load_together
from pedpred.simulation.settings import SocialForceSettings, social_force_settings
from pedpred.simulation.validation import FlowSettings, corridor_flow, count_walking
from pedpred.storage.scenes import read_scene, scene_folders


@dataclass(frozen=True)
class ForceName:
    """The row of social_forces by which people walk in the corridor."""

    social_force: str


def flow_of(cfg: Mapping[str, Any]) -> tuple[FlowSettings, SocialForceSettings]:
    """Read the experiment in a corridor and the model of walking there."""
    with configured("validation"):
        settings, forces = load_together([FlowSettings, ForceName], part(cfg, "validation"))
    with configured(f"social_forces.{forces.social_force}"):
        return settings, social_force_settings(row(cfg, "social_forces", forces.social_force))


@stage()
def main(cfg: DictConfig) -> None:
    """Write reports/metrics/walking.json and the page reports/simulation.md with its pictures."""
    out = Path(cfg.get("out") or "reports")
    settings, model = flow_of(cfg)
    sets = {}
    for name in cfg.simulations:
        folders = scene_folders(Path("data/scenes/simulated", name))
        scenes = (read_scene(f) for f in tqdm(folders, desc=f"walking in {name}", unit="scene"))
        sets[name] = count_walking(scenes, model).shares()
    flow, clearest = corridor_flow(settings, model)
    write_json(out / "metrics/walking.json", sets | {"corridor_flow": flow})
    section = crowd_section(sets, flow, clearest)
    write_pictures(section, out / "simulation")
    write_text(out / "simulation.md", section.markdown("simulation") + "\n")


if __name__ == "__main__":
    main()
