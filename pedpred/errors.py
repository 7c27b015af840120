"""Errors of this package: they take facts and word themselves.

Every error names the file (and line or field) it is about, the offending value and what to do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

_REPAIR_SOURCE = "Correct the file or fetch it again (python -m stages.fetch)"


class PedpredError(Exception):
    """Root of all errors that a user of pedpred can cause and can repair."""


class ShapeError(PedpredError):
    """An array has the wrong shape."""

    def __init__(self, field: str, shape: Sequence[int], expected: str):
        super().__init__(f"{field} has shape {tuple(shape)}, expected {expected}")


class ValueRuleError(PedpredError):
    """A field of a value object breaks its rule."""

    def __init__(self, field: str, value: object, rule: str):
        super().__init__(f"{field} = {value!r}, but {rule}")
        self.field, self.value, self.rule = field, value, rule


class ConfigError(PedpredError):
    """A configuration key, option or combination is not understood."""

    def __init__(self, key: str, value: object, remedy: str):
        super().__init__(f"configuration key '{key}' = {value!r}: {remedy}")


class FileError(PedpredError):
    """A file cannot be understood; the message names it."""


class SourceError(FileError):
    """A raw file cannot be understood."""

    def __init__(self, path: Path, line: int | None, problem: str, remedy: str = _REPAIR_SOURCE):
        where = f"{path}, line {line}" if line is not None else str(path)
        super().__init__(f"{where}: {problem}. {remedy}")


class StorageError(FileError):
    """A file that pedpred wrote (scene, shard, checkpoint) cannot be read back."""

    def __init__(self, path: Path, field: str, problem: str, remedy: str):
        super().__init__(f"{path}, {field}: {problem}. {remedy}")


class WorkerError(PedpredError):
    """A worker process was killed from outside, by a person or for want of memory."""

    def __init__(self, title: str):
        super().__init__(
            f"{title}: a worker process was killed, perhaps for want of memory. "
            "Nothing half-finished was kept; run it again, with fewer workers: PEDPRED_JOBS=1 dvc repro"
        )


class FetchError(PedpredError):
    """Raw data could be obtained from none of the configured mirrors."""

    def __init__(self, data_set: str, files: Sequence[str], tried: Mapping[str, str]):
        attempts = "; ".join(f"{place}: {lack}" for place, lack in tried.items()) or "nothing, none is named"
        super().__init__(
            f"no mirror has the files of {data_set}, unaltered. Download its archive by other means and put "
            f"{' '.join(files)} into the folder mirror/{data_set}, or name the folder that holds them: "
            f"PEDPRED_MIRROR=/my/folder python -m stages.fetch. Tried were {attempts}."
        )
