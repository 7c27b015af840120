"""Machines as they are: read-only installations, full disks, a project without git history."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from tests.conftest import ROOT

SCENE = ROOT / "examples/crossing"
NAMESPACE = ["unshare", "--mount", *([] if os.geteuid() == 0 else ["--map-root-user"])]
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
    mount = [*NAMESPACE, "mount", "-t", "tmpfs", "none", "/mnt"]
    if not shutil.which("unshare") or subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("needs mounts of its own")
    lock = "mount -o remount,bind,ro /" if read_only else "true"
    run = f'mount -t tmpfs -o size={size} none "$0" && {lock} && cd "$1" && shift && "$@"'
    shell = ["bash", "-c", f'{run}; code=$?; ls -A "$0"; exit $code', str(out), str(ROOT)]
    out.mkdir()
    command = [*NAMESPACE, *shell, sys.executable, "-c", script, str(SCENE), str(out)]
    return subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)


@pytest.mark.slow
def test_commands_work_where_all_but_the_output_is_read_only(tmp_path):
    """The package, the home and the temporary folder; in the current folder an output is refused."""
    done = on_a_machine(tmp_path / "out", "64m", True, READ_ONLY)
    _, elsewhere, last = done.stderr.partition("now elsewhere\n")
    assert elsewhere, done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout.split()[-4:] == ["copy", "errors.json", "walk.foxglove.json", "walk.mcap"]
    assert done.returncode == 1
    assert "OutputError: crossing_forecasts.mcap: " in last


@pytest.mark.slow
def test_commands_on_a_full_disk_end_with_a_remedy(tmp_path):
    """Full while the file is written, or from its first byte on."""
    done = on_a_machine(tmp_path / "out", "64k", False, FULL)
    assert done.stderr.count("make room on the disk") == 3, done.stderr
    assert "Traceback" not in done.stderr
    assert not [name for name in ("walk.mcap", "x.json", ".tmp") if name in done.stdout]


def test_full_standard_output_ends_without_a_traceback():
    with open("/dev/full", "w") as full:
        command = [sys.executable, "-m", "pedpred.command", "info", SCENE]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False, cwd=ROOT)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert "Exception ignored" not in done.stderr


def test_a_network_leaves_nothing_in_the_home(tmp_path):
    homes = {name: str(tmp_path) for name in ("HOME", "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME")}
    env = {name: value for name, value in os.environ.items() if not name.startswith("ORT_")} | homes
    command = [sys.executable, "-c", HOMELESS]
    subprocess.run(command, env=env, check=True, cwd=ROOT, stderr=subprocess.DEVNULL)
    assert not list(tmp_path.iterdir())


def run(folder, *command, **more):
    """Run a command in a project without git history; what it prints."""
    tools = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    outer = {name: value for name, value in os.environ.items() if not name.startswith(("DVC_", "GIT_"))}
    env = outer | {"PATH": tools, "GIT_CEILING_DIRECTORIES": str(folder.parent)} | more
    done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.mark.slow
def test_the_pipeline_runs_without_a_git_history(tmp_path):
    """As in an archive; here its first two stages. What a user lets git ignore is part of the project."""
    folder = tmp_path / "pedpred"
    run(ROOT, ".ci/copy", str(folder))
    shutil.rmtree(folder / ".git")
    (folder / "dvc.lock").unlink(missing_ok=True)
    pipeline = yaml.safe_load((folder / "dvc.yaml").read_text())
    first = {name: pipeline["stages"][name] for name in ("config", "fetch")}
    (folder / "dvc.yaml").write_text(yaml.safe_dump({"stages": first}))
    (tmp_path / "git").mkdir()
    (tmp_path / "git/ignore").write_text("Makefile\n")
    assert "Makefile" in run(folder, ".ci/files", XDG_CONFIG_HOME=str(tmp_path)).split("\0")
    run(folder, ".ci/history")
    assert "Running stage 'config'" in run(folder, "dvc", "repro", "config")
    run(folder, sys.executable, "-m", "tools.mend_lock")
    run(folder, "git", "init", "--quiet")
    run(folder, ".ci/history")
    assert "didn't change" in run(folder, "dvc", "repro", "config")
