"""Latched topics for viewers and costmaps: whoever subscribes later is sent the last message."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pedpred.scenes import Forecast


class Latched:
    """Knows on which topics the last message shows people; such a topic is emptied once they have gone.

    Args:
        is_heard: whether somebody listens to a topic.
    """

    def __init__(self, is_heard: Callable[[str], bool]):
        self._is_heard = is_heard
        self._shows: set[str] = set()

    @property
    def shows_people(self) -> bool:
        """Whether the last message of a topic shows people."""
        return bool(self._shows)

    def wants(self, topic: str, is_on: bool, people: int) -> bool:
        """Whether a message is to be published: somebody listens, or the last one shows people who are gone.

        Args:
            topic: without namespace.
            is_on: whether the settings want the topic; nobody may be shown on one that they do not want.
            people: how many there are.
        """
        heard = is_on and self._is_heard(topic)
        if is_on and people:
            self._shows |= {topic} if heard else set()
            return heard
        stale = topic in self._shows
        self._shows.discard(topic)
        return heard or stale


def nobody(forecast: Forecast, time_s: float) -> Forecast:
    """A forecast of nobody, with the steps of another one."""
    none = np.zeros(0, np.int64)
    return Forecast(
        time_s, forecast.track_id[none], forecast.velocity[none], forecast.predictions.select(none)
    )
