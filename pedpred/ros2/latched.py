"""Latched topics for viewers and costmaps: later subscribers get the last message."""

from __future__ import annotations

from collections.abc import Callable


class Latched:
    """Remembers on which topics the last message shows people; such a topic is emptied once they have gone.

    Args:
        has_subscribers: whether a topic has any.
    """

    def __init__(self, has_subscribers: Callable[[str], bool]):
        self._has_subscribers = has_subscribers
        self._with_people: set[str] = set()

    @property
    def shows_people(self) -> bool:
        """Whether the last message of a topic shows people."""
        return bool(self._with_people)

    def is_needed(self, topic: str, is_on: bool, people: int) -> bool:
        """Whether to publish a message: there are subscribers, or the last one shows people who have gone.

        Args:
            topic: without namespace.
            is_on: whether the topic is switched on; people are only shown if it is.
            people: how many there are.
        """
        is_read = is_on and self._has_subscribers(topic)
        if is_on and people:
            self._with_people |= {topic} if is_read else set()
            return is_read
        is_stale = topic in self._with_people
        self._with_people.discard(topic)
        return is_read or is_stale
