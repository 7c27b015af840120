"""Warm up the types of messages: each takes a while when it is read or written for the first time."""

from __future__ import annotations

from dataclasses import replace

from pedpred.online import OnlinePredictor
from pedpred.ros.message_types import serialize
from pedpred.ros.people import PEOPLE_FIELDS
from pedpred.ros.scene_messages import header
from pedpred.ros2.follower import Follower
from pedpred.ros2.settings import NodeSettings


def rehearse(predictor: OnlinePredictor, settings: NodeSettings) -> None:
    """Forecast a message without people; the predictor is reset after that.

    Args:
        predictor: new.
        settings: of the node.
    """
    if settings.people_type not in PEOPLE_FIELDS:
        settings = replace(settings, people_type=NodeSettings().people_type, people_fields="")
    follower = Follower(predictor, replace(settings, use_map=False))
    raw = serialize(settings.people_type, {"header": header(1, follower.map.frame)})
    follower.inbox.take_people(raw, 1, 0.0)
    for output in follower.outputs(0.0):
        serialize(output.kind, output.content)
    predictor.reset()
