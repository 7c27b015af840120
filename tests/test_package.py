"""The package as people install it: light to import, complete in an empty environment."""

import ast
import importlib
import subprocess
import sys
import tomllib
import venv
from pathlib import Path

import pytest
import yaml

import pedpred
from benchmarks.dependencies import closure, declared
from pedpred.command import main
from pedpred.errors import InputError
from pedpred.online import OnlinePredictor, shipped
from tests.conftest import ROOT

TEN_LINES = """
import sys, pedpred
assert "numpy" not in sys.modules and not pedpred.__file__.startswith(sys.argv[1])
from pedpred import OnlinePredictor
predictor = OnlinePredictor.load()
for k in range(10):
    forecast = predictor.update(k / 10, [4, 7], [[0.13 * k, 0.0], [4.0 - 0.12 * k, 0.2]])
assert forecast.position.shape == (2, 10, 2)
"""
WITH_FILES = """
from pedpred.driving.intentions import FORCES, published_forces
from pedpred.driving.places import TRAINED_ON, ranges
assert TRAINED_ON[0].exists() and ranges() and FORCES[0].exists() and published_forces()
from pedpred.command import main
main()
"""


def run(*command, cwd):
    done = subprocess.run([*map(str, command)], cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def provide(environment, groups):
    """Link the packages that an installation needs; `make pythons` unpacks them, which takes longer."""
    (site,) = environment.glob("lib/python*/site-packages")
    needs = declared()
    for package in closure(need for group in groups for need in needs[group]).values():
        for top in {
            file.parts[0] for file in package.files if not file.parts[0].startswith((".", "__pycache__"))
        }:
            if not (site / top).exists():
                (site / top).symlink_to(package.locate_file(top))


@pytest.mark.slow
def test_a_wheel_forecasts_in_an_empty_environment(tmp_path):
    source, empty = tmp_path / "source", tmp_path / "empty"
    run(ROOT / ".ci" / "copy", source, cwd=ROOT)
    run(sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", tmp_path, source, cwd=tmp_path)
    venv.create(empty)  # this pip serves it too
    (wheel,) = tmp_path.glob("*.whl")
    provide(empty, ["robot"])
    install = (sys.executable, "-m", "pip", "--python", empty / "bin" / "python", "install", "--no-index")
    run(*install, wheel, cwd=tmp_path)  # fails where a package that it needs is missing
    run(empty / "bin" / "python", "-I", "-c", TEN_LINES, ROOT, cwd=tmp_path)
    run(empty / "bin" / "pedpred", "warm-up", cwd=tmp_path)
    command = [empty / "bin" / "pedpred", "predict", ROOT / "examples" / "crossing" / "tracks.csv"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "pip install 'pedpred[files]'" in done.stderr
    provide(empty, ["files"])
    run(*install, f"{wheel}[files]", cwd=tmp_path)
    run(empty / "bin" / "python", "-I", "-c", WITH_FILES, *command[1:], cwd=tmp_path)
    assert (tmp_path / "tracks_forecasts.mcap").read_bytes().startswith(b"\x89MCAP")


@pytest.mark.slow
def test_a_wheel_is_not_built_without_the_default_model(tmp_path):
    source = tmp_path / "source"
    run(ROOT / ".ci" / "copy", source, cwd=ROOT)
    for file in source.glob("models/online/default/*"):
        file.unlink()
    command = [sys.executable, "-m", "pip", "wheel", "--no-deps", "-w", tmp_path, source]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "make one: make reproduce release" in done.stdout + done.stderr


def test_without_a_default_model_the_error_says_how_to_get_one(tmp_path, monkeypatch):
    monkeypatch.setattr(shipped, "_INSTALLED", tmp_path / "installed")
    monkeypatch.setattr(shipped, "_CHECKOUT", tmp_path / "checkout")
    with pytest.raises(InputError, match=r"the default model is missing.*get the default one with git"):
        OnlinePredictor.load()


def test_a_path_is_needed_neither_in_python_nor_on_the_command_line(tmp_path, monkeypatch, mixture):
    monkeypatch.setattr(shipped, "_INSTALLED", mixture[0])
    monkeypatch.chdir(tmp_path)
    assert OnlinePredictor.load().description == OnlinePredictor.load(mixture[0]).description
    main(["predict", str(ROOT / "examples" / "crossing" / "tracks.csv")])
    assert (tmp_path / "tracks_forecasts.mcap").exists()
    with pytest.raises(SystemExit, match="--force"):
        main(["predict", str(ROOT / "examples" / "crossing" / "tracks.csv")])


def test_public_names_are_found_and_others_are_not():
    assert pedpred.OnlinePredictor is OnlinePredictor
    assert all(getattr(pedpred, name).__name__ == name for name in pedpred.__all__)
    with pytest.raises(AttributeError, match="no attribute 'Predictor'"):
        _ = pedpred.Predictor


@pytest.mark.parametrize("package", ["pedpred", "pedpred.ros"])
def test_names_on_use_are_those_of_type_checkers(package):
    module = importlib.import_module(package)
    tree = ast.parse(Path(module.__file__).read_text())
    checked = next(n for n in tree.body if isinstance(n, ast.If) and ast.unparse(n.test) == "TYPE_CHECKING")
    imports = [node for node in checked.body if isinstance(node, ast.ImportFrom)]
    homes = {alias.name: node.module for node in imports for alias in node.names}
    assert sorted(homes) == module.__all__
    for name, home in homes.items():
        assert getattr(module, name) is getattr(importlib.import_module(home), name)


@pytest.mark.parametrize("absent", ["", "pandas"])
def test_public_names_are_listed_before_they_are_used(absent):
    """As completion and help need them; what an installation without tables lacks would end both."""
    code = (
        f"import inspect, sys; sys.modules['{absent or 'nothing'}'] = None; import pedpred; "
        "listed = {*dir(pedpred)}; print(*sorted({*pedpred.__all__} - listed)); inspect.getmembers(pedpred)"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert told.split() == (["predict"] if absent else [])


def test_types_and_citation_are_part_of_the_package():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert (ROOT / "pedpred" / "py.typed").exists()
    assert citation["version"] == project["version"]
    assert citation["license"] == project["license"]
