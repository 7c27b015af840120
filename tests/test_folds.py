"""Folds: nobody is tested where they were trained, and robots drive with networks that are trained."""

import pytest

from stages.config import weights_of
from stages.export import GROUPS as EXPORTING
from stages.folds import trained_sets
from tests.configuration import composed
from tests.conftest import ROOT

SITES = {"zara": ["zara01", "zara02", "zara03"], "campus": ["students001", "students003"]}
"""Places that were recorded several times: a fold leaves out all of their recordings."""
FOLDS = sorted((ROOT / "conf/folds").glob("*.yaml"))


@pytest.mark.parametrize("path", FOLDS, ids=lambda path: path.stem)
def test_each_place_is_left_out_once(path):
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


@pytest.mark.parametrize("path", FOLDS, ids=lambda path: path.stem)
def test_robots_drive_with_networks_that_some_fold_trains(path):
    params = composed(f"folds={path.stem}")
    exports = {name: row for group in EXPORTING for name, row in params[group]["exports"].items()}
    tables = (params, params | params["literature"])
    for row in exports.values():
        assert any(row["weights"] in weights_of(own, row["network"]) for own in tables)
    for row in params["driving"]["places"].values():
        assert {row["model"], row["lstm"]} <= {f"models/online/{name}" for name in exports}
