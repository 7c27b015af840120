"""The rules of the project that a machine can check: layers, dependencies, stages, configuration, pages."""

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.version import Version

from benchmarks import dependencies
from stages.code import CODE, code_behind, imported
from tests.configuration import composed, read
from tests.conftest import ROOT
from tools import prose

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
CONTRACTS = PROJECT["tool"]["importlinter"]["contracts"]
WITHOUT_TORCH = next(c["source_modules"] for c in CONTRACTS if c["type"] == "forbidden")
PIPELINE, DEFAULTS = read("dvc.yaml")["stages"], read("conf/config.yaml")["defaults"]
SOURCES = sorted([*(ROOT / "pedpred").rglob("*.py"), *(ROOT / "stages").glob("*.py")])
CALLED = {"PIL": "pillow", "skfmm": "scikit-fmm", "yaml": "pyyaml"}
RUN_NO_NETWORK = {"evaluate_baseline", "pretrain_autoencoder", "rows", "simulated", "recorded", "embed"}
"""Stages whose code knows kinds of networks."""


def test_every_package_stands_on_a_layer():
    layers = next(c["layers"] for c in CONTRACTS if c["type"] == "layers")
    listed = {".".join(name.split(".")[:2]) for line in layers for name in line.split(" | ")}
    parts = {p for p in (ROOT / "pedpred").iterdir() if (p / "__init__.py").exists() or p.suffix == ".py"}
    names = {f"pedpred.{part.stem}" for part in parts} - {"pedpred.__init__", "pedpred.config"}
    assert names == listed - {"stages", "tools"}


def test_what_runs_on_the_robot_imports_without_torch():
    """Also what is imported by way of other libraries, which import contracts do not see."""
    files = [path for name in WITHOUT_TORCH for path in ROOT.joinpath(*name.split(".")).glob("[a-z]*.py")]
    found = [path.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".") for path in files]
    script = f"import sys, {', '.join([*WITHOUT_TORCH, *found])}; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", script], cwd=ROOT, check=False).returncode == 0


def test_commands_import_what_the_extra_files_installs():
    groups = dependencies.declared()
    extras = PROJECT["project"]["optional-dependencies"]
    wanted = [*groups["robot"], *(Requirement(r) for e in ("files", "hdf5", "pictures") for r in extras[e])]
    files = [path for part in ("command", "online", "ros") for path in (ROOT / "pedpred" / part).glob("*.py")]
    behind = {file for path in files for file in code_behind(path)}
    outside = {module.partition(".")[0] for path in behind for module, _ in imported(path)} - {"pedpred"}
    needed = {CALLED.get(name, name) for name in outside - sys.stdlib_module_names}
    assert needed == {requirement.name for requirement in wanted}
    assert {need.name for needs in groups.values() for need in needs} == set(dependencies.REASONS)


def test_every_version_is_exact_and_released():
    lines = [line for line in (ROOT / "constraints.txt").read_text().splitlines() if not line.startswith("#")]
    versions = {need.name.lower(): [*need.specifier] for need in map(Requirement, lines)}
    for name, pinned in versions.items():
        assert [one.operator for one in pinned] == ["=="], name
        assert not Version(pinned[0].version).is_prerelease, name
    direct = {need.name.lower() for needs in dependencies.declared().values() for need in needs}
    assert direct <= versions.keys()


AT_ONCE = re.compile(r"(\w[\w.()/\" {}]*)\.(?:write_text|write_bytes)\(")
SAVING = re.compile(r"\b(?:save|save_file|savefig|to_parquet|ParquetWriter)\(|open\('[wax]")
WHOLE = ("atomic_write(", "BytesIO(", "tarfile.open(", "TemporaryDirectory(")
"""What functions that save use: a file that gets its name when it is complete, or one for a while."""


def test_files_are_written_through_one_door():
    """Whatever is written appears whole: by `pedpred.files`, or under a name that `atomic_write` gave."""
    for path in SOURCES:
        source = path.read_text()
        assert set(AT_ONCE.findall(source)) <= {"new"}, path
        if re.search(r"save|to_parquet|ParquetWriter|open\(", source):
            functions = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.FunctionDef)]
            for text in map(ast.unparse, functions):
                assert not SAVING.search(text) or any(name in text for name in WHOLE), path


@pytest.mark.parametrize("name", sorted(set(PIPELINE) - {"config"}))
def test_stage_depends_on_the_code_that_it_runs(name):
    entry = PIPELINE[name].get("do", PIPELINE[name])
    script = re.search(r"python -m stages\.(\w+)", entry["cmd"])[1]
    code = {path for path in entry["deps"] if path.startswith((str(CODE), "pedpred", "stages"))}
    runs_networks = ROOT / "pedpred/models/registry.py" in code_behind(ROOT / f"stages/{script}.py")
    networks = {path for path in code if path.startswith(f"{CODE}/models")}
    assert code - networks == {f"{CODE}/{script}"}
    assert bool(networks) == (runs_networks and name not in RUN_NO_NETWORK)


def options():
    """Every choice under conf/ that is not made by default (those compose into params.yaml)."""
    chosen = [pair for entry in DEFAULTS if isinstance(entry, dict) for pair in entry.items()]
    usual = {(key.partition("@")[0], choice) for key, choice in chosen}
    for folder in {group for group, _ in usual}:
        keyed = f"{folder}@{folder}." in str(DEFAULTS)
        prefix = f"+{folder}@{folder}.another=" if keyed else f"{folder}="
        for path in (ROOT / "conf" / folder).glob("*.yaml"):
            if (folder, path.stem) not in usual:
                yield prefix + path.stem


@pytest.mark.parametrize("option", sorted(set(options())))
def test_option_under_conf_composes(option):
    assert composed(option)


# Pages


def test_python_on_pages_imports_what_exists():
    for page in prose.pages(ROOT):
        for block in re.findall(r"^ *```python\n((?:.*\n)*?) *```$", page.read_text(), re.MULTILINE):
            compile(block, str(page), "exec")
            for line in re.findall(r"^(?:from pedpred|import pedpred).*$", block, re.MULTILINE):
                exec(line, {})


def test_every_promise_names_tests_that_exist():
    page = (ROOT / "docs/guarantees.md").read_text()
    promises = re.findall(r"^\* \*\*.*?(?=^\* |^## |\Z)", page, re.MULTILINE | re.DOTALL)
    assert [promise for promise in promises if not re.search(r"`tests/[\w/]+\.py::test_\w+`", promise)] == []
    for file, test in set(re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", page)):
        assert f"def {test}(" in (ROOT / file).read_text(), file


def test_nothing_refers_to_one_machine():
    places = re.compile(r"(?<![\w.}])/(?:home|root|work|users|mnt)/|\.\./shared", re.IGNORECASE)
    listed = subprocess.run([ROOT / ".ci/files"], capture_output=True, text=True, check=True).stdout
    texts = {name: (ROOT / name).read_bytes() for name in listed.split("\0") if (ROOT / name).is_file()}
    texts.pop(str(Path(__file__).relative_to(ROOT)))
    guilty = {name for name, raw in texts.items() if b"\0" not in raw and places.search(raw.decode())}
    assert guilty <= {*read("params.yaml")["mirrors"].values(), "params.yaml", "dvc.lock"}
