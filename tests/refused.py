"""What is refused: by an error that names the field."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from pedpred.errors import ConfigError, ValueRuleError


@contextmanager
def refused(field: str) -> Iterator[None]:
    """Expect an error about a field, or a part of it."""
    with pytest.raises((ConfigError, ValueRuleError)) as error:
        yield
    assert field in error.value.field, error.value
