"""A layout for Foxglove: a recording from above, and its people as text."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from pedpred.files import write_json
from pedpred.ros.markers import namespaces
from pedpred.ros.message_types import MAP, MARKERS, PEOPLE
from pedpred.ros.scene_messages import FRAME
from pedpred.scenes import OccupancyMap

_VIEW_RAD = np.radians(45.0)
"""Vertical angle of view; the camera is high enough for the longer side of the map."""


def write_layout(occupancy: OccupancyMap, hidden: Iterable[str], path: Path) -> None:
    """Write a layout to be imported in Foxglove (Layouts, Import from file).

    Args:
        occupancy: the map, which fills the view.
        hidden: methods whose forecasts are switched off at first.
        path: the file.
    """
    centre = (occupancy.origin + occupancy.extent_m / 2).tolist()
    off = sorted(namespace for method in hidden for namespace in namespaces(method))
    plan = {
        "cameraState": {
            "perspective": False,
            "distance": float(occupancy.extent_m.max() / (2 * np.tan(_VIEW_RAD / 2))),
            "phi": 0,
            "thetaOffset": 0,
            "target": [0, 0, 0],
            "targetOffset": [*centre, 0],
            "targetOrientation": [0, 0, 0, 1],
            "fovy": float(np.degrees(_VIEW_RAD)),
            "near": 0.5,
            "far": 5000,
        },
        "followMode": "follow-none",
        "followTf": FRAME,
        "scene": {"backgroundColor": "#ffffff"},
        "topics": {
            MAP: {"visible": True, "colorMode": "map"},
            MARKERS: {"visible": True, "namespaces": {name: {"visible": False} for name in off}},
        },
    }
    layout = {
        "configById": {"3D!plan": plan, "RawMessages!people": {"topicPath": PEOPLE}},
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": {
            "direction": "row",
            "first": "3D!plan",
            "second": "RawMessages!people",
            "splitPercentage": 75,
        },
    }
    write_json(path, layout)
