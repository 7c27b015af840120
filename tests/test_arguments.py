"""Bad arguments, outputs and interruptions of the command line: a message, before any work begins."""

import os
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


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder with a file and a folder in it, where reading a recording fails the test."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("precious")
    for module in (conversion, prediction, evaluation):
        monkeypatch.setattr(module, "open_recording", lambda *given, **more: pytest.fail("work has begun"))
    monkeypatch.setattr(driving, "open_scene", lambda *given, **more: pytest.fail("work has begun"))
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
    ("command", "outputs"),
    [
        ("convert {} --force -o", "file /dev/full x.txt hall.v2 file/x.mcap /proc/x"),
        ("predict {} --force -o", ". folder /dev/full x x.json file/x.mcap /proc/x.mcap"),
        ("evaluate {} --json", ". folder /dev/full file/x /proc/x"),
        ("drive {} --table", "folder file/x.csv"),
        ("drive {} --force --record", "folder x.csv file/x.mcap"),
        ("drive {} --curves", "curves.svg file/x.png"),
    ],
)
def test_an_output_that_cannot_be_written_is_refused(command, outputs, here, capsys):
    for output in outputs.split():
        refusal(capsys, *command.format(SCENE).split(), output)
    assert sorted(os.listdir()) == ["file", "folder"]
    assert Path("file").read_text() == "precious"


@pytest.mark.parametrize(
    "command", ["convert {} -o x.mcap", "predict {} -o x.csv", "drive {} --record x.mcap"]
)
def test_outputs_are_replaced_by_force_alone(command, here, capsys):
    """The layout beside a recording is an output, too."""
    *_, name = command.split()
    for there in (name, "x.foxglove.json") if name.endswith(".mcap") else (name,):
        Path(there).write_text("precious")
        assert "--force" in refusal(capsys, *command.format(SCENE).split())
        assert Path(there).read_text() == "precious"
        Path(there).unlink()


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


WRONG = """
--samples 0; --samples 1.5; --seed -1; --moving-mps nan; --collision-m -1; --step-s 0.4; --model nowhere;
--tracker nowhere; --forecasts nowhere; --map nowhere; --rate 0; --columns time,id,x; --unit mile;
--no-map --map folder; --transform 0 0 90; --homography file; --json .
"""


@pytest.mark.parametrize("arguments", [*WRONG.split(";"), f"{SCENE} --forecasts file"])
def test_a_wrong_argument_is_named(arguments, here, capsys):
    text = refusal(capsys, "evaluate", SCENE, *arguments.split())
    assert any(word in text for word in arguments.split() if word != SCENE)


@pytest.mark.parametrize("command", ["info", "evaluate", "predict", "convert -o new"])
def test_a_missing_input_is_named_before_any_is_read(command, here, capsys):
    scenes = [SCENE, "gone.csv"] if command in ("info", "evaluate") else ["gone.csv"]
    assert "gone.csv" in refusal(capsys, *command.split(), *scenes)


def test_an_error_names_the_option_that_was_given(capsys):
    for option, value in (("--unit", "cm"), ("--class", "dog")):
        assert f"{option} = " in refusal(capsys, "info", SCENE, option, value)


@pytest.mark.parametrize("columns", ["time, id, x, y", "time=t,id=n,x=px,y=py"])
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
