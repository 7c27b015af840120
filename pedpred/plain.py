"""Bounded parsing of JSON and YAML: a short YAML text can stand for any number of values."""

from __future__ import annotations

import json
from collections import Counter
from typing import Any

import yaml

from pedpred.errors import brief

_MOST_NODES = 2**15


def parse_json(raw: bytes | str) -> Any:
    """Parse JSON in the strict sense: no NaN or Infinity, no key twice.

    Args:
        raw: the text.

    Raises:
        ValueError: it is not such JSON.
        RecursionError: it is nested too deeply.
    """
    text = raw if isinstance(raw, str) else raw.decode(json.detect_encoding(raw))
    return _JSON.decode(text)


def _no_number(name: str) -> None:
    raise ValueError(f"{name} is not a number")


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    _check_keys([key for key, _ in pairs])
    return dict(pairs)


def _check_keys(keys: list[str]) -> None:
    """Refuse a key that is there twice."""
    if len(set(keys)) < len(keys):
        twice, _ = Counter(keys).most_common(1)[0]
        raise ValueError(f"the key {brief(twice)} is there twice")


_JSON = json.JSONDecoder(parse_constant=_no_number, object_pairs_hook=_object)


def parse_yaml(raw: bytes | str) -> Any:
    """Parse YAML, safe subset, that expands to some ten thousand values at most, and has no key twice.

    Raises:
        yaml.YAMLError: it is not such YAML.
        ValueError: it is or stands for too much, or a value is none of its type.
        RecursionError: it is nested too deeply.
    """
    loader = _BoundedLoader(raw)
    try:
        return loader.get_single_data()
    finally:
        loader.dispose()


class _BoundedLoader(yaml.SafeLoader):
    """Count every alias as what it stands for: ten aliases of ten aliases and so on are a huge value."""

    def __init__(self, stream: bytes | str):
        super().__init__(stream)
        self._nodes = 0
        self._sizes: dict[str, int] = {}

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """Compose a node within the bound."""
        event, before = self.peek_event(), self._nodes
        self._nodes += 1
        if isinstance(event, yaml.AliasEvent):
            self._nodes += self._sizes.get(str(event.anchor), _MOST_NODES)  # no size yet: inside itself
        if self._nodes > _MOST_NODES:
            line = event.start_mark.line + 1
            raise ValueError(f"line {line}: more than {_MOST_NODES} values with those that aliases stand for")
        node = super().compose_node(parent, index)
        if isinstance(event, yaml.NodeEvent) and event.anchor and not isinstance(event, yaml.AliasEvent):
            self._sizes[event.anchor] = self._nodes - before
        return node

    def compose_mapping_node(self, anchor: Any) -> yaml.MappingNode:
        """Compose a mapping whose keys differ."""
        node = super().compose_mapping_node(anchor)
        _check_keys([f"{key.tag} {key.value}" for key, _ in node.value if isinstance(key, yaml.ScalarNode)])
        return node
