"""Which fields of a message are its people: a table of known types, and a notation for all others."""

from __future__ import annotations

from array import array
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from pedpred.errors import ValueRuleError
from pedpred.scenes import rule_of

_ROBOT = 2
"""The type of a robot among the agents of pedsim and of HuNavSim."""
_NO_ID = 2**64 - 1
"""The id -1 in a field of 64 bits without a sign."""


class PeopleFields(NamedTuple):
    """Paths of fields, names joined by dots; of several, joined by |, the first one that is there counts.

    A path through a list continues in the entry with the highest score.

    Attributes:
        people: the list of people, in the message.
        id: number, text or bytes, in a person; empty: people have no ids.
        position: a message with x and y (and z), or an array of 2 or 3 numbers, in a person, m; empty: the
            person is one.
        label: the class, number or text, in a person; empty: all are people.
        robot: a number that is 2 for the robot of a simulator, in a person; empty: there is none.
    """

    people: str
    id: str = "id"
    position: str = "position"
    label: str = ""
    robot: str = ""


PEOPLE_FIELDS = {
    "geometry_msgs/msg/PoseArray": PeopleFields("poses", id=""),
    "hunav_msgs/msg/Agents": PeopleFields("agents", position="position.position", robot="type"),
    "leg_tracker/msg/PersonArray": PeopleFields("people", position="pose.position"),
    "nav2_dynamic_msgs/msg/ObstacleArray": PeopleFields("obstacles", id="uuid.uuid"),
    "pedsim_msgs/msg/AgentStates": PeopleFields("agent_states", position="pose.position", robot="type"),
    "people_msgs/msg/People": PeopleFields("people", id="name"),
    "people_msgs/msg/PositionMeasurementArray": PeopleFields("people", id="object_id", position="pos"),
    "spencer_tracking_msgs/msg/TrackedPersons": PeopleFields(
        "tracks", id="track_id", position="pose.pose.position"
    ),
    "vision_msgs/msg/Detection3DArray": PeopleFields(
        "detections",
        id="id|tracking_id|",
        position="bbox.center.position|results.pose.pose.position",
        label="results.hypothesis.class_id|results.id|",
    ),
    "zed_msgs/msg/ObjectsStamped": PeopleFields("objects", id="label_id", label="label"),
}
"""The known message types of people."""

_KEYS = {"id": "id", "position": "position", "class": "label"}


def parse_fields(text: str) -> PeopleFields:
    """Parse the notation of the fields of an unknown type.

    Args:
        text: such as `people,id=id,position=pose.position,class=label`: the path of the list of people, then
            those of fields in a person. Without `id` or `class`, people have none.

    Raises:
        ValueRuleError: it is not in this form.
    """
    people, *pairs = (part.strip() for part in text.split(","))
    given = dict(pair.partition("=")[::2] for pair in pairs)
    if not people or "=" in people or not given.keys() <= _KEYS.keys() or "position" not in given:
        rule = "write the path of the list, then those in a person: people,id=id,position=pose.position"
        raise ValueRuleError("people", text, rule)
    return PeopleFields(people, **{"id": ""} | {_KEYS[key]: path.strip() for key, path in given.items()})


def people_of(message: Any, fields: PeopleFields) -> list[Any]:
    """The people in a message, without a simulator's robot."""
    people = _find(message, fields.people)
    if not isinstance(people, Iterable) or isinstance(people, str):
        rule = f"it must be a list of people, not {type(people).__name__}"
        raise ValueRuleError("people", fields.people, rule)
    return [one for one in people if not fields.robot or _find(one, f"{fields.robot}|") != _ROBOT]


def id_of(person: Any, fields: PeopleFields) -> str:
    """The id of a person as text, that of bytes as hexadecimal digits; empty: there is none."""
    value = _find(person, fields.id)
    if isinstance(value, np.ndarray | bytes):
        return bytes(value).hex()
    return "-1" if value == _NO_ID else str(value)


def class_of(person: Any, fields: PeopleFields) -> str:
    """The class of a person as text; empty: there is none."""
    return str(_find(person, fields.label))


def positions_of(people: Iterable[Any], fields: PeopleFields) -> np.ndarray:
    """Positions of people, m; what is no number, or absurdly far away, is NaN. [N, 3]."""
    found = (_find(one, fields.position) if fields.position else one for one in people)
    positions = np.array([_coordinates(position) for position in found], np.float64).reshape(-1, 3)
    return np.where(rule_of("position", positions)[1], positions, np.nan)


def _coordinates(position: Any) -> tuple[float, float, float]:
    if hasattr(position, "x") and hasattr(position, "y"):
        return position.x, position.y, getattr(position, "z", 0.0)
    if isinstance(position, list | tuple | array | np.ndarray) and len(position) >= 2:
        return position[0], position[1], position[2] if len(position) > 2 else 0.0
    rule = "it must be a message with x and y, or an array of numbers"
    raise ValueRuleError("position", type(position).__name__, rule)


def _find(message: Any, paths: str) -> Any:
    """The value at the first path that exists and is not an origin; empty text for an empty path.

    Raises:
        ValueRuleError: there is none.
    """
    found = [value for path in paths.split("|") if (value := _follow(message, path)) is not None]
    if not found:
        public = [name for name in dir(message) if name.islower() and name[0] != "_"]
        known = ", ".join(name for name in public if not callable(getattr(message, name)))
        raise ValueRuleError("field", paths, f"{type(message).__name__} has {known}")
    return next((value for value in found if not _is_origin(value)), found[0])


def _follow(message: Any, path: str) -> Any | None:
    """The value at a path; None: a field is missing, or a list is empty."""
    if not path:
        return ""
    for name in path.split("."):
        if isinstance(message, list):
            message = max(message, key=_score, default=None)
        message = getattr(message, name, None)
    return message


def _score(entry: Any) -> float:
    """The score of a result of vision_msgs, of every edition."""
    return float(getattr(getattr(entry, "hypothesis", entry), "score", 0.0))


def _is_origin(value: Any) -> bool:
    return hasattr(value, "x") and not (value.x or value.y or getattr(value, "z", 0.0))
