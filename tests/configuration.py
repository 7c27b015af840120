"""What the configuration and the pipeline hold; what takes a second to make is made once in a process."""

import copy
from functools import cache
from typing import Any

import hydra
import networkx as nx
import yaml
from hydra._internal.config_loader_impl import ConfigLoaderImpl
from hydra.core.override_parser.overrides_parser import OverridesParser
from omegaconf import DictConfig, OmegaConf

from tests.conftest import ROOT


def read(path: str) -> Any:
    """The values of a file of the project, by the fast parser; new ones each time."""
    return yaml.load((ROOT / path).read_text(), yaml.CSafeLoader)


def composed(*overrides: str) -> dict[str, Any]:
    """What conf/ composes to; without overrides that is params.yaml, as `make check` says.

    Overrides of values are applied, by Hydra's function for it, to what files are composed to once.
    """
    if not overrides:
        return read("params.yaml")
    parsed = OverridesParser.create().parse_overrides([*overrides])
    files = [one.input_line for one in parsed if "." not in one.key_or_group]
    changed = copy.deepcopy(_composed(*files))
    ConfigLoaderImpl._apply_overrides_to_config([one for one in parsed if "." in one.key_or_group], changed)
    return OmegaConf.to_container(changed, resolve=True)


@cache
def _composed(*overrides: str) -> DictConfig:
    with hydra.initialize_config_dir(str(ROOT / "conf"), version_base="1.3"):
        return hydra.compose("config", overrides=[*overrides])


@cache
def stages() -> nx.DiGraph:
    """The stages of all pipelines of the project, each with an edge to every one that it needs."""
    from dvc.dvcfile import load_file  # takes a second to import; most do without
    from dvc.repo import Repo
    from dvc.repo.index import Index

    project, found = Repo(str(ROOT)), []
    for path in [ROOT / "dvc.yaml", *sorted(ROOT.glob("studies/*/dvc.yaml"))]:
        file = load_file(project, str(path))
        file.lockfile_contents = {}  # it says nothing of needs, and takes long to parse
        found += file.stages.values()
    return Index(project, stages=found).graph
