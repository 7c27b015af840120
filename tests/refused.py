"""What is refused: by an error that names the field, or the file."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from pedpred.errors import ConfigError, InputError, ValueRuleError


@contextmanager
def refused(field: str) -> Iterator[None]:
    """Expect an error about a field, or a part of it."""
    with pytest.raises((ConfigError, ValueRuleError)) as error:
        yield
    assert field in error.value.field, error.value


@contextmanager
def unread(path: Path, where: object = ..., remedy: str = "") -> Iterator[None]:
    """Expect an error about a file; `where` in it, if given, and words that tell what to do."""
    with pytest.raises(InputError) as error:
        yield
    assert error.value.path == path, error.value
    assert where in (..., error.value.where), error.value
    assert remedy in str(error.value)
