"""Interaction-aware pedestrian motion prediction in cluttered spaces (Pfeiffer et al. 2018).

The public names are imported on first use, so `import pedpred` alone loads nothing.
"""

import os
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from typing import TYPE_CHECKING

from pedpred.lazy import names_on_use

os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")  # else onnxruntime reports to its makers, with an id

if TYPE_CHECKING:
    from pedpred.command.data_frames import predict as predict
    from pedpred.online import OnlinePredictor as OnlinePredictor
    from pedpred.online import OnlineSettings as OnlineSettings
    from pedpred.online.warming import warm_up as warm_up
    from pedpred.scenes import Forecast as Forecast
    from pedpred.scenes import OccupancyMap as OccupancyMap

    __version__: str
else:
    __all__, _find = names_on_use(
        __name__,
        {
            "predict": "pedpred.command.data_frames",
            "OnlinePredictor": "pedpred.online",
            "OnlineSettings": "pedpred.online",
            "warm_up": "pedpred.online.warming",
            "Forecast": "pedpred.scenes",
            "OccupancyMap": "pedpred.scenes",
        },
    )

    def __getattr__(name):
        """Import a public name from where it is defined; `__version__` is that of the installation."""
        if name == "__version__":
            try:
                return version("pedpred")
            except PackageNotFoundError:  # a copy that was never installed
                return "unknown"
        try:
            return _find(name)
        except ModuleNotFoundError as cause:
            remedy = f"{cause}: pip install 'pedpred[files]'"
            raise ModuleNotFoundError(remedy, name=cause.name, path=cause.path) from cause

    def __dir__():
        """List the public names, too, for completion and `help`: those that this installation can import."""
        missing = set() if find_spec("pandas") else {"predict"}
        return sorted({*globals(), *__all__} - missing)
