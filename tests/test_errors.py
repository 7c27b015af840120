"""Errors cross processes whole, so that a damaged file that a worker meets is named."""

import pickle
from pathlib import Path

import pytest

from pedpred import errors
from pedpred.errors import PedpredError, SourceError

EXAMPLES = {
    "PedpredError": ("wrong",),
    "ShapeError": ("points", (3, 2), "[N, 3]"),
    "ValueRuleError": ("dt_s", -1.0, "it must be positive"),
    "ConfigError": ("scale", "huge", "choose another one"),
    "FileError": (Path("a.csv"), ", line 3", "too short", "Repair it"),
    "SourceError": (Path("a.csv"), 3, "too short"),
    "StorageError": (Path("a.parquet"), "column x_m", "it is missing", "Write it again"),
    "WorkerError": ("simulate",),
    "FetchError": ("ewap", ["H.txt"], {"here": "missing"}, True),
    "OutputError": (Path("a.mcap"), "read-only"),
}
KINDS = [kind for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, PedpredError)]


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_an_error_survives_pickling(kind):
    error = kind(*EXAMPLES[kind.__name__])
    again = pickle.loads(pickle.dumps(error))  # noqa: S301 (its own bytes)
    assert type(again) is kind
    assert str(again) == str(error)
    assert vars(again) == vars(error)


def test_an_error_holds_what_its_message_names():
    facts = {
        "SourceError": {"path": Path("a.csv"), "line": 3},
        "StorageError": {"path": Path("a.parquet"), "field": "column x_m"},
        "ValueRuleError": {"field": "dt_s", "value": -1.0, "rule": "it must be positive"},
        "ConfigError": {"field": "scale", "value": "huge"},
        "ShapeError": {"field": "points"},
    }
    for name, attributes in facts.items():
        assert vars(getattr(errors, name)(*EXAMPLES[name])) == attributes


def _refuse(number):
    raise SourceError(Path(f"place_{number}.txt"), number, "damaged")


def test_a_damaged_file_that_a_worker_meets_is_named(monkeypatch):
    from pedpred.workers import in_parallel

    monkeypatch.setenv("PEDPRED_JOBS", "2")
    with pytest.raises(SourceError, match=r"place_\d\.txt, line \d: damaged"):
        in_parallel(_refuse, [(n,) for n in range(3)], "read", "file")
