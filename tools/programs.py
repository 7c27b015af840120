"""The programs that tools start, and their own process."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path


def beside_python() -> dict[str, str]:
    """Return the environment in which programs, and what they start, come from the folder of this Python.

    `dvc` and the `python` of its stages are then those of .venv, also where it is not activated.
    """
    return os.environ | {
        "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", os.defpath)])
    }


def git(*arguments: str) -> subprocess.CompletedProcess[bytes]:
    """Run a git command; return its output and exit status."""
    command = ["git", *arguments]
    return subprocess.run(command, capture_output=True, check=False)  # noqa: S603, a list, no shell


def compute_in_one_thread() -> None:
    """Let numpy and the like start no threads, if they have not been imported yet."""
    libraries = ("OMP", "OPENBLAS", "MKL", "NUMBA")
    os.environ |= {f"{library}_NUM_THREADS": "1" for library in libraries}
