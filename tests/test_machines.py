"""Machines as they are: read-only installations, full disks, files damaged by a power cut."""

import errno
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from pedpred.errors import OutputError, user_errors
from tests.configuration import read
from tests.conftest import ROOT
from tests.disk import small_files
from tests.trust import project
from tests.trust.examples import make_recording
from tests.trust.readers import READERS
from tools import ablate, compare, mend_lock

SCENE = ROOT / "examples/crossing"
NAMESPACE = ["unshare", "--mount", *([] if os.geteuid() == 0 else ["--map-root-user"])]
COMMAND = [sys.executable, "-m", "pedpred.command"]
WRITERS = {
    name: READERS[name].make
    for name in ("scene", "features", "situations", "embeddings", "forecasts", "checkpoint", "model")
} | {"recording": make_recording}


def allowed():
    """Whether this kernel lets a process have mounts of its own."""
    if shutil.which("unshare") is None:
        return False
    mount = [*NAMESPACE, "mount", "-t", "tmpfs", "none", "/mnt"]
    return subprocess.run(mount, capture_output=True, check=False).returncode == 0


mounting = pytest.mark.skipif(not allowed(), reason="needs mounts of its own")


def on_a_machine(out, size, read_only, *command, folder="/"):
    """Run a command where `out` is a disk of some size, and perhaps all else read-only; list `out`."""
    lock = "mount -o remount,bind,ro /" if read_only else "true"
    run = f'mount -t tmpfs -o size={size} none "$0" && {lock} && cd "$1" && shift && "$@"'
    script = f'{run}; code=$?; ls -A "$0"; exit $code'
    out.mkdir(exist_ok=True)
    call = [*NAMESPACE, "bash", "-c", script, str(out), folder, *map(str, command)]
    return subprocess.run(call, capture_output=True, text=True, check=False, cwd=ROOT)


@pytest.fixture(scope="module")
def read_only(tmp_path_factory):
    """What four commands that write into the output said, then one that writes into the current folder."""
    out = tmp_path_factory.mktemp("read_only") / "out"
    script = (
        "import sys; from pedpred.command import main; scene, out = sys.argv[1:]\n"
        "main(['info', scene])\n"
        "main(['predict', scene, '-o', f'{out}/walk.mcap'])\n"
        "main(['convert', scene, '-o', f'{out}/copy'])\n"
        "main(['evaluate', scene, '--samples', '10', '--json', f'{out}/errors.json'])\n"
        "print('now elsewhere', file=sys.stderr)\n"
        "main(['predict', scene])\n"
    )
    return on_a_machine(out, "64m", True, sys.executable, "-c", script, SCENE, out, folder=str(ROOT))


@mounting
def test_commands_work_where_all_but_the_output_is_read_only(read_only):
    """The package, the home, the current folder and the temporary folder."""
    said, elsewhere, _ = read_only.stderr.partition("now elsewhere\n")
    assert elsewhere, said
    assert "Traceback" not in said
    assert "on the map" in read_only.stdout
    assert read_only.stdout.split()[-4:] == ["copy", "errors.json", "walk.foxglove.json", "walk.mcap"]


@mounting
def test_an_output_in_a_read_only_folder_is_refused(read_only):
    _, _, said = read_only.stderr.partition("now elsewhere\n")
    assert read_only.returncode == 1
    assert "OutputError: crossing_forecasts.mcap: it cannot be written: Read-only file system" in said
    assert "Traceback" not in said


@mounting
def test_commands_on_a_full_disk_end_with_a_remedy(tmp_path):
    """Full while the file is written, or from its first byte on."""
    out = tmp_path / "out"
    script = (
        "import sys; from pedpred.command import main; scene, out = sys.argv[1:]\n"
        "writing = 'predict -o walk.mcap', 'convert -o walk.mcap', 'evaluate --samples 10 --json x.json'\n"
        "for taken, words in zip((0, 56, 60), writing):\n"
        "    open(f'{out}/taken', 'wb').write(bytes(1024 * taken))\n"
        "    command, *options, name = words.split()\n"
        "    try:\n"
        "        main([command, scene, *options, f'{out}/{name}'])\n"
        "    except SystemExit as ended:\n"
        "        print(command, ended.code, file=sys.stderr)\n"
    )
    done = on_a_machine(out, "64k", False, sys.executable, "-c", script, SCENE, out, folder=str(ROOT))
    for command in ("predict", "convert", "evaluate"):
        said = r"\w+: .*it cannot be written: No space left on device.*make room on the disk"
        assert re.search(f"^{command} {said}", done.stderr, re.MULTILINE), done.stderr
    assert "Traceback" not in done.stderr
    assert not [name for name in ("walk.mcap", "x.json", ".tmp") if name in done.stdout]


def test_a_full_standard_output_ends_without_a_traceback():
    with open("/dev/full", "w") as full:
        command = [*COMMAND, "info", SCENE]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False, cwd=ROOT)
    assert done.returncode == 1
    assert "No space left on device" in done.stderr
    assert "Traceback" not in done.stderr
    assert "Exception ignored" not in done.stderr


def test_a_network_leaves_nothing_in_the_home(tmp_path):
    script = (
        "from pedpred.online.network import ExportedNetwork, read_description\n"
        "from pedpred.online.shipped import default_model\n"
        "ExportedNetwork(default_model(), read_description(default_model()))"
    )
    homes = {name: str(tmp_path) for name in ("HOME", "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME")}
    env = {name: value for name, value in os.environ.items() if not name.startswith("ORT_")} | homes
    subprocess.run([sys.executable, "-c", script], env=env, check=True, cwd=ROOT, stderr=subprocess.DEVNULL)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("size", [0, 40])
@pytest.mark.parametrize("name", WRITERS)
def test_a_full_disk_is_an_output_error_of_every_writer(name, size, tmp_path):
    with small_files(size), pytest.raises(OutputError, match="make room") as refused:
        WRITERS[name](tmp_path)
    assert not refused.value.path.exists()
    assert not [path for path in tmp_path.rglob("*") if ".tmp" in path.name]


def test_a_full_disk_without_a_file_name_has_a_remedy():
    with pytest.raises(SystemExit, match="make room on the disk"), user_errors():
        raise OSError(28, "No space left on device")


@pytest.mark.parametrize("number", [errno.ENOENT, errno.ENOTDIR, errno.EISDIR])
def test_other_errors_of_the_system_do_not_ask_for_room(number):
    """Where they lack it: `trust/test_trust_faults.py`."""
    with pytest.raises(SystemExit, match="dvc") as ended, user_errors():
        raise OSError(number, os.strerror(number), "dvc")
    assert "make room" not in str(ended.value)


# Without a git history


@pytest.fixture(scope="module")
def archived(tmp_path_factory):
    """The project as an archive holds it, without history and ignored files; of its stages, the first two."""
    folder = tmp_path_factory.mktemp("archived") / "pedpred"
    run(ROOT, ".ci/copy", str(folder))
    shutil.rmtree(folder / ".git")
    (folder / "dvc.lock").unlink(missing_ok=True)
    pipeline = yaml.safe_load((folder / "dvc.yaml").read_text())
    first = {name: pipeline["stages"][name] for name in ("config", "fetch")}
    (folder / "dvc.yaml").write_text(yaml.safe_dump({"stages": first}))
    (folder / "build").mkdir()
    (folder / "build/scratch").write_text("ignored")
    return folder


def run(folder, *command):
    """Run a command; what it says."""
    tools = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    outer = {name: value for name, value in os.environ.items() if not name.startswith(("DVC_", "GIT_"))}
    env = outer | {"PATH": tools, "GIT_CEILING_DIRECTORIES": str(folder.parent)}
    done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, check=False)
    said = done.stdout + done.stderr
    assert done.returncode == 0, said
    assert "Traceback" not in said
    return said


@pytest.fixture
def inside(archived, monkeypatch):
    """The archived project as the current folder, where git looks no higher; ends a tool, says with what."""
    for name in [name for name in os.environ if name.startswith("DVC_")]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(archived.parent))
    monkeypatch.chdir(archived)

    def refused(tool, *arguments):
        monkeypatch.setattr(sys, "argv", [tool.__name__, *arguments])
        with pytest.raises(SystemExit) as ended:
            tool.main()
        assert "Traceback" not in str(ended.value)
        return str(ended.value)

    return refused


@pytest.mark.filterwarnings("ignore:_NoneStep.value:DeprecationWarning")  # of DVC
def test_the_pipeline_runs_without_a_git_history(archived, inside):
    run(archived, ".ci/history")
    assert "Running stage 'config'" in run(archived, "dvc", "repro", "config")
    mend_lock.main()
    run(archived, "git", "init", "--quiet")
    run(archived, ".ci/history")
    assert "no_scm" not in (archived / ".dvc/config.local").read_text()
    assert "didn't change" in run(archived, "dvc", "repro", "config")
    shutil.rmtree(archived / ".git")


def test_the_project_s_files_are_known_without_a_git_history(archived, tmp_path):
    run(archived, ".ci/copy", str(tmp_path / "copy"))
    copied = {path.name for path in (tmp_path / "copy").iterdir()}
    assert copied >= {"pedpred", "Makefile", "dvc.yaml", ".dvc"}
    assert not copied & {"build"}
    listed = [run(folder, ".ci/files").split("\0") for folder in (archived, tmp_path / "copy")]
    assert sorted(listed[0]) == sorted(listed[1])


def test_what_a_user_ignores_everywhere_is_no_less_part_of_the_project(archived, tmp_path, monkeypatch):
    known = run(archived, ".ci/files")
    (tmp_path / "git").mkdir()
    (tmp_path / "git/ignore").write_text("*.png\nmodels/\n")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    assert run(archived, ".ci/files") == known


@pytest.mark.parametrize("command", [(".ci/copy",), ("make", "copied")])
def test_a_copy_leaves_the_repository_alone_whose_hook_makes_it(command, tmp_path):
    here, there = tmp_path / "here", tmp_path / "there"
    shutil.copytree(ROOT / ".ci", here / ".ci")
    makefile = (ROOT / "Makefile").read_text() + "\ncopied:\n\t@! env | grep ^GIT_DIR= && .ci/copy $(TO)\n"
    (here / "Makefile").write_text(makefile)
    run(here, "git", "init", "--quiet")
    before = (here / ".git/config").read_text()
    to = str(there) if len(command) == 1 else f"TO={there}"
    run(here, "env", f"GIT_DIR={here / '.git'}", f"GIT_INDEX_FILE={here / '.git/index'}", *command, to)
    assert (here / ".git/config").read_text() == before
    assert (there / ".git").is_dir()
    assert (there / "Makefile").exists()


def test_settings_of_git_that_a_user_has_change_no_test(tmp_path, monkeypatch):
    executable = tmp_path / "hooks/pre-commit"
    executable.parent.mkdir()
    executable.write_text("#!/bin/sh\nexit 1\n")
    executable.chmod(0o755)
    (tmp_path / "ignored").write_text("*.png\n")
    core = f"[core]\nhooksPath = {executable.parent}\nexcludesFile = {tmp_path / 'ignored'}\n"
    (tmp_path / ".gitconfig").write_text(f"{core}[commit]\ngpgSign = true\n[gpg]\nprogram = false\n")
    monkeypatch.setenv("HOME", str(tmp_path))
    for name, environment in (("here", dict(os.environ)), ("there", project.environment())):
        (tmp_path / name).mkdir()
        (tmp_path / name / "picture.png").touch()
        for command in (("init", "-q"), ("add", "."), ("commit", "-qm", "first")):
            subprocess.run(["git", *command], cwd=tmp_path / name, env=environment, check=True)


def test_what_compares_revisions_says_that_there_is_none(inside):
    assert "not a git repository" in inside(compare, "HEAD")
    point = next(iter(read("conf/ablations/mixture.yaml")["points"]))
    assert "not a git repository" in inside(ablate, "mixture", "--point", point)
