"""Interaction-aware pedestrian motion prediction in cluttered spaces (Pfeiffer et al. 2018).

The names below are imported on first use, so that `import pedpred` itself loads nothing.
"""

import os
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pedpred.command.data_frames import predict
    from pedpred.online import OnlinePredictor, OnlineSettings
    from pedpred.online.warming import warm_up
    from pedpred.scenes import Forecast, OccupancyMap

os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")  # else onnxruntime reports to its makers, with an id

__all__ = ["Forecast", "OccupancyMap", "OnlinePredictor", "OnlineSettings", "predict", "warm_up"]

_HOMES = {
    "Forecast": "pedpred.scenes",
    "OccupancyMap": "pedpred.scenes",
    "OnlinePredictor": "pedpred.online",
    "OnlineSettings": "pedpred.online",
    "predict": "pedpred.command.data_frames",
    "warm_up": "pedpred.online.warming",
}


def __getattr__(name: str) -> Any:
    """Import a public name from the package that defines it; `__version__` is that of the installation."""
    if name == "__version__":
        try:
            return version("pedpred")
        except PackageNotFoundError:  # a copy that was never installed
            return "unknown"
    if name not in _HOMES:
        raise AttributeError(f"module 'pedpred' has no attribute {name!r}")
    try:
        return getattr(import_module(_HOMES[name]), name)
    except ModuleNotFoundError as cause:
        remedy = f"{cause}: pip install 'pedpred[files]'"
        raise ModuleNotFoundError(remedy, name=cause.name, path=cause.path) from cause
