"""The house rules that a machine can check: layers, dependencies, sizes, documentation, configuration."""

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from pedpred import config
from stages.code import CODE, code_behind, imported
from tests.configuration import composed, read
from tests.conftest import LONGEST, ROOT

PIPELINE = read("dvc.yaml")["stages"]
CONTRACTS = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
LAYERS = next([line.split(" | ") for line in c["layers"]] for c in CONTRACTS if c["type"] == "layers")
WITHOUT_TORCH = next(c["source_modules"] for c in CONTRACTS if c["type"] == "forbidden")
ARCHITECTURE = (ROOT / "ARCHITECTURE.md").read_text()
PARAMS = read("params.yaml")
DEFAULTS = read("conf/config.yaml")["defaults"]
SCRIPTS = sorted(path for path in (ROOT / "stages").glob("*.py") if path.name != "__init__.py")


def named(path):
    return str(path.relative_to(ROOT))


def shipped_files():
    names = subprocess.run([ROOT / ".ci/files"], capture_output=True, text=True, check=True).stdout
    return [ROOT / name for name in names.split("\0") if name and (ROOT / name).is_file()]


# Layers


def test_every_package_stands_on_a_layer():
    listed = {".".join(name.split(".")[:2]) for layer in LAYERS for name in layer} | {"pedpred.config"}
    rooms = {p for p in (ROOT / "pedpred").iterdir() if (p / "__init__.py").exists() or p.suffix == ".py"}
    assert {f"pedpred.{room.stem}" for room in rooms} - {"pedpred.__init__"} == listed - {"stages", "tools"}


def test_what_may_run_on_the_robot_imports_without_torch():
    files = [path for name in WITHOUT_TORCH for path in ROOT.joinpath(*name.split(".")).glob("[a-z]*.py")]
    modules = [*WITHOUT_TORCH, *(named(path.with_suffix("")).replace("/", ".") for path in files)]
    script = f"import sys, {', '.join(modules)}; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", script], cwd=ROOT, check=False).returncode == 0


PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
CALLED = {"PIL": "pillow", "skfmm": "scikit-fmm", "yaml": "pyyaml"}


def bare(requirements):
    """Names of packages without versions."""
    return {re.match(r"[\w-]+", requirement)[0] for requirement in requirements}


def test_what_the_commands_and_a_robot_import_is_what_the_extra_files_installs():
    """Every package that the command, the online predictor or a reader of bags imports is a dependency.

    But for those of archives in HDF5, which few people have, and of pictures of drives, which are extras.
    `test_package.py` shows that a robot needs no extra.
    """
    extras = PROJECT["optional-dependencies"]
    wanted = [*PROJECT["dependencies"], *extras["files"], *extras["hdf5"], *extras["pictures"]]
    files = [path for room in ("command", "online", "ros") for path in (ROOT / "pedpred" / room).glob("*.py")]
    embedding = {file for path in files for file in code_behind(path)}
    outside = {module.partition(".")[0] for path in embedding for module, _ in imported(path)} - {"pedpred"}
    needed = {CALLED.get(name, name) for name in outside - sys.stdlib_module_names}
    assert needed == bare(wanted)


# Stages depend on the code that their script imports


RUN_NO_NETWORK = {"evaluate_baseline", "pretrain_autoencoder", "rows", "simulated", "recorded", "embed"}
"""Stages whose code knows kinds of networks."""


@pytest.mark.parametrize("name", sorted(set(PIPELINE) - {"config"}))
def test_a_stage_depends_on_the_code_that_it_runs(name):
    entry = PIPELINE[name].get("do", PIPELINE[name])
    script = re.search(r"python -m stages\.(\w+)", entry["cmd"])[1]
    code = {path for path in entry["deps"] if path.startswith((str(CODE), "pedpred", "stages"))}
    runs_networks = ROOT / "pedpred/models/registry.py" in code_behind(ROOT / f"stages/{script}.py")
    networks = {path for path in code if path.startswith(f"{CODE}/models")}
    assert code - networks == {f"{CODE}/{script}"}
    assert bool(networks) == (runs_networks and name not in RUN_NO_NETWORK)


@pytest.mark.parametrize("script", SCRIPTS, ids=named)
def test_a_stage_reads_keys_in_a_way_that_fails_when_they_are_undeclared(script):
    asked = re.findall(r"cfg\.get\(\"?(\w+)", script.read_text())
    assert not set(asked) & set(PARAMS)


# The architecture page


def test_the_page_lists_the_layers_as_they_are_checked():
    rows = (
        re.sub(r"\n +\|", " |", ARCHITECTURE.partition("```text")[2].partition("```")[0]).strip().splitlines()
    )
    assert [re.findall(r"pedpred(?:\.\w+)+|^(?:tools|stages)", row) for row in rows] == LAYERS


def test_the_page_names_what_works_without_torch():
    (listed,) = re.findall(
        r"(`sources`[^|]*) and all packages below `storage` work without torch", ARCHITECTURE
    )
    below = {name for layer in LAYERS[LAYERS.index(["pedpred.storage"]) + 1 :] for name in layer}
    light = {f"pedpred.{name}" for name in re.findall(r"`([\w.]+)`", listed)}
    assert light | below == set(WITHOUT_TORCH) - {"pedpred.config"}


def test_the_page_names_types_and_fields_that_exist():
    trees = (ast.parse(path.read_text()) for path in (ROOT / "pedpred").rglob("*.py"))
    classes = {node.name: node for tree in trees for node in tree.body if isinstance(node, ast.ClassDef)}
    table = ARCHITECTURE.partition("## Data types")[2].partition("## ")[0]
    for types, contents in re.findall(r"^\| (.+) \| (.+) \|$", table, re.MULTILINE):
        assert set(re.findall(r"`([A-Z]\w+)", types + contents)) <= classes.keys()
        own = [node for name in re.findall(r"`([A-Z]\w+)`", types) for node in classes[name].body]
        fields = {node.target.id for node in own if isinstance(node, ast.AnnAssign)}
        assert not own or set(re.findall(r"`(\w+) \[", contents)) <= fields, types


# Configuration


def test_params_yaml_is_what_conf_composes_to():
    assert (ROOT / "params.yaml").read_text() == config.composed(ROOT / "conf", [])


def options():
    """Every choice under conf/ that is not made by default (those compose into params.yaml)."""
    chosen = [pair for entry in DEFAULTS if isinstance(entry, dict) for pair in entry.items()]
    usual = {(key.partition("@")[0], choice) for key, choice in chosen}
    for folder in sorted({group for group, _ in usual}):
        keyed = f"{folder}@{folder}." in str(DEFAULTS)
        prefix = f"+{folder}@{folder}.another=" if keyed else f"{folder}="
        for path in sorted((ROOT / "conf" / folder).glob("*.yaml")):
            if (folder, path.stem) not in usual:
                yield prefix + path.stem


@pytest.mark.parametrize("option", sorted(set(options())))
def test_every_option_under_conf_composes(option):
    assert composed(option)


def test_a_scale_resizes_what_exists_and_adds_nothing():
    def keys(node, at=""):
        return {k for n, v in node.items() for k in keys(v, f"{at}.{n}")} if isinstance(node, dict) else {at}

    assert keys(composed("scale=smoke")) == keys(PARAMS)


# Documentation

PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_a_page_names_existing_make_targets_and_files(page):
    text = page.read_text()
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    assert set(re.findall(r"(?:`|^\s*)make ([a-z]+)", text, re.MULTILINE)) <= targets
    linked = [link for link in re.findall(r"\]\(([^)#]+)\)", text) if "://" not in link]
    assert [link for link in linked if not (page.parent / link).exists()] == []


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_an_experiment_on_a_page_sets_a_parameter_that_exists(page):
    for key in re.findall(r"(?:-S|--set-param) (\w[\w.]*)=", page.read_text()):
        node = PARAMS
        for part in key.split("."):
            assert part in node, key
            node = node[part]


def test_the_modules_that_begin_first_exist():
    assert [name for name in LONGEST if not (ROOT / f"tests/test_{name}.py").exists()] == []
    assert len(set(LONGEST)) == len(LONGEST)


def test_nothing_refers_to_one_machine():
    places = re.compile(r"(?<![\w.}])/(?:home|root|work|users|mnt)/|\.\./shared", re.IGNORECASE)
    texts = {path: path.read_bytes() for path in shipped_files() if path != Path(__file__)}
    found = {named(p): places.search(raw.decode()) for p, raw in texts.items() if b"\0" not in raw}
    guilty = {name: match[0] for name, match in found.items() if match}
    mirrors = {*PARAMS["mirrors"].values()}
    assert set(guilty) <= {*mirrors, "params.yaml", "dvc.lock"}, guilty
