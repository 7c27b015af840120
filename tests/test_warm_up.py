"""After `warm_up` nothing is compiled any more, whatever a stream or a recording brings."""

import logging
import os

import pytest

from pedpred.command import main
from pedpred.online import shipped
from tests.conftest import ROOT
from tests.forked import run_forked


def test_after_it_nothing_is_compiled(model, mixture):
    """With the default model and with one of each kind; no loop gets further types, even if they are kept."""
    script = f"from tests.warming import law\nlaw({str(model[0])!r}, {str(mixture[0])!r})"
    done = run_forked(script, ROOT, os.environ)
    assert done.returncode == 0, done.stderr[-3000:]


@pytest.mark.parametrize("kind", ["model", "mixture"])
def test_after_warm_up_with_a_model_no_update_compiles(kind, request):
    folder = request.getfixturevalue(kind)[0]
    script = f"from tests.warming import law_of_updates\nlaw_of_updates({str(folder)!r})"
    done = run_forked(script, ROOT, os.environ)
    assert done.returncode == 0, done.stderr[-3000:]


def test_the_command_says_what_it_did(model, monkeypatch, caplog, tmp_path):
    monkeypatch.setattr(shipped, "_INSTALLED", model[0])
    with caplog.at_level(logging.INFO):
        main(["warm-up"])
        main(["warm-up", "--model", str(model[0])])
    assert caplog.text.count("loops are compiled (") == 4  # what updates call, then the rest
    with pytest.raises(SystemExit, match="there is no such file or folder"):
        main(["warm-up", "--model", str(tmp_path / "none")])
