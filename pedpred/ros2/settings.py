"""The parameters of the node."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Annotated, Any

from pedpred.errors import ValueRuleError
from pedpred.online import OnlineSettings
from pedpred.ros.identities import MODES
from pedpred.ros.people import PEOPLE_FIELDS, parse_fields
from pedpred.ros.tf import frame_name
from pedpred.scenes.people import PERSON_CLASSES
from pedpred.settings import In, OneOf, Settings, check_choice
from pedpred.tracking.tracks import LOST_AFTER_S

_TYPE = re.compile(r"\w+/msg/\w+")


def _parameter(default: Any, text: str, live: bool = False) -> Any:
    """A parameter with its description; `live`: it may be changed while the node runs."""
    return field(default=default, metadata={"text": text, "live": live})


@dataclass(frozen=True)
class NodeSettings(Settings):
    """The parameters of the node, with their default values; `described` explains them.

    Raises:
        ValueRuleError: a value is none of its choices, or out of range.
    """

    model: str = _parameter("", "a model folder; empty: the default model of the package")
    people_type: str = _parameter(
        "people_msgs/msg/People",
        f"type of `people`: {', '.join(sorted(PEOPLE_FIELDS))}; or any other one with people_fields",
    )
    people_fields: str = _parameter(
        "",
        "fields of people in a message of another type: the path of the list, then those of fields in a "
        "person, such as objects,id=label_id,position=pose.position,class=label; empty: those known of "
        "people_type",
    )
    people_reliability: Annotated[str, OneOf(("best_effort", "reliable"))] = _parameter(
        "best_effort",
        "reliability of the subscription to people: best_effort receives from every publisher; or reliable",
    )
    class_ids: tuple[str, ...] = _parameter(
        PERSON_CLASSES, "classes of people in vision_msgs; an empty text: all classes"
    )
    identities: Annotated[str, OneOf(MODES)] = _parameter(
        "auto",
        "how people are identified: given, by the ids of messages; assigned, by position; auto, assigned "
        "while ids are missing, shared, or new in each message",
    )
    use_map: bool = _parameter(True, "subscribe to `map`; false: forecast without walls")
    map_frame: str = _parameter("map", "frame of the forecasts until a map comes; then the frame of the map")
    transform_timeout_s: Annotated[float, In("[0, 60]")] = _parameter(
        0.2, "how long people wait for the transform of their time, s", True
    )
    max_wait_s: Annotated[float, In("[0.1, 3600]")] = _parameter(
        0.3,
        "messages of people that waited longer for their forecasts are left out until the node catches up, s",
        True,
    )
    detection_noise_m: Annotated[float, In("[0, 10]")] = _parameter(
        0.0, "standard deviation of a detection's coordinate, m"
    )
    learn_trust: bool = _parameter(
        True, "learn from earlier forecasts how far to trust the network beside straight lines"
    )
    learn_local_errors: bool = _parameter(
        True, "correct forecasts by the errors of earlier ones nearby; not in a frame that drifts"
    )
    place_file: str = _parameter(
        "",
        "a JSON file that stores what was learned at the place, read at the start, written every minute and "
        "at the end; empty: nothing is stored",
    )
    ignore_near_robot_m: Annotated[float, In("[0, 100]")] = _parameter(
        0.0,
        "detections nearer than this to the origin of the robot's base in /tf are left out, m; 0: none",
        True,
    )
    max_age_s: Annotated[float, In(f"[0, {LOST_AFTER_S:g}]")] = _parameter(
        0.5, f"people are forecast until their last detection is this old, {LOST_AFTER_S:g} at most, s"
    )
    most_people: Annotated[int, In("[1, 100000]")] = _parameter(
        1000, "largest number of forecast people; of more, those who came first are forecast"
    )
    occupancy_cell_m: Annotated[float, In("[0, 100]")] = _parameter(
        0.0,
        "side of the cells of `predicted_occupancy` on the map, 0.1 at least, m; above 0.3, people hardly "
        "show; 0: no grids",
        True,
    )
    publish_markers: bool = _parameter(True, "publish `predictions/markers` for viewers", True)
    publish_people: bool = _parameter(True, "publish `predictions/people`, if people_msgs is installed", True)
    autostart: bool = _parameter(
        True, "configure and activate at the start; false: a lifecycle manager does it"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.people_fields:
            parse_fields(self.people_fields)
            if not _TYPE.fullmatch(self.people_type):
                raise ValueRuleError("people_type", self.people_type, "write package/msg/Name")
        else:
            check_choice("people_type", self.people_type, sorted(PEOPLE_FIELDS))
        if not frame_name(self.map_frame):
            raise ValueRuleError("map_frame", self.map_frame, "it must name a frame, such as map")

    @property
    def folder(self) -> Path | None:
        """That of the model; None: the one of the package."""
        return _given(self.model)

    @property
    def place(self) -> Path | None:
        """The file of the place; None: there is none."""
        return _given(self.place_file)

    def online(self) -> OnlineSettings:
        """How the predictor treats detections."""
        return OnlineSettings(
            max_age_s=self.max_age_s,
            detection_noise_m=self.detection_noise_m,
            learn_trust=self.learn_trust,
            learn_local_errors=self.learn_local_errors,
            most_people=self.most_people,
        )


def _given(path: str) -> Path | None:
    """A path, if there is one; a shell leaves ~ as it is in `-p place_file:=~/hall.json`."""
    return Path(path).expanduser() if path else None


PARAMETERS = {each.name: (each.default, each.metadata["text"]) for each in fields(NodeSettings)}
"""Name -> default value and description."""
LIVE = frozenset(each.name for each in fields(NodeSettings) if each.metadata["live"])
"""Parameters that may change while the node runs; others before it is configured, or after a clean-up."""


def unchangeable(given: Mapping[str, Any], settings: NodeSettings) -> list[str]:
    """Which given values differ from those of a node that runs, and cannot change now; in order.

    Args:
        given: new values, also those of a whole file, most of which are the same again.
        settings: in use.
    """
    used = {
        name: list(value) if isinstance(value, tuple) else value for name, value in vars(settings).items()
    }
    return sorted(name for name in given if name in used.keys() - LIVE and given[name] != used[name])


def described() -> str:
    """One line per parameter: name, default value, what it means."""
    return "\n".join(
        f"{name} ({', '.join(default) if isinstance(default, tuple) else repr(default)}): {text}"
        for name, (default, text) in PARAMETERS.items()
    )
