"""The page of guarantees names tests that exist, and dependencies are those that are declared."""

import ast
import re

import pytest

from tests.conftest import ROOT

PAGE = (ROOT / "docs/guarantees.md").read_text()
NAMED = re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", PAGE)
PROMISES = re.findall(r"^\* \*\*.*?(?=^\* |^## |\Z)", PAGE, re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize(("file", "name"), NAMED)
def test_a_named_test_exists(file, name):
    defined = {node.name for node in ast.parse((ROOT / file).read_text()).body if hasattr(node, "name")}
    assert name in defined


@pytest.mark.parametrize("promise", PROMISES, ids=lambda text: text[4:50])
def test_a_promise_names_a_test(promise):
    assert re.search(r"`tests/[\w/]+\.py::test_\w+`", promise)


def test_there_are_promises():
    assert len(PROMISES) > 10
    assert len(NAMED) >= len(PROMISES)
