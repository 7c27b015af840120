"""What the node publishes: topics, types and contents."""

from __future__ import annotations

from dataclasses import dataclass

from pedpred.ros.planning import GRID_TYPE, HORIZON, PREDICTIONS_TYPE, grid_topic
from pedpred.ros.scene_messages import Content, header
from pedpred.ros2.settings import NodeSettings
from pedpred.scenes import Forecast

PREDICTIONS, MARKERS, PEOPLE, NAMES = (f"predictions{part}" for part in ("", "/markers", "/people", "/names"))
MARKERS_TYPE, PEOPLE_TYPE = "visualization_msgs/msg/MarkerArray", "people_msgs/msg/People"
TEXT_TYPE = "std_msgs/msg/String"


@dataclass(frozen=True)
class Answer:
    """What is to be published: topic without namespace, type, fields."""

    topic: str
    kind: str
    content: Content


def people_content(forecast: Forecast, names: list[str], time_ns: int, frame: str) -> Content:
    """people_msgs/People: where everybody is, and the mean velocity of the first step of the forecast."""
    velocity = forecast.velocity[:, 0]
    position = forecast.position[:, 0] - forecast.dt_s * velocity
    people = [
        {
            "name": name,
            "position": {"x": float(x), "y": float(y)},
            "velocity": {"x": float(vx), "y": float(vy)},
            "reliability": 1.0,
            "tagnames": ["track_id"],
            "tags": [str(track)],
        }
        for name, track, (x, y), (vx, vy) in zip(names, forecast.track_id, position, velocity, strict=True)
    ]
    return {"header": header(time_ns, frame), "people": people}


def output_types(settings: NodeSettings, steps: int) -> dict[str, str]:
    """Topic -> type of all that a node with these settings can publish for forecasts of some steps."""
    types = {PREDICTIONS: PREDICTIONS_TYPE, NAMES: TEXT_TYPE, MARKERS: MARKERS_TYPE, PEOPLE: PEOPLE_TYPE}
    if settings.occupancy_cell_m:
        types |= dict.fromkeys(grid_topics(steps), GRID_TYPE)
    return types


def grid_topics(steps: int) -> list[str]:
    """Topics of predicted occupancy for forecasts of some steps, without namespace."""
    return [topic.lstrip("/") for topic in (*(grid_topic(step + 1) for step in range(steps)), HORIZON)]
