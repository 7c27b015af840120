"""Latched topics for viewers and costmaps: later subscribers get the last message."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pedpred.scenes import Forecast


class Latched:
    """Keeps on which topics the last message shows people; such a topic is emptied once they have gone.

    Args:
        has_subscribers: whether a topic has any.
    """

    def __init__(self, has_subscribers: Callable[[str], bool]):
        self._has_subscribers = has_subscribers
        self._shows: set[str] = set()

    @property
    def shows_people(self) -> bool:
        """Whether the last message of a topic shows people."""
        return bool(self._shows)

    def wants(self, topic: str, is_on: bool, people: int) -> bool:
        """Whether to publish a message: there are subscribers, or the last one shows people who have gone.

        Args:
            topic: without namespace.
            is_on: whether the settings want the topic; people are only shown if they do.
            people: how many there are.
        """
        is_read = is_on and self._has_subscribers(topic)
        if is_on and people:
            self._shows |= {topic} if is_read else set()
            return is_read
        stale = topic in self._shows
        self._shows.discard(topic)
        return is_read or stale


def nobody(forecast: Forecast, time_s: float) -> Forecast:
    """A forecast without people, with the steps of another one."""
    none = np.zeros(0, np.int64)
    return Forecast(
        time_s, forecast.track_id[none], forecast.velocity[none], forecast.predictions.select(none)
    )
