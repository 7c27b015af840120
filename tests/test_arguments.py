"""Bad arguments, outputs and interruptions of the command line: a message, before any work begins."""

import os
import re
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from pedpred.command import conversion, driving, evaluation, main, prediction
from pedpred.command.arguments import check, parser
from tests.conftest import ROOT

SCENE = str(ROOT / "examples/crossing")
BELOW = ["file", "/dev/full", "/proc", "x" * 300]
"""Nothing can be written below these."""


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder with a file and a folder in it, where reading a recording fails the test."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("precious")

    def work(*given, **more):
        pytest.fail("work has begun")

    for module in (conversion, prediction, evaluation):
        monkeypatch.setattr(module, "open_recording", work)
    monkeypatch.setattr(driving, "open_scene", work)
    return tmp_path


def refusal(capsys, *arguments):
    """What a command prints before it ends with an error."""
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
def test_an_output_that_cannot_be_written_is_refused(command, output, here, capsys):
    (here / "taken.mcap").mkdir()
    action, option = command.split()
    refusal(capsys, action, SCENE, option, output, *(["--force"] if option == "-o" else []))
    assert sorted(os.listdir()) == ["file", "folder", "taken.mcap"]
    assert Path("file").read_text() == "precious"


@pytest.mark.parametrize(
    "command", ["convert {} -o file.mcap", "predict {} -o file.csv", "drive {} --record file.mcap"]
)
@pytest.mark.parametrize("there", ["file", "link", "layout"])
def test_outputs_are_replaced_by_force_alone(command, there, here, capsys):
    *_, name = command.split()
    path = Path(name).with_suffix(".foxglove.json") if there == "layout" else Path(name)
    path.symlink_to("nowhere") if there == "link" else path.write_text("precious")
    if there != "layout" or name.endswith(".mcap"):
        assert "--force" in refusal(capsys, *command.format(SCENE).split())
        assert there == "link" or path.read_text() == "precious"


@pytest.mark.parametrize(("folder", "within"), [(".", ""), ("..", "deeper"), ("../hall", "")])
def test_an_output_is_named_after_the_input(folder, within, tmp_path, monkeypatch):
    (tmp_path / "hall/deeper").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "hall" / within)
    arguments = parser().parse_args(["predict", folder])
    check(arguments)
    assert str(arguments.output) == "hall_forecasts.mcap"


def test_an_input_is_never_the_output(here, capsys):
    Path("walk.csv").write_text("time,id,x,y\n")
    assert "walk.csv" in refusal(capsys, "evaluate", "walk.csv", "--json", "walk.csv")
    assert Path("walk.csv").read_text() == "time,id,x,y\n"


@pytest.mark.parametrize(
    "arguments",
    [
        *("--samples 0", "--samples 1.5", "--samples 1e9", "--seed -1", "--seed abc", "--moving-mps nan"),
        *("--moving-mps 0", "--collision-m -1", "--step-s 0", "--step-s 0.4", "--model nowhere"),
        *("--tracker nowhere.yaml", "--forecasts nowhere.csv", "--map nowhere", "--model folder"),
        *(f"{SCENE} --forecasts file", "--json .", "--rate 0", "--columns time,id,x", "--unit mile"),
        *("--no-map --map folder", "--no-map --map-topic /map", "--transform 0 0 90", "--homography file"),
    ],
)
def test_an_argument_without_sense_is_named(arguments, here, capsys):
    text = refusal(capsys, "evaluate", SCENE, *arguments.split())
    option = re.findall(r"--[\w-]+", arguments)[-1]
    assert option in text or arguments.split()[-1] in text


@pytest.mark.parametrize("command", ["info", "evaluate", "predict", "convert -o new"])
@pytest.mark.parametrize("name", ["gone.csv", "pipe.csv"])
def test_a_missing_input_is_named_before_any_is_read(command, name, here, capsys):
    os.mkfifo("pipe.csv")
    scenes = [SCENE, name] if command in ("info", "evaluate") else [name]
    assert name in refusal(capsys, *command.split(), *scenes)


@pytest.mark.parametrize(
    ("option", "value"), [("--unit", "cm"), ("--topic", "/people"), ("--scale", "0.1"), ("--class", "dog")]
)
def test_an_error_names_the_option_that_was_given(option, value, capsys):
    assert f"{option} = " in refusal(capsys, "info", SCENE, option, value)


@pytest.mark.parametrize(
    "columns", ["time,id,x,y", "time, id, x, y", "time=t,id=n,x=px,y=py", "y=py, x=px,id=n,time=t"]
)
def test_columns_are_named_by_order_or_title(columns, tmp_path, capsys):
    header = "t,n,px,py\n" if "=" in columns else ""
    (tmp_path / "walk.csv").write_text(f"{header}0,1,0,0\n0.4,1,0.4,0\n")
    main(["info", str(tmp_path / "walk.csv"), "--columns", columns])
    assert "2 of 1 tracks" in capsys.readouterr().out


# Interruptions


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
