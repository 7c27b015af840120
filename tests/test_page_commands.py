"""Commands on the pages: cheap ones are run as written; of the others everything but the run is checked."""

import functools
import importlib.util
import json
import re
import runpy
import shlex
import shutil
import sys
from contextlib import redirect_stdout
from io import StringIO
from itertools import dropwhile, groupby
from pathlib import Path
from unittest.mock import patch

import pytest
import yaml
from dvc.cli import parse_args

from pedpred import config
from pedpred.command import main
from pedpred.command.arguments import parser
from pedpred.command.recordings import open_scene
from pedpred.online import shipped
from pedpred.report.ablation import read_ablation
from pedpred.storage.scenes import write_scene
from stages.config import check_parts
from tests.configuration import composed, read, stages
from tests.conftest import ROOT
from tests.trust.project import done
from tools import prose

_SHOWN = [*prose.pages(ROOT), *sorted((ROOT / "ros").rglob("*.md"))]
PAGES = {str(path.relative_to(ROOT)): path.read_text() for path in _SHOWN}
COMMANDS_IN = {"sh": "", "bash": "", "console": "$ "}
"""Language of a block with commands -> what they begin with; other lines are what they print."""
OTHERS = {"bibtex", "mermaid", "python", "text", "yaml"}
"""Languages of the blocks without commands."""
PLACE = "eth"
"""Stands for <name> where a command asks for a place; it has the people of examples/corner."""

NOT_RUN = {
    "make setup": "installs packages; every continuous integration begins with it",
    "make smoke": "runs the pipeline for minutes; continuous integration does",
    "make reproduce": "runs the pipeline for an hour or more",
    "make studies": "likewise",
    "make judge": "measures speed and laws for minutes; test_judge.py runs its parts",
    "make release": "likewise",
    "python -m tools.judge": "likewise",
    "make check": "continuous integration runs it beside these tests",
    "make test": "is what runs these tests",
    "make docs": "test_site.py builds the site, with strict links",
    "make dist": "test_package.py builds the wheel and forecasts with it",
    "pip install": "needs package registries; test_package.py installs the wheel without",
    ".venv/bin/pip install": "needs package registries",
    "python3 -m venv": "likewise",
    "dvc push": "needs the storage of whoever runs it; test_pipeline.py pushes to a folder",
    "dvc repro": "runs the pipeline; test_pipeline.py and the smoke run do at toy size",
    "dvc exp run": "likewise; here its overrides are composed, and its targets looked up",
    "dvc queue start": "likewise; test_pipeline.py runs a queue of two",
    "dvc exp apply": "needs a finished experiment",
    "python -m tools.ablate": "trains for hours; test_ablation.py composes each point",
    "python -m stages.simulate +name=sim_test": "needs the layout on its page; test_layouts.py simulates it",
    "pedpred info build/rooms": "likewise",
    "python -m stages.ingest": "needs the rows on its page; test_own_place.py runs it there",
    "python -m stages.evaluate": "likewise",
    "python -m stages.gather": "likewise",
    "python -m stages.train": "needs the rows of a run; test_instant_training.py trains on some",
    "python -m stages.export": "needs a trained network; tests/exported.py exports some",
    "pedpred evaluate data/scenes": "needs the scenes of a run; test_evaluate.py evaluates others",
    "torchrun": "needs the features of a run; test_processes.py trains with two processes",
    "pedpred drive": "drives for minutes; test_driving_command.py drives a few episodes",
    "pedpred warm-up": "compiles for half a minute; test_warm_up.py runs it",
    "pedpred info my_bag": "needs a bag; test_bags.py makes some and reads them",
    "pedpred predict my_bag": "likewise",
    "pedpred evaluate my_bag": "likewise",
    "pedpred evaluate crowds_zara01.txt": "needs a recording; test_eth_ucy.py evaluates by this protocol",
    "pedpred-ros2": "needs ROS; `make ros` runs the node",
    "ros2": "likewise",
    "colcon": "likewise",
    "source": "likewise",
    "sudo apt": "installs packages",
    "git clone": "needs the network",
    "cd": "names a folder of the reader's",
    "python -m benchmarks": "measures for minutes, and for nothing beside other tests",
}
"""Commands that are only checked: the beginning of a command -> why."""

SAVED = {"folds=crossing"}
"""Overrides that choose a file of conf/ which the reader of the page has saved."""

IN_A_COPY = (
    *("make params", "make compare", "dvc metrics diff", "dvc params diff", "dvc exp show", "dvc remote"),
    *("dvc exp run --queue", "dvc repro --dry"),
)
"""Commands that are run in a copy of the project with two commits."""

FEW_ROWS = {
    "places/recorded": ({"eth", "hotel"},),
    "methods/networks": ({"lstm", "mixture"},),
    "situations/varied": ("simulated", {"main"}),
    "literature/eth_ucy": ("folds", "eth_ucy", {"eth"}),
    "online/robot": ("exports", {"large"}),
    "driving/closed_loop": ("places", {"corridor"}),
    "recording/viewer": ("scenes", {"office"}),
}
"""File of conf/ -> the key of its rows and which the copy keeps: DVC loads all stages at each command."""

FEWER = {"tools.fit_social_force": ["--trials", "2"], "tools.motion": ["--worlds", "1"]}
"""Options of modules that make replicates, trials and worlds few."""


def blocks(text, language):
    return [block for other, block in all_blocks(text) if other == language]


def all_blocks(text):
    """Language and text of every block of code."""
    return re.findall(r"^ *```(.*)\n((?:.*\n)*?) *```$", text, re.MULTILINE)


def lines():
    """Page and text of every command line."""
    for page, text in PAGES.items():
        for language, block in all_blocks(text):
            begin = COMMANDS_IN.get(language)
            for line in block.splitlines() if begin is not None else ():
                if line.startswith(begin):
                    yield page, line.removeprefix(begin)


def commands():
    """Every command in a block, once; comments and leading variables are left out."""
    known = set()
    for page, line in lines():
        split = shlex.shlex(line, posix=True, punctuation_chars="&")
        split.whitespace_split = True
        for is_between, words in groupby(split, "&&".__eq__):
            words = list(dropwhile(re.compile(r"[A-Z_]+=").match, words))
            if words and not is_between and tuple(words) not in known:
                known.add(tuple(words))
                yield pytest.param(words, id=f"{page}: {shlex.join(words)}")


COMMANDS = list(commands())


def begins(words, starts):
    return next((start for start in starts if words[: len(start.split())] == start.split()), None)


def not_run(words):
    """The entry of `NOT_RUN` that a command belongs to, or None."""
    if begins(words, IN_A_COPY) or words[-1] == "benchmarks.dependencies":
        return None
    return next((start for start in NOT_RUN if " ".join(words).startswith(start)), None)


RUN = [param for param in COMMANDS if not not_run(param.values[0])]
CHECKED = [param for param in COMMANDS if not_run(param.values[0])]


@pytest.mark.parametrize("page", PAGES)
def test_every_block_names_its_language(page):
    """So that commands are known for what they are."""
    assert {language for language, _ in all_blocks(PAGES[page])} <= {*COMMANDS_IN, *OTHERS}


def test_most_commands_are_run_and_no_reason_is_left_over():
    assert len(RUN) >= 25
    used = {not_run(param.values[0]) for param in CHECKED}
    assert set(NOT_RUN) - used <= {"make setup"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder in which commands run one after the other as in the project: examples, conf, a place."""
    place = tmp_path_factory.mktemp("pages")
    (place / "examples").symlink_to(ROOT / "examples")
    shutil.copytree(ROOT / "conf", place / "conf")
    shutil.copy(ROOT / "params.yaml", place)
    write_scene(open_scene(ROOT / "examples/corner/walk.txt"), place / "data/scenes/real" / PLACE)
    return place


def leave_few_rows(conf):
    """Drop most rows of a copy of conf/, and all folds but two."""
    for name, (*keys, kept) in FEW_ROWS.items():
        values = read(conf / f"{name}.yaml")
        rows = functools.reduce(dict.__getitem__, keys, values)
        for dropped in rows.keys() - kept:
            del rows[dropped]
        (conf / f"{name}.yaml").write_text(yaml.safe_dump(values, sort_keys=False))
    file = conf / "config.yaml"
    file.write_text(file.read_text().replace("- folds: leave_one_out", "- folds: eth_hotel"))


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A copy of the project with few stages and two commits, whose requirements are installed; no results."""
    copy = tmp_path_factory.mktemp("copy") / "project"
    done(ROOT, ".ci/copy", str(copy)).check_returncode()
    (copy / "dvc.lock").unlink(missing_ok=True)
    leave_few_rows(copy / "conf")
    (copy / "params.yaml").write_text(config.composed(copy / "conf", []))
    for message in ("one", "two"):
        done(copy, "git", "add", "--all").check_returncode()
        done(copy, "git", "commit", "--quiet", "--allow-empty", "-m", message).check_returncode()
    inside = copy / ".venv/bin/python"
    inside.parent.mkdir(parents=True)
    inside.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} "$@"\n')
    inside.chmod(0o755)
    (copy / ".venv/.installed").touch()
    return copy


@pytest.fixture
def commanded(folder, model, monkeypatch):
    """Runs a command of the package there, with an untrained network in place of the trained one."""
    monkeypatch.setattr(shipped, "_INSTALLED", model[0])
    monkeypatch.chdir(folder)

    def run(words):
        force = ["--force"] if words[1] in ("predict", "convert") else []
        main([*words[1:], *force, *(["--samples", "20"] if words[1] == "evaluate" else [])])

    return run


@pytest.mark.parametrize("words", RUN)
def test_a_command_on_a_page_runs(words, folder, request, monkeypatch):
    """As written, but for replicates, trials and worlds, which are fewer."""
    if begins(words, IN_A_COPY):
        ended = done(request.getfixturevalue("project"), *words)
    elif words[0] == "pedpred":
        request.getfixturevalue("commanded")(words)
        return
    else:
        assert words[:2] == ["python", "-m"]
        module, *given = (PLACE if word == "<name>" else word for word in words[2:])
        monkeypatch.chdir(folder)
        monkeypatch.setattr("sys.argv", [module, *given, *FEWER.get(module, [])])
        monkeypatch.delitem(sys.modules, module, raising=False)
        runpy.run_module(module, run_name="__main__")
        return
    assert ended.returncode == 0, ended.stderr


def test_the_walk_through_measures_what_its_comments_say(folder, commanded):
    """The same people with and without a map: as far off by simple methods, and not by the network."""
    if not (folder / "build/errors.json").exists():  # the test before has run these commands
        for line in blocks(PAGES["docs/recordings.md"], "sh")[0].splitlines():
            commanded(shlex.split(line, comments=True))
    figures = json.loads((folder / "build/errors.json").read_text())
    assert set(figures) == {"hall", "crossing", "all"}
    for method in ("cv", "kalman_cv"):
        assert 0.1 < figures["crossing"][method]["ade_m"] < 1.0
        assert figures["hall"][method]["ade_m"] == figures["crossing"][method]["ade_m"]
    assert figures["hall"]["network"]["ade_m"] != figures["crossing"]["network"]["ade_m"]
    assert (folder / "build/hall.mcap").stat().st_size > 0


@pytest.fixture(scope="module")
def targets():
    """Names of stages, of their families and of pipelines, as DVC takes them for targets."""
    names = {stage.name for stage in stages()}
    files = {str(path.relative_to(ROOT)) for path in config.pipelines(ROOT)}
    return files | names | {name.partition("@")[0] for name in names}


@functools.cache
def options_of(module):
    """What a command lists when it is asked for help."""
    told = StringIO()
    with patch.object(sys, "argv", [module, "--help"]), redirect_stdout(told), pytest.raises(SystemExit):
        importlib.import_module(module).main()
    return {*re.findall(r"--[a-z-]+", told.getvalue())}


@pytest.mark.filterwarnings("ignore:_NoneStep.value:DeprecationWarning")  # of DVC
@pytest.mark.parametrize("words", CHECKED)
def test_a_command_that_is_not_run_asks_for_what_exists(words, request):
    """Targets, stages, options, overrides and ablations, whose points test_ablation.py composes."""
    if words[0] == "make":
        ended = done(request.getfixturevalue("project"), "make", "--dry-run", *words[1:])
        assert ended.returncode == 0, ended.stderr
    elif words[0] == "dvc":
        given = parse_args(words[1:])
        assert {*(getattr(given, "targets", None) or ())} <= request.getfixturevalue("targets")
        if words[:3] == ["dvc", "exp", "run"]:
            check_parts(composed(*given.set_param))
    elif words[0] == "pedpred":
        assert parser().parse_args(words[1:]).action
    elif words[:2] == ["ros2", "launch"]:
        source = (ROOT / "ros" / words[2] / "launch" / words[3]).read_text()
        assert all(f'"{word.partition(":=")[0]}": ' in source for word in words[4:])
    elif "-m" in words and words[0] != "python3":
        module, *given = words[words.index("-m") + 1 :]
        source = Path(importlib.util.find_spec(module).origin).read_text()
        if options := {word for word in given if word.startswith("--")}:
            assert options <= options_of(module)
        if module.startswith("stages."):
            composed(*(word for word in given if word not in SAVED))
            named = {word[1:].partition("=")[0] for word in given if word.startswith("+")} - {"name"}
            named -= {key for key in named if "." in key}  # of conf/, as just composed
            assert all(f"cfg.{key}" in source or f'cfg.get("{key}"' in source for key in named)
        if module == "tools.ablate":
            assert read_ablation(ROOT / f"conf/ablations/{given[0]}.yaml").points
