"""What the node publishes: topics and types."""

from __future__ import annotations

from dataclasses import dataclass

from pedpred.ros.grids import GRID_TYPE, HORIZON, grid_topic
from pedpred.ros.planning import PREDICTIONS_TYPE
from pedpred.ros.scene_messages import Content
from pedpred.ros2.settings import NodeSettings

PREDICTIONS, MARKERS, PEOPLE, NAMES = (f"predictions{part}" for part in ("", "/markers", "/people", "/names"))
MARKERS_TYPE, PEOPLE_TYPE = "visualization_msgs/msg/MarkerArray", "people_msgs/msg/People"
TEXT_TYPE = "std_msgs/msg/String"


@dataclass(frozen=True)
class Output:
    """A message to be published: topic without namespace, type, fields."""

    topic: str
    kind: str
    content: Content


def output_types(settings: NodeSettings, steps: int) -> dict[str, str]:
    """Topic -> type of all that a node with these settings can publish for forecasts of some steps."""
    types = {PREDICTIONS: PREDICTIONS_TYPE, NAMES: TEXT_TYPE, MARKERS: MARKERS_TYPE, PEOPLE: PEOPLE_TYPE}
    if settings.occupancy_cell_m:
        types |= dict.fromkeys(grid_topics(steps), GRID_TYPE)
    return types


def grid_topics(steps: int) -> list[str]:
    """Topics of predicted occupancy for forecasts of some steps, without namespace."""
    return [topic.lstrip("/") for topic in (*(grid_topic(step + 1) for step in range(steps)), HORIZON)]
