"""The programs that tools start."""

from __future__ import annotations

import os
import sys
from pathlib import Path


def beside_python() -> dict[str, str]:
    """Return the environment in which programs, and what they start, come from the folder of this Python.

    `dvc` and the `python` of its stages are then those of .venv, also where nobody has activated it.
    """
    return os.environ | {
        "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", os.defpath)])
    }
