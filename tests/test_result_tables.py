"""The tables of results on README and in docs/, for any selection of places and methods."""

import json
from itertools import combinations

import pytest

from pedpred.config import plain, read_params
from pedpred.report.methods import Methods
from tests.conftest import ROOT
from tools.readme import tables_from

SIMPLE = ("cv", "ca", "kalman_cv")


@pytest.fixture(scope="module")
def methods():
    params = plain(read_params(ROOT))
    return Methods.parse(params["report"]["methods"], params["comparison"]["reference"])


@pytest.fixture
def studies():
    files = {study: ROOT / f"reports/metrics/{study}.json" for study in ("transfer", "real")}
    return {study: json.loads(path.read_text()) for study, path in files.items()}


def test_a_place_of_one_study_has_an_empty_cell_for_the_other(studies, methods):
    studies["real"]["crossing"] = studies["real"]["eth"]
    row = tables_from(studies, methods)["places"].splitlines()[-1]
    assert row.startswith("| crossing | ")
    assert row.count("|  |") == 1  # of the network that is trained in simulation only


@pytest.mark.parametrize("left_out", [some for n in (1, 2, 3) for some in combinations(SIMPLE, n)])
def test_tables_do_without_simple_methods(studies, methods, left_out):
    for figures in studies.values():
        for method in left_out:
            del figures["eth"][method]
    tables = tables_from(studies, methods)
    assert "| eth | " in tables["places"]
    assert (" eth " in tables["headline"]) == (len(left_out) < len(SIMPLE))


def test_nothing_relates_to_an_exact_forecast(studies, methods):
    studies["real"]["eth"]["cv"]["ade_m"] = 0.0
    assert " eth " not in tables_from(studies, methods)["headline"]
