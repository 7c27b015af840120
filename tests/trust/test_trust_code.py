"""Nothing that is read is run: what the code may not call, and that the linter's security rules are on."""

import ast
import functools
import re
import tomllib

import pytest
from packaging.requirements import Requirement
from packaging.version import Version

from benchmarks import dependencies
from tests.conftest import ROOT

SOURCES = sorted([*(ROOT / "pedpred").rglob("*.py"), *(ROOT / "stages").glob("*.py")])
RUFF = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["ruff"]["lint"]
FORBIDDEN_MODULES = {"pickle", "cPickle", "dill", "cloudpickle", "marshal", "shelve", "jsonpickle"}
FORBIDDEN_CALLS = {
    *("eval", "exec", "compile", "__import__", "os.system", "os.popen", "yaml.load", "yaml.unsafe_load"),
    *("torch.load", "torch.save", "np.load", "joblib.load", "joblib.dump", "pd.read_pickle", "pd.read_hdf"),
}
SAVING = re.compile(r"\b(?:save|save_file|savefig|to_parquet|ParquetWriter)\(|open\('[wax]")
SAVES = re.compile(r"\b(?:save|save_file|savefig|to_parquet|ParquetWriter)\(|open\(\s*['\"][wax]")
"""In a function that is written in one way, and in a file as it is."""


@functools.cache
def load(path):
    return ast.parse(path.read_text())


def calls(tree):
    return {ast.unparse(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}


def imports(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module.partition(".")[0]


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_nothing_that_is_read_is_run(path):
    tree = load(path)
    assert calls(tree) & FORBIDDEN_CALLS == set()
    assert set(imports(tree)) & FORBIDDEN_MODULES == set()
    assert "shell=True" not in path.read_text()


@pytest.mark.parametrize("text", ["import pickle", "from pickle import load"])
def test_a_forbidden_import_is_seen(text):
    assert set(imports(ast.parse(text))) & FORBIDDEN_MODULES


def test_a_forbidden_call_is_seen():
    assert calls(ast.parse("x = torch.load(path); eval('1')")) & FORBIDDEN_CALLS == {"torch.load", "eval"}


def test_the_linter_looks_for_security_and_every_exception_says_why():
    assert "S" in RUFF["select"]
    text = (ROOT / "pyproject.toml").read_text()
    for files, rules in RUFF["per-file-ignores"].items():
        if any(rule.startswith("S") and rule[1:].isdigit() for rule in rules):
            assert re.search(rf'^"{re.escape(files)}" = \[.*\] # \S', text, re.MULTILINE), files


def test_every_dependency_has_a_reason_and_a_use():
    groups = dependencies.declared()
    names = {need.name for needs in groups.values() for need in needs}
    assert names == set(dependencies.REASONS)
    page = dependencies.PAGE.read_text()
    assert all(f"| {name} |" in page for name in names)
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
    assert not [line for line in lines if "://" in line or "@" in line]
    direct = {need.name.lower() for needs in dependencies.declared().values() for need in needs}
    assert direct <= versions.keys()


def test_files_are_written_through_one_door():
    """Whatever is written appears whole: by `pedpred.files`, or under a name that `atomic_write` gave."""
    writing = re.compile(r"(\w[\w.()/\" {}]*)\.(write_text|write_bytes)\(")
    for path in SOURCES:
        source = path.read_text()
        found = {match[0] for match in writing.findall(source)}
        assert found <= {"new"}, f"{path.relative_to(ROOT)} writes {found - {'new'}} at once"
        if not SAVES.search(source):
            continue
        functions = [ast.unparse(node) for node in ast.walk(load(path)) if isinstance(node, ast.FunctionDef)]
        saving = [text for text in functions if SAVING.search(text)]
        named = (
            "atomic_write(",
            "BytesIO(",
            "tarfile.open(",
            "TemporaryDirectory(",
        )  # the last two: for a while
        assert all(any(name in text for name in named) for text in saving), path
