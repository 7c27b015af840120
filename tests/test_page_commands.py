"""Commands on the pages: those about recordings run as written, the others ask for what exists."""

import functools
import importlib
import importlib.util
import re
import shlex

import pytest
from dvc.cli import parse_args

from pedpred import config
from pedpred.command import main
from pedpred.command.arguments import parser
from pedpred.online import shipped
from stages.config import check_parts
from tests.configuration import composed, stages
from tests.conftest import ROOT
from tools import prose

PAGES = {str(path.relative_to(ROOT)): path.read_text() for path in prose.pages(ROOT)}
READING = ("info", "convert", "predict", "evaluate")
ELSEWHERE = re.compile(r"my_bag|crowds_zara01|data/|build/(?:rooms|tried)")
"""What the reader of a page has and this project has not."""
SAVED = {"folds=crossing"}
"""Overrides that choose a file of conf/ which the reader of the page has written."""

pytestmark = pytest.mark.slow


def commands(page):
    """The commands in the blocks of a page, as words; leading variables are left out."""
    for language, block in re.findall(r"^ *```(\w+)\n((?:.*\n)*?) *```$", PAGES[page], re.MULTILINE):
        prompt = {"sh": "", "console": "$ "}.get(language)
        lines = [] if prompt is None else [li for li in block.splitlines() if li.strip().startswith(prompt)]
        for part in (part for line in lines for part in line.removeprefix(prompt).split("&&")):
            words = [word for word in shlex.split(part, comments=True) if not re.match(r"[A-Z_]+=", word)]
            if words:
                yield words


def runs(words):
    """Whether a command reads a recording that is part of the project, or that another command writes."""
    return words[0] == "pedpred" and words[1] in READING and not ELSEWHERE.search(" ".join(words))


SHOWING = [page for page in PAGES if any(map(runs, commands(page)))]
COMMANDING = [page for page in PAGES if any(not runs(words) for words in commands(page))]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder in which commands run one after the other, page after page, as in the project."""
    place = tmp_path_factory.mktemp("pages")
    (place / "examples").symlink_to(ROOT / "examples")
    (place / "build").mkdir()
    return place


@pytest.mark.parametrize("page", SHOWING)
def test_a_command_on_a_page_runs(page, folder, model, monkeypatch):
    """With an untrained network in place of the trained one."""
    monkeypatch.setattr(shipped, "_INSTALLED", model[0])
    monkeypatch.chdir(folder)
    for words in filter(runs, commands(page)):
        more = {"predict": ["--force"], "convert": ["--force"], "evaluate": ["--samples", "20"]}
        main([*words[1:], *more.get(words[1], [])])


@functools.cache
def targets():
    """Names of stages, of their families and of pipelines, as DVC takes them for targets."""
    files = {str(path.relative_to(ROOT)) for path in config.pipelines(ROOT)}
    names = {stage.name for stage in stages()} | {f"{stage.path_in_repo}:{stage.name}" for stage in stages()}
    return files | names | {name.partition("@")[0] for name in names}


@pytest.mark.filterwarnings("ignore:_NoneStep.value:DeprecationWarning")  # of DVC
@pytest.mark.parametrize("page", COMMANDING)
def test_command_that_is_not_run_asks_for_what_exists(page):
    made = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    for words in (words for words in commands(page) if not runs(words)):
        if words[0] == "make":
            assert {word for word in words[1:] if "=" not in word} <= set(made)
        elif words[0] == "dvc":
            given = parse_args(words[1:])
            assert {*(getattr(given, "targets", None) or ())} <= targets()
            if words[:3] == ["dvc", "exp", "run"] and not given.queue:  # a queue is of several values
                check_parts(composed(*given.set_param))
        elif words[0] == "pedpred":
            assert parser().parse_args(words[1:]).action
        elif "-m" in words and words[0] != "python3":
            module, *given = words[words.index("-m") + 1 :]
            assert importlib.util.find_spec(module)
            if module.startswith("stages."):
                composed(*(word for word in given if word not in SAVED and not word.startswith("--")))
