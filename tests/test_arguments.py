"""Bad arguments, outputs and interruptions of the command line: a sentence, before any work begins."""

import os
import re
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from pedpred.command import driving, main, prediction
from pedpred.command import evaluation as measuring
from pedpred.command.arguments import check, parser
from tests.conftest import ROOT

SCENE = str(ROOT / "examples/crossing")
BELOW = ["file", "/dev/full", "/proc", "x" * 300]
"""Nothing can be written below these."""


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder with a file and a folder in it; whoever begins to work there fails."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("precious")

    def worked(*given, **more):
        pytest.fail("work has begun")

    for module in (prediction, measuring, driving):
        monkeypatch.setattr(module, "read_given", worked)
    monkeypatch.setattr("pedpred.command.conversion.read_given", worked)
    return tmp_path


def said(capsys, *arguments):
    """What a command says before it ends with an error."""
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    assert ended.value.code not in (0, None)
    text = str(ended.value.code) + capsys.readouterr().err
    assert "Traceback" not in text
    return text


@pytest.mark.parametrize(
    ("command", "output"),
    [
        *(("convert -o", name) for name in ("", " ", "file", "/dev/full", "taken.mcap", "x.txt")),
        *(("predict -o", name) for name in ("", ".", "folder", "/dev/full", "taken.mcap", "x", "x.json")),
        *(("evaluate --json", name) for name in ("", " ", ".", "folder", "/dev/full", "x" * 300)),
        *(("convert -o", f"{name}/{x}") for name in BELOW for x in ("x", "x.mcap")),
        *(("predict -o", f"{name}/x.mcap") for name in BELOW),
        *(("evaluate --json", f"{name}/x") for name in BELOW),
    ],
)
def test_an_output_that_cannot_be_written_is_refused_before_work(command, output, here, capsys):
    (here / "taken.mcap").mkdir()
    action, option = command.split()
    text = said(capsys, action, SCENE, option, output, *(["--force"] if option == "-o" else []))
    assert any(words in text for words in ("it cannot be written", "the name is empty", "ends in .mcap"))
    assert sorted(os.listdir()) == ["file", "folder", "taken.mcap"]
    assert Path("file").read_text() == "precious"


def test_a_pipe_is_not_read_as_an_empty_file(here, capsys):
    os.mkfifo("walk.csv")
    for command in (["info"], ["predict"], ["evaluate"], ["convert", "-o", "new"]):
        assert "walk.csv: it is a pipe or device" in said(capsys, *command, "walk.csv")


@pytest.mark.parametrize(("folder", "within"), [(".", ""), ("..", "deeper"), ("./", ""), ("../hall", "")])
def test_an_output_is_called_after_the_folder_that_the_input_is(folder, within, tmp_path, monkeypatch):
    (tmp_path / "hall/deeper").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "hall" / within)
    arguments = parser().parse_args(["predict", folder])
    check(arguments)
    assert str(arguments.output) == "hall_forecasts.mcap"


def test_an_input_is_never_the_output(here, capsys):
    Path("walk.csv").write_text("time,id,x,y\n")
    assert "input of this command" in said(capsys, "evaluate", "walk.csv", "--json", "walk.csv")


@pytest.mark.parametrize(
    "arguments",
    [
        *("--samples 0", "--samples 1.5", "--samples 1e9", "--seed -1", "--seed abc", "--moving-mps nan"),
        *("--moving-mps 0", "--collision-m -1", "--step-s 0", "--model nowhere", "--tracker nowhere.yaml"),
        *("--forecasts nowhere.csv", "--map nowhere", "--tracker file", "--model folder"),
        *(f"{SCENE} --forecasts file", "--json ."),
    ],
)
def test_an_argument_that_makes_no_sense_is_named_before_work(arguments, here, capsys):
    option = arguments.split()[-2]
    text = said(capsys, "evaluate", SCENE, *arguments.split())
    value = arguments.split()[-1]
    assert option in text or value in text


def test_of_several_scenes_a_missing_one_is_named_before_the_first_is_read(here, capsys):
    assert "gone.csv: there is no such file" in said(capsys, "evaluate", SCENE, "gone.csv")
    assert "gone.csv: there is no such file" in said(capsys, "info", SCENE, "gone.csv")


@pytest.mark.parametrize(
    "work",
    [
        f"""
        from pedpred.command import main, user_errors
        with user_errors():
            print(flush=True)
            main(["evaluate", {SCENE!r}])
        """,
        """
        import stages
        print(flush=True)
        import stages.train
        """,
    ],
)
def test_ctrl_c_ends_quietly(work):
    """Also while the command or a stage is being imported, which takes a second or more."""
    ready = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"  # others may ignore it
    with started("-c", ready + textwrap.dedent(work)) as running:
        running.stdout.readline()
        running.send_signal(signal.SIGINT)
        assert (running.wait(60), running.stderr.read()) == (130, "")


def test_a_closed_pipe_ends_quietly():
    with started("-m", "pedpred.command", "info", "examples/corner/people.mcap") as running:
        running.stdout.close()
        assert (running.wait(60), running.stderr.read()) == (141, "")


def started(*command):
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen([sys.executable, *command], cwd=ROOT, **pipes)


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ("info {} --no-map --map {}", "--map = .*--no-map leaves every map out"),
        ("info {} --no-map --open-end 0 0 1 0", "--open-end = .*--no-map leaves every map out"),
        ("info {} --no-map --map-topic /map", "--map-topic = '/map', .*--no-map leaves every map out"),
        ("evaluate {} --step-s 0.4", "--step-s = 0.4, .*it is about a table"),
    ],
)
def test_options_that_would_change_nothing_are_refused(given, named, here, capsys):
    assert re.search(named, said(capsys, *given.format(SCENE, SCENE).split()))


@pytest.mark.parametrize(
    ("option", "value"),
    [("--rate", "0"), ("--columns", "time,id,x"), ("--columns", ""), ("--scale", "0.1")],
)
def test_an_error_names_the_option_that_was_given(option, value, tmp_path, capsys):
    (tmp_path / "walk.csv").write_text("0,1,0,0\n0.4,1,0.4,0\n")
    (tmp_path / "h.txt").write_text("1 0 0 0 1 0 0 0 1")
    more = ["--homography", tmp_path / "h.txt"] if option == "--scale" else []
    assert f"{option} = " in said(capsys, "info", tmp_path / "walk.csv", option, value, *more)


@pytest.mark.parametrize("columns", ["time,id,x,y", "time, id, x, y"])
def test_columns_are_named_in_their_order(columns, tmp_path, capsys):
    (tmp_path / "walk.csv").write_text("0,1,0,0\n0.4,1,0.4,0\n")
    main(["info", str(tmp_path / "walk.csv"), "--columns", columns])
    assert "2 of 1 tracks" in capsys.readouterr().out
