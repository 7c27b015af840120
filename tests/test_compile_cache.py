"""The cache of compiled loops: no file of it is stale, damage and lack of a folder are no errors."""

import concurrent.futures
import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from pedpred.compiled import compiled
from tests.conftest import ROOT
from tests.forked import run_forked

MODULES = {
    "outer.py": """
from typing import NamedTuple

import numpy as np

from inner import inside
from limits import LIMIT, WEIGHTS
from pedpred.compiled import compiled


class Pair(NamedTuple):
    first: float
    second: float


@compiled
def outside(values, pair):
    \"\"\"Sum up.\"\"\"
    total = 0.0
    for value in values:
        total += inside(value) * WEIGHTS[0]
    return min(total, LIMIT) + 1000.0 * pair.first
""",
    "inner.py": """
import math

from pedpred.compiled import compiled


@compiled
def inside(value):
    return 2.0 * deeper(value)


@compiled
def deeper(value):
    return math.sqrt(value)
""",
    "limits.py": """
import numpy as np

LIMIT = 500.0
WEIGHTS = np.array([10.0])
UNUSED = 1.0
""",
}
SCRIPT = """
import numpy as np
from numba.core.event import Listener, register

compiled = []

class Compiling(Listener):
    def on_start(self, event):
        compiled.append(event.data["dispatcher"].py_func.__name__)

    def on_end(self, event):
        pass

register("numba:compile", Compiling())
from outer import Pair, outside

named = {"first": 1.0, "second": 2.0}
value = outside(np.arange(4.0), Pair(**named))
print(value, " ".join(sorted({"outside", "inside", "deeper"} & set(compiled))))
"""
VALUE = 20.0 * (1.0 + np.sqrt(2.0) + np.sqrt(3.0)) + 1000.0
LOOPS = ["deeper", "inside", "outside"]


def run(folder, cache, script=SCRIPT, **environment):
    """Run in a process of its own: the value that a loop gives, names of compiled loops, stderr."""
    environment = {"NUMBA_CACHE_DIR": str(cache), **environment, "PYTHONPATH": f"{folder}:{ROOT}"}
    done = run_forked(script, folder, {k: v for k, v in (os.environ | environment).items() if v})
    assert done.returncode == 0, done.stderr
    value, *names = done.stdout.split()
    return float(value), names, done.stderr


@pytest.fixture(scope="module")
def before(tmp_path_factory):
    """A package with loops, and the cache after it has run."""
    folder, cache = tmp_path_factory.mktemp("loops"), tmp_path_factory.mktemp("cache")
    for name, text in MODULES.items():
        (folder / name).write_text(text)
    assert run(folder, cache)[:2] == (pytest.approx(VALUE), LOOPS)
    return folder, cache


@pytest.fixture
def copied(before, tmp_path):
    """The same package, as it was again afterwards, and a copy of the cache."""
    folder, cache = before[0], tmp_path / "cache"
    shutil.copytree(before[1], cache)
    yield folder, cache
    for name, text in MODULES.items():
        if (folder / name).read_text() != text:
            edit(folder / name, (folder / name).read_text(), text)


def edit(path, old, new):
    """As a careless editor or archive does it: the time of the file stays."""
    about, text = path.stat(), path.read_text()
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))
    os.utime(path, ns=(about.st_atime_ns, about.st_mtime_ns))


@pytest.mark.parametrize(
    ("name", "old", "new", "value"),
    [
        ("inner.py", "math.sqrt", "0.5 * math.sqrt", 0.5 * (VALUE - 1000.0) + 1000.0),
        ("limits.py", "500.0", " 50.0", 1050.0),
        ("limits.py", "10.0", "20.0", 2.0 * (VALUE - 1000.0) + 1000.0),
        ("outer.py", "first: float\n    second: float", "second: float\n    first: float", VALUE),
    ],
    ids=["a loop two calls below", "a constant", "an array", "the order of fields"],
)
def test_edited_code_and_constants_are_compiled_again(copied, name, old, new, value):
    folder, cache = copied
    edit(folder / name, old, new)
    found, names, _ = run(folder, cache)
    assert "outside" in names
    assert found == pytest.approx(value)


def test_comments_docstrings_and_unused_names_do_not_count(copied):
    """And former code is still cached beside that of now."""
    folder, cache = copied
    edit(folder / "outer.py", "Sum up.", "Add up, the limit included.")
    edit(folder / "limits.py", "UNUSED = 1.0", "UNUSED = 2.0")
    edit(folder / "inner.py", "2.0 * deeper", "3.0 * deeper")
    assert run(folder, cache)[1] == ["inside", "outside"]
    edit(folder / "inner.py", "3.0 * deeper", "2.0 * deeper")
    assert run(folder, cache)[:2] == (pytest.approx(VALUE), [])


def test_a_damaged_file_is_compiled_again_and_replaced(copied):
    """Cut, with one bit changed, or another pickle."""
    folder, cache = copied
    for kind, path in enumerate(sorted(cache.rglob("*.loop"))):
        raw = path.read_bytes()
        half = len(raw) // 2
        flipped = raw[:half] + bytes([raw[half] ^ 1]) + raw[half + 1 :]
        path.write_bytes((raw[:half], flipped, b"cos\nsystem\n(S'exit'\ntR." + raw)[kind])
    assert run(folder, cache)[:2] == (pytest.approx(VALUE), LOOPS)
    assert run(folder, cache)[:2] == (pytest.approx(VALUE), [])


def test_without_a_cache_loops_are_compiled_with_one_warning(before):
    value, names, log = run(before[0], "", XDG_CACHE_HOME="", HOME="/dev/null")
    assert (value, names) == (pytest.approx(VALUE), LOOPS)
    assert log.count("NUMBA_CACHE_DIR") == 1


FULL = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\n"
"""Room for messages, and for no file of the cache."""


def test_a_cache_that_cannot_be_written_is_read(before):
    """As in the image of a container, with code compiled when it was made; here the disk is full."""
    assert run(*before, FULL + SCRIPT) == (pytest.approx(VALUE), [], "")


def test_processes_that_compile_at_once_share_the_users_cache(before, tmp_path):
    places = [{"XDG_CACHE_HOME": str(tmp_path / "xdg")}] * 2
    places.append({"XDG_CACHE_HOME": "", "HOME": str(tmp_path / "home")})
    with concurrent.futures.ThreadPoolExecutor(3) as pool:
        values = [found[0] for found in pool.map(lambda place: run(before[0], "", **place), places)]
    assert values == [pytest.approx(VALUE)] * 3
    assert run(before[0], "", **places[0])[1] == []
    for folder in (tmp_path / "xdg/pedpred/compiled", tmp_path / "home/.cache/pedpred/compiled"):
        assert len(list(folder.rglob("*.loop"))) == 3
        assert not folder.stat().st_mode & 0o077


def test_a_loop_that_reads_a_dict_or_method_is_refused():
    settings = {"limit": 1.0}

    def reads_a_dict():
        return settings["limit"]

    def reads_a_module():
        return Path.cwd

    for loop, name in ((reads_a_dict, "settings"), (reads_a_module, "Path")):
        with pytest.raises(TypeError, match=name):
            compiled(loop)()
