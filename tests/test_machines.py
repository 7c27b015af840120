"""Machines as they are: read-only installations, full disks, a project without git history."""

import os
import shutil
import subprocess
import sys

import pytest
import yaml

from pedpred.errors import OutputError
from tests.configuration import read
from tests.conftest import ROOT
from tests.disk import small_files
from tests.trust.examples import make_recording
from tests.trust.project import done
from tests.trust.readers import READERS
from tools import ablate, compare, mend_lock

SCENE = ROOT / "examples/crossing"
NAMESPACE = ["unshare", "--mount", *([] if os.geteuid() == 0 else ["--map-root-user"])]
WRITERS = {
    name: READERS[name].make
    for name in ("scene", "features", "situations", "embeddings", "forecasts", "checkpoint", "model")
} | {"recording": make_recording}
READ_ONLY = """
import sys; from pedpred.command import main; scene, out = sys.argv[1:]
main(['info', scene])
main(['predict', scene, '-o', f'{out}/walk.mcap'])
main(['convert', scene, '-o', f'{out}/copy'])
main(['evaluate', scene, '--samples', '10', '--json', f'{out}/errors.json'])
print('now elsewhere', file=sys.stderr)
main(['predict', scene])
"""
FULL = """
import sys; from pedpred.command import main; scene, out = sys.argv[1:]
writing = 'predict -o walk.mcap', 'convert -o walk.mcap', 'evaluate --samples 10 --json x.json'
for taken, words in zip((0, 56, 60), writing):
    open(f'{out}/taken', 'wb').write(bytes(1024 * taken))
    command, *options, name = words.split()
    try:
        main([command, scene, *options, f'{out}/{name}'])
    except SystemExit as ended:
        print(ended.code, file=sys.stderr)
"""
HOMELESS = """
from pedpred.online.network import ExportedNetwork, read_description
from pedpred.online.shipped import default_model
ExportedNetwork(default_model(), read_description(default_model()))
"""


def on_a_machine(out, size, read_only, script):
    """Run a script where `out` is a disk of some size, and perhaps all else read-only; list `out`."""
    lock = "mount -o remount,bind,ro /" if read_only else "true"
    run = f'mount -t tmpfs -o size={size} none "$0" || exit 99; {lock} && cd "$1" && shift && "$@"'
    shell = f'{run}; code=$?; ls -A "$0"; exit $code'
    command = [sys.executable, "-c", script, str(SCENE), str(out)]
    call = [*NAMESPACE, "bash", "-c", shell, str(out), str(ROOT), *command]
    out.mkdir()
    ended = subprocess.run(call, capture_output=True, text=True, check=False, cwd=ROOT)
    if ended.returncode == 99 or ended.stderr.startswith("unshare:"):
        pytest.skip("needs mounts of its own")
    return ended


@pytest.mark.slow
def test_commands_work_where_all_but_the_output_is_read_only(tmp_path):
    """The package, the home and the temporary folder; in the current folder an output is refused."""
    ended = on_a_machine(tmp_path / "out", "64m", True, READ_ONLY)
    _, elsewhere, last = ended.stderr.partition("now elsewhere\n")
    assert elsewhere, ended.stderr
    assert "Traceback" not in ended.stderr
    assert ended.stdout.split()[-4:] == ["copy", "errors.json", "walk.foxglove.json", "walk.mcap"]
    assert ended.returncode == 1
    assert "OutputError: crossing_forecasts.mcap: " in last


@pytest.mark.slow
def test_commands_on_a_full_disk_end_with_a_remedy(tmp_path):
    """Full while the file is written, or from its first byte on."""
    ended = on_a_machine(tmp_path / "out", "64k", False, FULL)
    assert ended.stderr.count("make room on the disk") == 3, ended.stderr
    assert "Traceback" not in ended.stderr
    assert not [name for name in ("walk.mcap", "x.json", ".tmp") if name in ended.stdout]


def test_full_standard_output_ends_without_a_traceback():
    with open("/dev/full", "w") as full:
        command = [sys.executable, "-m", "pedpred.command", "info", SCENE]
        ended = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False, cwd=ROOT)
    assert ended.returncode == 1
    assert "Traceback" not in ended.stderr
    assert "Exception ignored" not in ended.stderr


def test_a_network_leaves_nothing_in_the_home(tmp_path):
    homes = {name: str(tmp_path) for name in ("HOME", "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME")}
    env = {name: value for name, value in os.environ.items() if not name.startswith("ORT_")} | homes
    command = [sys.executable, "-c", HOMELESS]
    subprocess.run(command, env=env, check=True, cwd=ROOT, stderr=subprocess.DEVNULL)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("size", [0, 40])
@pytest.mark.parametrize("name", WRITERS)
def test_full_disk_is_an_output_error_of_every_writer(name, size, tmp_path):
    with small_files(size), pytest.raises(OutputError) as refused:
        WRITERS[name](tmp_path)
    assert not refused.value.path.exists()
    assert not [path for path in tmp_path.rglob("*") if ".tmp" in path.name]


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
    """Run a command where git looks no higher; what it prints."""
    ended = done(folder, *command, GIT_CEILING_DIRECTORIES=str(folder.parent))
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended.stdout + ended.stderr


@pytest.fixture
def inside(archived, monkeypatch):
    """The archived project as the current folder, where git looks no higher."""
    for name in [name for name in os.environ if name.startswith("DVC_")]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(archived.parent))
    monkeypatch.chdir(archived)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:_NoneStep.value:DeprecationWarning")  # of DVC
def test_the_pipeline_runs_without_a_git_history(archived, inside):
    run(archived, ".ci/history")
    assert "Running stage 'config'" in run(archived, "dvc", "repro", "config")
    mend_lock.main()
    run(archived, "git", "init", "--quiet")
    run(archived, ".ci/history")
    assert "didn't change" in run(archived, "dvc", "repro", "config")
    shutil.rmtree(archived / ".git")


def test_files_of_the_project_are_known_without_git(archived, tmp_path, monkeypatch):
    """Whatever a user lets git ignore everywhere."""
    run(archived, ".ci/copy", str(tmp_path / "copy"))
    copied = {path.name for path in (tmp_path / "copy").iterdir()}
    assert copied >= {"pedpred", "models", "Makefile", "dvc.yaml", ".dvc"}
    assert "build" not in copied
    listed = [run(folder, ".ci/files").split("\0") for folder in (archived, tmp_path / "copy")]
    assert sorted(listed[0]) == sorted(listed[1])
    (tmp_path / "git").mkdir()
    (tmp_path / "git/ignore").write_text("*.png\nmodels/\n")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    assert run(archived, ".ci/files").split("\0") == listed[0]


def test_tools_that_compare_revisions_say_that_none_is(inside, monkeypatch):
    point = next(iter(read("conf/ablations/mixture.yaml")["points"]))
    for tool, arguments in ((compare, ["HEAD"]), (ablate, ["mixture", "--point", point])):
        monkeypatch.setattr(sys, "argv", [tool.__name__, *arguments])
        with pytest.raises(SystemExit) as ended:
            tool.main()
        assert "not a git repository" in str(ended.value)
