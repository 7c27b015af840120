"""Scripts in new processes that begin with numba loaded, which takes longer than what they are about.

Nothing is compiled beforehand; folder, environment, path and output of a script are its own.
"""

import os
import sys
import tempfile
from collections.abc import Mapping
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

from numba.core.registry import cpu_target

cpu_target.typing_context.refresh()  # else each process would do so at its first call
cpu_target.target_context.refresh()


class Ended(NamedTuple):
    """How a script ended, and what it said."""

    returncode: int
    stdout: str
    stderr: str


def run_forked(script: str, folder: Path, environment: Mapping[str, str]) -> Ended:
    """Run a script in a folder, where it also finds modules, with all its variables of the environment.

    Its process is forked from one that has imported this module and `pedpred.compiled` of this project.
    """
    context = get_context("forkserver")
    context.set_forkserver_preload(["pedpred.compiled", __name__])
    with tempfile.TemporaryDirectory() as scratch:
        said = [Path(scratch, stream) for stream in ("stdout", "stderr")]
        process = context.Process(target=_run, args=(script, folder, said, dict(environment)))
        process.start()
        process.join()
        assert process.exitcode is not None
        return Ended(process.exitcode, *(path.read_text() for path in said))


def _run(script: str, folder: Path, said: list[Path], environment: dict[str, str]) -> None:
    """Become what `python -B -c` starts."""
    for stream, path in enumerate(said, 1):
        file = os.open(path, os.O_WRONLY | os.O_CREAT)
        os.dup2(file, stream)
        os.close(file)
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(folder)
    sys.path.insert(0, str(folder))
    sys.dont_write_bytecode = True
    exec(script, {"__name__": "__main__"})
