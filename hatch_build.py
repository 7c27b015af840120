"""Put the default model and settings of drives into the wheel; editable installs read them in place."""

from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

_MODEL = "models/online/default"
_SETTINGS = {
    "conf/worlds/varied.yaml": "pedpred/driving/trained_on.yaml",
    "conf/social_forces/walking.yaml": "pedpred/driving/social_forces.yaml",
}


class ModelHook(BuildHookInterface):
    """Called by hatchling before it builds a wheel."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Map the model folder and the settings into the package.

        Raises:
            FileNotFoundError: there is no default model; no wheel is built without one.
        """
        if version == "editable":
            return
        folder = Path(self.root) / _MODEL
        for name in ("model.json", "network.onnx"):
            if not (folder / name).is_file():
                raise FileNotFoundError(
                    f"{folder / name} is missing. Get it with git, or make one: make reproduce release"
                )
        build_data["force_include"][str(folder)] = "pedpred/online/default"
        for name, inside in _SETTINGS.items():
            build_data["force_include"][str(Path(self.root) / name)] = inside
