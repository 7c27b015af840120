"""The package as people install it: light to import, complete in an empty environment."""

import ast
import importlib
import shutil
import subprocess
import sys
import venv
from pathlib import Path

import pytest

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
LISTED = """
import inspect, sys; sys.modules[{absent!r}] = None; import pedpred
listed = {{*dir(pedpred)}}; print(*sorted({{*pedpred.__all__}} - listed)); inspect.getmembers(pedpred)
"""
WALK = ROOT / "examples/crossing/tracks.csv"


def run(*command, cwd, succeeds=True):
    done = subprocess.run([*map(str, command)], cwd=cwd, capture_output=True, text=True, check=False)
    assert (done.returncode == 0) is succeeds, done.stdout + done.stderr
    return done.stdout + done.stderr


def provide(environment, group):
    """Link the packages that an installation needs; `make pythons` unpacks them, which takes longer."""
    (site,) = environment.glob("lib/python*/site-packages")
    for package in closure(declared()[group]).values():
        tops = {file.parts[0] for file in package.files}
        for top in tops:
            if not top.startswith((".", "__pycache__")) and not (site / top).exists():
                (site / top).symlink_to(package.locate_file(top))


@pytest.mark.slow
def test_a_wheel_forecasts_in_an_empty_environment(tmp_path):
    source, empty = tmp_path / "source", tmp_path / "empty"
    run(ROOT / ".ci/copy", source, cwd=ROOT)
    run(sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", tmp_path, source, cwd=tmp_path)
    venv.create(empty)  # this pip serves it too
    (wheel,) = tmp_path.glob("*.whl")
    provide(empty, "robot")
    install = (sys.executable, "-m", "pip", "--python", empty / "bin/python", "install", "--no-index")
    run(*install, wheel, cwd=tmp_path)  # fails where a package that it needs is missing
    run(empty / "bin/python", "-I", "-c", TEN_LINES, ROOT, cwd=tmp_path)
    run(empty / "bin/pedpred", "warm-up", cwd=tmp_path)
    said = run(empty / "bin/pedpred", "predict", WALK, cwd=tmp_path, succeeds=False)
    assert "pip install 'pedpred[files]'" in said
    provide(empty, "files")
    run(*install, f"{wheel}[files]", cwd=tmp_path)
    run(empty / "bin/python", "-I", "-c", WITH_FILES, "predict", WALK, cwd=tmp_path)
    assert (tmp_path / "tracks_forecasts.mcap").read_bytes().startswith(b"\x89MCAP")


@pytest.mark.slow
def test_a_wheel_is_not_built_without_the_default_model(tmp_path):
    source = tmp_path / "source"
    run(ROOT / ".ci/copy", source, cwd=ROOT)
    shutil.rmtree(source / "models/online/default")
    command = sys.executable, "-m", "pip", "wheel", "--no-deps", "-w", tmp_path, source
    assert "make reproduce release" in run(*command, cwd=tmp_path, succeeds=False)


def test_default_model_is_that_of_the_package_or_refused(tmp_path, monkeypatch, mixture):
    monkeypatch.chdir(tmp_path)
    for place in ("_INSTALLED", "_CHECKOUT"):
        monkeypatch.setattr(shipped, place, tmp_path / "none")
    with pytest.raises(InputError):
        OnlinePredictor.load()
    monkeypatch.setattr(shipped, "_INSTALLED", mixture[0])
    assert OnlinePredictor.load().description == OnlinePredictor.load(mixture[0]).description
    main(["predict", str(WALK)])
    assert (tmp_path / "tracks_forecasts.mcap").exists()


@pytest.mark.parametrize("package", ["pedpred", "pedpred.ros"])
def test_names_on_first_use_are_those_of_type_checkers(package):
    module = importlib.import_module(package)
    tree = ast.parse(Path(module.__file__).read_text())
    checked = next(n for n in tree.body if isinstance(n, ast.If) and ast.unparse(n.test) == "TYPE_CHECKING")
    imports = [node for node in checked.body if isinstance(node, ast.ImportFrom)]
    homes = {alias.name: node.module for node in imports for alias in node.names}
    assert sorted(homes) == module.__all__
    for name, home in homes.items():
        assert getattr(module, name) is getattr(importlib.import_module(home), name)
    with pytest.raises(AttributeError):
        _ = module.Predictor


@pytest.mark.parametrize("absent", ["nothing", "pandas"])
def test_public_names_are_listed_before_they_are_used(absent):
    """As completion and help need them; what an installation without tables lacks would end both."""
    missing = run(sys.executable, "-c", LISTED.format(absent=absent), cwd=ROOT).split()
    assert missing == (["predict"] if absent == "pandas" else [])
