"""Whether the libraries of the extra `files` are installed, which a robot does not need."""

from __future__ import annotations

from importlib.util import find_spec

LIBRARIES = ("PIL", "lz4", "mcap", "pandas", "pyarrow", "scipy", "shapely", "skfmm", "tqdm", "zstandard")
"""What the commands that read files import, besides what every installation has."""


def missing_libraries() -> list[str]:
    """Return the modules in `LIBRARIES` that are not installed."""
    return [name for name in LIBRARIES if find_spec(name) is None]
