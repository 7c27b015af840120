"""A layout for Foxglove: a recording from above, and its people as text."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from pedpred.files import write_json
from pedpred.ros.markers import namespaces
from pedpred.ros.message_types import MARKERS
from pedpred.scenes import OccupancyMap

_TEMPLATE = Path(__file__).with_suffix(".json")


def write_layout(occupancy: OccupancyMap, hidden: Iterable[str], path: Path) -> None:
    """Write a layout to be imported in Foxglove (Layouts, Import from file).

    Args:
        occupancy: the map, whose longer side fills the view.
        hidden: methods whose forecasts are switched off at first.
        path: the file.
    """
    layout = json.loads(_TEMPLATE.read_text())
    plan = layout["configById"]["3D!plan"]
    camera, half_view_rad = plan["cameraState"], np.radians(plan["cameraState"]["fovy"]) / 2
    camera["distance"] = float(occupancy.extent_m.max() / (2 * np.tan(half_view_rad)))
    camera["targetOffset"] = [*(occupancy.origin + occupancy.extent_m / 2).tolist(), 0]
    off = sorted(namespace for method in hidden for namespace in namespaces(method))
    plan["topics"][MARKERS]["namespaces"] = {name: {"visible": False} for name in off}
    write_json(path, layout)
