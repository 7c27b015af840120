"""Compiled code that is kept: never stale, never in the way."""

import concurrent.futures
import importlib
import os
import pkgutil
import shutil
import subprocess
import sys
import textwrap
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import pedpred
from pedpred.compiled import cache_folder, compiled
from pedpred.contents import contents
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
import logging
import sys

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


def run(folder, cache, script=SCRIPT, wrapper=None, **environment):
    """Run in a process of its own: the value that a loop gives, names of compiled loops, what was said.

    With a wrapper, be it empty, the process begins with nothing imported, and may have another `pedpred`.
    """
    environment = {"NUMBA_CACHE_DIR": str(cache), **environment, "PYTHONPATH": f"{folder}:{ROOT}"}
    env = {k: v for k, v in (os.environ | environment).items() if v}
    if wrapper is None:
        done = run_forked(script, folder, env)
    else:
        done = subprocess.run(
            [*wrapper, sys.executable, "-B", "-c", script],
            cwd=folder,
            env=env,
            capture_output=True,
            text=True,
            check=False,
        )
    assert done.returncode == 0, done.stderr
    value, *names = done.stdout.split()
    return float(value), names, done.stderr


@pytest.fixture(scope="module")
def before(tmp_path_factory):
    """A package with loops, and the cache after it has run."""
    folder, cache = tmp_path_factory.mktemp("loops"), tmp_path_factory.mktemp("cache")
    for name, text in MODULES.items():
        (folder / name).write_text(text)
    value, names, _ = run(folder, cache)
    assert value == pytest.approx(VALUE)
    assert names == ["deeper", "inside", "outside"]
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


def kept(cache):
    return sorted(path.name for path in cache.rglob("*.loop"))


@pytest.mark.parametrize(
    ("name", "old", "new", "value"),
    [
        ("inner.py", "2.0 * deeper", "3.0 * deeper", 1.5 * (VALUE - 1000.0) + 1000.0),
        ("inner.py", "math.sqrt", "math.sin ", None),
        ("limits.py", "500.0", " 50.0", 1050.0),
        ("limits.py", "10.0", "20.0", 2.0 * (VALUE - 1000.0) + 1000.0),
        ("outer.py", "first: float\n    second: float", "second: float\n    first: float", VALUE),
    ],
    ids=["a loop that is called", "one that this calls", "a constant", "an array", "the order of fields"],
)
def test_an_edit_counts_without_deleting_anything(copied, tmp_path, name, old, new, value):
    folder, cache = copied
    edit(folder / name, old, new)
    found, names, _ = run(folder, cache)
    assert "outside" in names
    assert found == run(folder, tmp_path / "empty")[0]
    assert value is None or found == pytest.approx(value)


def test_the_code_before_an_edit_is_kept_beside_that_after_it(copied):
    folder, cache = copied
    edit(folder / "inner.py", "2.0 * deeper", "3.0 * deeper")
    assert "deeper" not in run(folder, cache)[1]
    edit(folder / "inner.py", "3.0 * deeper", "2.0 * deeper")
    assert run(folder, cache)[:2] == (pytest.approx(VALUE), [])


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [("outer.py", "Sum up.", "Add up, the limit included."), ("limits.py", "UNUSED = 1.0", "UNUSED = 2.0")],
)
def test_an_edit_of_what_is_not_compiled_compiles_nothing(copied, name, old, new):
    folder, cache = copied
    edit(folder / name, old, new)
    edit(folder / "inner.py", "import math", "# a comment\n\nimport math")
    assert run(folder, cache)[:2] == (pytest.approx(VALUE), [])


DAMAGES = {
    "empty": lambda raw: b"",
    "cut": lambda raw: raw[: len(raw) // 2],
    "zeros": lambda raw: bytes(len(raw)),
    "zeros from some page on": lambda raw: raw[:4096] + bytes(len(raw) - 4096),
    "one bit": lambda raw: raw[: len(raw) // 2] + bytes([raw[len(raw) // 2] ^ 1]) + raw[len(raw) // 2 + 1 :],
    "something else": lambda raw: b"cos\nsystem\n(S'exit'\ntR." + raw,
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_file_is_replaced(copied, damage):
    """As after a power cut; nothing has to be deleted by hand."""
    folder, cache = copied
    for path in filter(Path.is_file, cache.rglob("*")):
        path.write_bytes(DAMAGES[damage](path.read_bytes()))
    value, names, said = run(folder, cache)
    assert (value, names) == (pytest.approx(VALUE), ["deeper", "inside", "outside"])
    assert "cannot" not in said
    assert run(folder, cache)[:2] == (pytest.approx(VALUE), [])


def test_a_folder_in_the_place_of_a_file_is_no_error(copied):
    folder, cache = copied
    for path in cache.rglob("*.loop"):
        path.unlink()
        path.mkdir()
    assert run(folder, cache)[0] == pytest.approx(VALUE)


def no_place(tmp_path):
    (tmp_path / "file").touch()
    return {"NUMBA_CACHE_DIR": str(tmp_path / "file")}, "", None


def no_home(tmp_path):
    return {"NUMBA_CACHE_DIR": "", "XDG_CACHE_HOME": "", "HOME": "/dev/null"}, "", ()


def full_disk(tmp_path):
    limit = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))\n"
    return {"NUMBA_CACHE_DIR": str(tmp_path / "full")}, limit, ()


@pytest.mark.parametrize("place", [no_place, no_home, full_disk])
def test_without_a_place_loops_are_compiled_all_the_same(before, tmp_path, place):
    environment, first, wrapper = place(tmp_path)
    value, names, said = run(before[0], tmp_path, first + SCRIPT, wrapper, **environment)
    assert (value, names) == (pytest.approx(VALUE), ["deeper", "inside", "outside"])
    assert said.count("compiled code cannot be kept in ") == 1
    assert not kept(tmp_path)


@contextmanager
def read_only(folder):
    """Nobody can write into a folder: the beginning of commands that are to see it so."""
    if os.geteuid():
        for path in [folder, *folder.rglob("*/")]:
            path.chmod(0o555)
        yield []
        for path in [folder, *folder.rglob("*/")]:
            path.chmod(0o755)
        return
    mount = 'mount --bind "$0" "$0" && mount -o remount,bind,ro "$0" && exec "$@"'
    wrapper = ["unshare", "--mount", "sh", "-c", mount, str(folder)]
    if subprocess.run([*wrapper, "true"], capture_output=True, check=False).returncode:
        pytest.skip("needs mounts of its own")
    yield wrapper


def test_a_read_only_installation_works(before, tmp_path):
    """Package and home as in a container: the command answers, loops are compiled."""
    shutil.copytree(before[0], tmp_path / "all")
    shutil.copytree(ROOT / "pedpred", tmp_path / "all" / "pedpred")
    (tmp_path / "all" / "home").mkdir()
    about = f"from pedpred.command import main\nmain(['info', {str(ROOT / 'examples/corner/walk.txt')!r}])\n"
    silent = "import contextlib, io\nwith contextlib.redirect_stdout(io.StringIO()):\n"
    command = silent + textwrap.indent(about, "    ")
    environment = {"XDG_CACHE_HOME": "", "HOME": str(tmp_path / "all" / "home")}
    with read_only(tmp_path / "all") as wrapper:
        value, names, said = run(tmp_path / "all", "", command + SCRIPT, wrapper, **environment)
    assert (value, names) == (pytest.approx(VALUE), ["deeper", "inside", "outside"])
    assert said.count("compiled code cannot be kept in ") == 1


def test_a_folder_that_cannot_be_written_to_is_read(before, tmp_path):
    """An image of a container, with code compiled when it was made; here the disk is full."""
    value, names, said = run(before[0], before[1], full_disk(tmp_path)[1] + SCRIPT, ())
    assert (value, names, said) == (pytest.approx(VALUE), [], "")


def test_the_place_is_that_of_the_user(before, tmp_path):
    run(before[0], "", XDG_CACHE_HOME=str(tmp_path / "xdg"))
    run(before[0], "", XDG_CACHE_HOME="", HOME=str(tmp_path / "home"))
    folders = tmp_path / "xdg" / "pedpred" / "compiled", tmp_path / "home" / ".cache" / "pedpred" / "compiled"
    assert [len(kept(folder)) for folder in folders] == [3, 3]
    assert all(folder.stat().st_mode & 0o077 == 0 for folder in folders)


def test_processes_that_begin_together_share_a_place(before, tmp_path):
    with concurrent.futures.ThreadPoolExecutor(3) as pool:
        values = [value for value, _, _ in pool.map(lambda _: run(before[0], tmp_path), range(3))]
    assert values == [pytest.approx(VALUE)] * 3
    assert run(before[0], tmp_path)[1] == []


def test_threads_compile_once(before, tmp_path):
    ends = SCRIPT.replace(
        "value = outside",
        """import threading
threads = [threading.Thread(target=lambda: outside(np.arange(4.0), Pair(**named))) for _ in range(4)]
[thread.start() for thread in threads]
[thread.join() for thread in threads]
assert compiled.count("outside") == compiled.count("deeper") == 1
value = outside""",
    )
    run(before[0], tmp_path, ends)


def test_what_nobody_uses_is_removed(copied):
    folder, cache = copied
    old, other = cache / "pedpred" / "old.loop", cache / "pedpred" / "somebody's file"
    for path in (old, other):
        path.write_text("")
        os.utime(path, (0, 0))
    edit(folder / "inner.py", "2.0 * deeper", "3.0 * deeper")
    run(folder, cache)
    assert not old.exists()
    assert other.exists()


LIMITS = np.array([1.0])


def test_a_loop_may_read_nothing_that_cannot_be_told():
    settings = {"limit": 1.0}

    def reads_a_dict():
        return settings["limit"]

    def reads_a_module():
        return Path.cwd

    with pytest.raises(TypeError, match=r"reads_a_dict reads settings, a builtins\.dict: a compiled"):
        contents(reads_a_dict)
    with pytest.raises(TypeError, match="reads Path"):
        contents(reads_a_module)
    with pytest.raises(TypeError, match="settings"):
        compiled(reads_a_dict)()


def test_loops_that_call_each_other_have_contents():
    one = compiled(lambda n: other(n - 1) if n else 0)
    other = compiled(lambda n: one(n - 1) if n else 0)
    assert len(contents(one.py_func)) == 2
    assert contents(one.py_func) == contents(one.py_func)


def test_a_loop_that_changes_in_a_process_is_not_kept(monkeypatch):
    """The former one may be compiled into others by then."""

    def reads_limits():
        return LIMITS[0]

    assert contents(reads_limits) is not None
    monkeypatch.setitem(globals(), "LIMITS", np.array([2.0]))
    assert contents(reads_limits) is None


COUNT = """
import numpy as np

from pedpred.forecasting.comparisons import _SHARES, _count
from pedpred.metrics.calibration import COARSE

missed, here, spread, nothing = np.zeros(1, np.int64), np.zeros((1, 1, 2)), np.eye(2)[None, None], np.zeros(1)
truth, group, since = np.array([[2.0, 0.0]]), np.zeros(1, np.int64), np.zeros((2, 1))
_count(missed, here, spread, np.ones((1, 1)), truth, nothing, group, since, _SHARES, COARSE)
print(missed[0])
"""


def test_a_loop_of_another_module_counts_in_the_package(tmp_path):
    """`forecasting.comparisons` calls `metrics.calibration`. Loops as they are need not be compiled again."""
    if cache_folder().exists():
        shutil.copytree(cache_folder(), tmp_path / "cache" / "pedpred")
    assert run(tmp_path, tmp_path / "cache", COUNT)[0] == 1  # outside the region of 50 %, with 86 % inside
    shutil.copytree(ROOT / "pedpred", tmp_path / "pedpred")
    edit(
        tmp_path / "pedpred" / "metrics" / "calibration.py",
        "return 1.0 - here / left",
        "return 0.5 * (1.0 - here / left)",
    )
    assert run(tmp_path, tmp_path / "cache", COUNT, ())[0] == 0


def test_every_loop_has_contents():
    """What a loop must not read is found here, and not by the first who calls it."""
    elsewhere = "__main__", "ros2.node"  # a command, and what needs a ROS
    names = [one.name for one in pkgutil.walk_packages(pedpred.__path__, "pedpred.")]
    modules = [importlib.import_module(name) for name in names if not name.endswith(elsewhere)]
    loops = {value.py_func for one in modules for value in vars(one).values() if hasattr(value, "py_func")}
    assert all(contents(loop) for loop in loops)
    assert len(loops) > 50
