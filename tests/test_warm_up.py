"""After `warm_up` nothing is compiled any more, whatever a stream or a recording brings."""

import os

import pytest

from pedpred.command import main
from tests.conftest import ROOT
from tests.forked import run_forked


@pytest.mark.parametrize(
    ("law", "kinds"), [("law", "model mixture"), ("law_of_updates", "model"), ("law_of_updates", "mixture")]
)
def test_after_it_nothing_is_compiled(law, kinds, request):
    """With the default model and with one of each kind; no loop gets further types, even if they are kept."""
    folders = [str(request.getfixturevalue(kind)[0]) for kind in kinds.split()]
    done = run_forked(f"from tests.warming import {law}\n{law}(*{folders})", ROOT, os.environ)
    assert done.returncode == 0, done.stderr[-3000:]


def test_the_command_needs_a_model_that_exists(tmp_path):
    with pytest.raises(SystemExit):
        main(["warm-up", "--model", str(tmp_path / "none")])
