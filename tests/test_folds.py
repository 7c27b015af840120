"""Folds are data: any choice of them composes, and nobody is tested where they were trained."""

import re
import shlex
from itertools import pairwise

import pytest

from stages.config import weights_of
from stages.export import GROUPS as EXPORTING
from stages.folds import trained_sets
from tests.configuration import composed, read
from tests.conftest import ROOT

SITES = {"zara": ["zara01", "zara02", "zara03"], "campus": ["students001", "students003"]}
"""Places that were recorded several times: a fold leaves out all of their recordings."""
FOLDS = sorted((ROOT / "conf/folds").glob("*.yaml"))


def experiments():
    """The overrides of every experiment about folds in docs/training.md."""
    commands = re.findall(r"^dvc exp run (.*folds.*)$", (ROOT / "docs/training.md").read_text(), re.MULTILINE)
    words = [shlex.split(command, comments=True) for command in commands]
    return [[value for key, value in pairwise(own) if key == "-S"] for own in words]


@pytest.mark.parametrize("path", FOLDS, ids=lambda path: path.stem)
def test_each_place_is_left_out_once_and_tested_by_the_simulations_network_too(path):
    folds = composed(f"folds={path.stem}")["folds"]
    (transfer,) = folds["transfer"].values()
    left_out = [place for fold in folds["real"].values() for place in fold["test"]]
    assert left_out == transfer["test"]
    for name, fold in folds["real"].items():
        own = SITES.get(name.removeprefix("without_"), [name.removeprefix("without_")])
        assert [f"real/{place}" for place in own] == fold["test"]
        trained = trained_sets(fold, composed()["places"])
        real = [entry for entry in trained if entry != "simulated/worlds"]
        assert sorted(real + fold["test"]) == sorted(transfer["test"])


def test_by_default_all_places_are_tested():
    params = composed()
    tested = {place for fold in params["folds"]["real"].values() for place in fold["test"]}
    assert tested == {f"real/{name}" for name in params["places"]}


@pytest.mark.parametrize(
    "overrides", [[f"folds={path.stem}"] for path in FOLDS] + experiments(), ids=" ".join
)
def test_robots_drive_with_networks_that_some_fold_trains(overrides):
    params = composed(*overrides)
    exports = {name: row for group in EXPORTING for name, row in params[group]["exports"].items()}
    if not any(override.startswith("~") for override in overrides):
        for row in exports.values():
            tables = (params, params | params["literature"])
            assert any(row["weights"] in weights_of(own, row["network"]) for own in tables)
    for row in params["driving"]["places"].values():
        assert {row["model"], row["lstm"]} <= {f"models/online/{name}" for name in exports}


@pytest.mark.parametrize("overrides", experiments(), ids=" ".join)
def test_the_subsets_in_the_documentation_compose(overrides):
    usual, chosen = composed()["folds"], composed(*overrides)["folds"]
    assert chosen.keys() == usual.keys()
    for override in overrides:
        removed = re.match(r"~folds\.(\w+)\.(\w+)", override)
        added = re.match(r"\+folds\.(\w+)\.(\w+)=", override)
        if removed:
            assert set(usual[removed[1]]) - set(chosen[removed[1]]) == {removed[2]}
        elif added:
            assert set(chosen[added[1]]) - set(usual[added[1]]) == {added[2]}
        else:
            stem = override.removeprefix("folds=")
            assert chosen == read(f"conf/folds/{stem}.yaml")
