"""Settings of hypothesis for tests that run without `conftest.py`, where there is no torch."""

from hypothesis import settings

settings.register_profile("unhurried", deadline=None, derandomize=True)
settings.load_profile("unhurried")
