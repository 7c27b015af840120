"""The rules of the project that a machine can check: layers, dependencies, stages, configuration, pages."""

import re
import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path

import pytest

from stages.code import CODE, code_behind, imported
from tests.configuration import composed, read
from tests.conftest import ROOT
from tools import prose

SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text())
CONTRACTS = SETTINGS["tool"]["importlinter"]["contracts"]
WITHOUT_TORCH = next(c["source_modules"] for c in CONTRACTS if c["type"] == "forbidden")
PIPELINE, DEFAULTS = read("dvc.yaml")["stages"], read("conf/config.yaml")["defaults"]
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
    extras = SETTINGS["project"]["optional-dependencies"]
    wanted = [*SETTINGS["project"]["dependencies"], *extras["files"], *extras["hdf5"], *extras["pictures"]]
    files = [path for part in ("command", "online", "ros") for path in (ROOT / "pedpred" / part).glob("*.py")]
    behind = {file for path in files for file in code_behind(path)}
    outside = {module.partition(".")[0] for path in behind for module, _ in imported(path)} - {"pedpred"}
    needed = {CALLED.get(name, name) for name in outside - sys.stdlib_module_names}
    assert needed == {re.match(r"[\w-]+", requirement)[0] for requirement in wanted}


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


def test_scale_resizes_what_exists_and_adds_nothing():
    def keys(node, at=""):
        return {k for n, v in node.items() for k in keys(v, f"{at}.{n}")} if isinstance(node, dict) else {at}

    assert keys(composed("scale=smoke")) == keys(read("params.yaml"))


def test_python_on_pages_imports_what_exists():
    for page in prose.pages(ROOT):
        for block in re.findall(r"^ *```python\n((?:.*\n)*?) *```$", page.read_text(), re.MULTILINE):
            compile(block, str(page), "exec")
            for line in re.findall(r"^(?:from pedpred|import pedpred).*$", block, re.MULTILINE):
                exec(line, {})


def test_interface_pages_describe_what_is_there():
    """A member that a module lacks is left out of the site without an error."""
    named = r"^::: (\S+)\n    options:\n      members: \[(.*)\]$"
    pages = "\n".join(path.read_text() for path in ROOT.glob("docs/api/*.md"))
    members = [
        (module, name)
        for module, names in re.findall(named, pages, re.MULTILINE)
        for name in names.split(", ")
    ]
    assert [name for module, name in members if not hasattr(import_module(module), name)] == []


def test_nothing_refers_to_one_machine():
    places = re.compile(r"(?<![\w.}])/(?:home|root|work|users|mnt)/|\.\./shared", re.IGNORECASE)
    names = subprocess.run([ROOT / ".ci/files"], capture_output=True, text=True, check=True).stdout.split(
        "\0"
    )
    texts = {name: (ROOT / name).read_bytes() for name in names if (ROOT / name).is_file()}
    texts.pop(str(Path(__file__).relative_to(ROOT)))
    guilty = {name for name, raw in texts.items() if b"\0" not in raw and places.search(raw.decode())}
    assert guilty <= {*read("params.yaml")["mirrors"].values(), "params.yaml", "dvc.lock"}
