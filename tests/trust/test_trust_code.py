"""Nothing that is read is run, files are written whole, and dependencies are pinned and have a reason."""

import ast
import functools
import re

from packaging.requirements import Requirement
from packaging.version import Version

from benchmarks import dependencies
from tests.conftest import ROOT

SOURCES = sorted([*(ROOT / "pedpred").rglob("*.py"), *(ROOT / "stages").glob("*.py")])
FORBIDDEN_MODULES = {"pickle", "cPickle", "dill", "cloudpickle", "marshal", "shelve", "jsonpickle"}
FORBIDDEN_CALLS = {
    *("eval", "exec", "compile", "__import__", "os.system", "os.popen", "yaml.load", "yaml.unsafe_load"),
    *("torch.load", "torch.save", "np.load", "joblib.load", "joblib.dump", "pd.read_pickle", "pd.read_hdf"),
}
AT_ONCE = re.compile(r"(\w[\w.()/\" {}]*)\.(?:write_text|write_bytes)\(")
SAVING = re.compile(r"\b(?:save|save_file|savefig|to_parquet|ParquetWriter)\(|open\('[wax]")
MAY_SAVE = re.compile(r"save|to_parquet|ParquetWriter|open\(")  # however it is written
WHOLE = ("atomic_write(", "BytesIO(", "tarfile.open(", "TemporaryDirectory(")
"""What functions that save use: a file that gets its name when it is complete, or one for a while."""


@functools.cache
def load(path):
    return ast.parse(path.read_text())


def imports(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module.partition(".")[0]


def test_nothing_that_is_read_is_run():
    for path in SOURCES:
        calls = {ast.unparse(node.func) for node in ast.walk(load(path)) if isinstance(node, ast.Call)}
        assert calls & FORBIDDEN_CALLS == set(), path
        assert set(imports(load(path))) & FORBIDDEN_MODULES == set(), path
        assert "shell=True" not in path.read_text(), path


def test_every_dependency_has_a_reason_and_a_use():
    groups = dependencies.declared()
    assert {need.name for needs in groups.values() for need in needs} == set(dependencies.REASONS)
    used = {module for path in SOURCES for module in imports(load(path))}
    modules = {"hydra-core": "hydra", "pillow": "PIL", "pyyaml": "yaml", "scikit-fmm": "skfmm"}
    needed = {need.name for group in ("robot", "files", "train") for need in groups[group]}
    needed -= {"dvc", "ruamel.yaml.clib"}  # a command, and what it parses with
    assert {name for name in needed if modules.get(name, name) not in used} == set()


def test_every_version_is_exact_and_released():
    lines = [line for line in (ROOT / "constraints.txt").read_text().splitlines() if not line.startswith("#")]
    versions = {need.name.lower(): [*need.specifier] for need in map(Requirement, lines)}
    assert len(versions) == len(lines)
    for name, pinned in versions.items():
        assert [one.operator for one in pinned] == ["=="], name
        assert not Version(pinned[0].version).is_prerelease, name
    direct = {need.name.lower() for needs in dependencies.declared().values() for need in needs}
    assert direct <= versions.keys()


def test_files_are_written_through_one_door():
    """Whatever is written appears whole: by `pedpred.files`, or under a name that `atomic_write` gave."""
    for path in SOURCES:
        assert set(AT_ONCE.findall(path.read_text())) <= {"new"}, path
        functions = [node for node in ast.walk(load(path)) if isinstance(node, ast.FunctionDef)]
        for text in map(ast.unparse, functions) if MAY_SAVE.search(path.read_text()) else ():
            assert not SAVING.search(text) or any(name in text for name in WHOLE), path
