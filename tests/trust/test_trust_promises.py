"""The page of guarantees: every promise names its tests, and they exist."""

import ast
import re

from tests.conftest import ROOT

PAGE = (ROOT / "docs/guarantees.md").read_text()


def test_every_promise_names_tests_that_exist():
    promises = re.findall(r"^\* \*\*.*?(?=^\* |^## |\Z)", PAGE, re.MULTILINE | re.DOTALL)
    assert [promise for promise in promises if not re.search(r"`tests/[\w/]+\.py::test_\w+`", promise)] == []
    named = set(re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", PAGE))
    trees = {file: ast.parse((ROOT / file).read_text()) for file, _ in named if (ROOT / file).exists()}
    defined = {(file, getattr(node, "name", "")) for file, tree in trees.items() for node in tree.body}
    assert sorted(named - defined) == []
