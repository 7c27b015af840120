"""Errors cross processes whole, so that a damaged file that a worker meets is named."""

from pathlib import Path

import pytest

from pedpred.errors import ConfigError, InputError, ValueRuleError, shape_error


@pytest.mark.parametrize(
    ("error", "facts"),
    [
        (
            InputError(Path("a.csv"), 3, "too short"),
            {"path": Path("a.csv"), "where": 3, "problem": "a.csv, line 3: too short"},
        ),
        (
            InputError(Path("a.parquet"), "column x_m", "it is missing", "Write it again"),
            {
                "path": Path("a.parquet"),
                "where": "column x_m",
                "problem": "a.parquet, column x_m: it is missing",
            },
        ),
        (
            ValueRuleError("dt_s", -1.0, "it must be positive"),
            {"field": "dt_s", "value": -1.0, "rule": "it must be positive"},
        ),
        (ConfigError("scale", "huge", "choose another one"), {"field": "scale", "value": "huge"}),
        (
            shape_error("points", (3, 2), "[N, 3]"),
            {"field": "points", "value": (3, 2), "rule": "its shape must be [N, 3]"},
        ),
    ],
)
def test_an_error_holds_what_its_message_names(error, facts):
    assert vars(error) == facts


def _refuse(number):
    raise InputError(Path(f"place_{number}.txt"), number, "damaged")


def test_a_damaged_file_that_a_worker_meets_is_named(monkeypatch):
    from pedpred.workers import in_parallel

    monkeypatch.setenv("PEDPRED_JOBS", "2")
    with pytest.raises(InputError, match=r"place_\d\.txt, line \d: damaged"):
        in_parallel(_refuse, [(n,) for n in range(3)], "read", "file")
