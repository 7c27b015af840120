"""What the configuration and the pipeline hold; what takes a second to make is made once in a process."""

from functools import cache
from typing import Any

import networkx as nx
import yaml

from pedpred import config
from tests.conftest import ROOT


def read(path: str) -> Any:
    """The values of a file of the project, by the fast parser; new ones each time."""
    return yaml.load((ROOT / path).read_text(), yaml.CSafeLoader)


def composed(*overrides: str) -> dict[str, Any]:
    """What conf/ composes to; without overrides that is params.yaml, as `test_house.py` says."""
    return yaml.load(_text(*overrides), yaml.CSafeLoader) if overrides else read("params.yaml")


@cache
def _text(*overrides: str) -> str:
    return config.composed(ROOT / "conf", [*overrides])


@cache
def stages() -> nx.DiGraph:
    """The stages of the project, each with an edge to every one that it needs."""
    from tools.staleness import pipeline  # takes a second to import; most do without

    return pipeline(ROOT)
