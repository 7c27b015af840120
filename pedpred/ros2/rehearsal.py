"""What happens at the first message, before it comes."""

from __future__ import annotations

from dataclasses import replace

from pedpred.online import OnlinePredictor
from pedpred.ros.message_types import serialize
from pedpred.ros.scene_messages import header
from pedpred.ros2.follower import Follower
from pedpred.ros2.settings import NodeSettings


def rehearse(predictor: OnlinePredictor, settings: NodeSettings) -> None:
    """Answer a message of nobody: each type takes a while when it is read or written for the first time.

    Else the first people would wait for longer than they may.

    Args:
        predictor: new; it is as before.
        settings: of the node.
    """
    follower = Follower(predictor, replace(settings, use_map=False))
    follower.people_came(serialize(settings.people_type, {"header": header(1, follower.frame)}), 1, 0.0)
    for answer in follower.answers(0.0):
        serialize(answer.kind, answer.content)
    predictor.reset()
