"""Put the default model into the wheel; editable installs read it where it lies."""

from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

_MODEL = "models/online/default"


class ModelHook(BuildHookInterface):
    """Called by hatchling before it builds a wheel."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Map the model folder into the package.

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
