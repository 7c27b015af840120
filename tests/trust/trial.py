"""One trial: damage a file, read it, and judge the result."""

import resource
import tempfile
import time
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image

from pedpred.errors import PedpredError
from tests.trust.mutations import mutate
from tests.trust.readers import Reader

READ, REFUSED, LOST = "read", "refused", "lost"
SLOWEST_S = 5.0  # limit of CPU time for a damaged file of some kB
MOST_MEMORY_BYTES = 500 * 2**20  # limit of additional memory


class Bench:
    """A folder with an intact example; each trial damages one file and restores it."""

    def __init__(self, name: str, reader: Reader, folder: Path):
        self._name, self._reader, self._folder = name, reader, folder
        reader.make(folder)
        self.intact = {file: (folder / file).read_bytes() for file in reader.files}
        outcome, why = judged(reader, folder)
        if outcome != READ:
            raise AssertionError(f"the intact example of {name}: {why}")

    def damaged(self, seed: int) -> tuple[str, bytes]:
        """Return the file that trial `seed` damages and its damaged bytes, deterministically."""
        rng = np.random.default_rng([zlib.crc32(self._name.encode()), seed])
        file = self._reader.files[int(rng.integers(len(self._reader.files)))]
        return file, mutate(self.intact[file], file, rng)

    def trial(self, seed: int) -> tuple[str, str]:
        """Run trial `seed`: `READ`, `REFUSED` or `LOST`, and the reason."""
        return self.with_content(*self.damaged(seed))

    def with_content(self, file: str, raw: bytes) -> tuple[str, str]:
        """Judge what happens if a file has other bytes."""
        (self._folder / file).write_bytes(raw)
        try:
            return judged(self._reader, self._folder)
        finally:
            (self._folder / file).write_bytes(self.intact[file])


def judged(reader: Reader, folder: Path) -> tuple[str, str]:
    """Read and judge: pass if a result or a `PedpredError` that names the file comes within the bounds."""
    before_s, before_bytes = time.process_time(), _peak_bytes()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            warnings.filterwarnings("ignore", category=UserWarning)
            warnings.filterwarnings("ignore", category=Image.DecompressionBombWarning)
            reader.read(folder)
        outcome, why = READ, ""
    except PedpredError as error:
        outcome, why = REFUSED, str(error)
        if not any(name in why for name in (str(folder), *reader.files)):
            outcome, why = LOST, f"no file is named: {why}"
        for cause in _causes(error):
            if isinstance(cause, MemoryError | RuntimeWarning):
                outcome, why = LOST, f"{type(cause).__name__}: {cause}"
    except Exception as error:  # any other exception is a failure
        outcome, why = LOST, f"{type(error).__name__}: {error}"
    if time.process_time() - before_s > SLOWEST_S:
        outcome, why = LOST, f"{time.process_time() - before_s:.1f} s, {why}"
    if _peak_bytes() - before_bytes > MOST_MEMORY_BYTES:
        outcome, why = LOST, f"{(_peak_bytes() - before_bytes) / 2**20:.0f} MiB, {why}"
    return outcome, why


def _causes(error: BaseException | None) -> Iterator[BaseException]:
    while error := (error.__cause__ or error.__context__):
        yield error


def _peak_bytes() -> int:
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def bench(name: str, reader: Reader) -> Bench:
    """Make a bench in a new temporary folder."""
    return Bench(name, reader, Path(tempfile.mkdtemp(prefix=f"trust-{name}-")))
