"""Files are replaced as a whole or not at all; missing inputs and bad outputs are named."""

import os
import signal
import stat
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import pytest

import pedpred
from pedpred.command.recordings import open_scene, read_ground_at
from pedpred.errors import InputError, OutputError, ValueRuleError
from pedpred.files import (
    atomic_write,
    check_input,
    check_output,
    read_bytes,
    translate_errors,
    write_text,
)
from pedpred.online.shipped import default_model
from pedpred.ros import read_bag
from tests.conftest import ROOT
from tests.disk import small_files
from tests.refused import unread

KILLED = """
import os, pathlib, signal, sys
from pedpred.files import atomic_write

with atomic_write(pathlib.Path(sys.argv[1])) as new:
    new.write_text("half")
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.fixture
def page(tmp_path):
    write_text(tmp_path / "new" / "page.md", "old")
    return tmp_path / "new" / "page.md"


# Writing


def test_a_file_is_replaced_when_the_block_ends(page):
    """By a temporary file of the same suffix, by which libraries choose a format."""
    with atomic_write(page) as new:
        assert (new.parent, new.suffix) == (page.parent, page.suffix)
        new.write_text("half")
        assert page.read_text() == "old"
        new.write_text("whole")
    assert page.read_text() == "whole"
    assert list(page.parent.iterdir()) == [page]


def test_a_new_file_has_the_usual_permissions(page):
    (page.parent / "usual").touch()
    modes = [stat.S_IMODE(path.stat().st_mode) for path in page.parent.iterdir()]
    assert modes[0] == modes[1]


@pytest.mark.parametrize("failure", [KeyboardInterrupt("mine"), PermissionError(13, "mine")])
def test_a_failed_writer_leaves_the_old_file_alone(page, failure):
    def interrupted():
        with atomic_write(page) as new:
            new.write_text("half")
            raise failure

    with pytest.raises(type(failure)):
        interrupted()
    assert page.read_text() == "old"
    assert list(page.parent.iterdir()) == [page]


def test_a_killed_writer_leaves_the_old_file(page):
    done = subprocess.run([sys.executable, "-c", KILLED, str(page)], cwd=ROOT, check=False)
    assert done.returncode == -signal.SIGKILL
    assert page.read_text() == "old"
    write_text(page, "new")
    (left,) = set(page.parent.iterdir()) - {page}
    assert left.read_text() == "half", "it may be that of a running writer"
    os.utime(left, times=(0, time.time() - 90_000))
    for name in ("page.txt", "another.md"):
        write_text(page.with_name(name), "of another file")
        assert left.exists()
    write_text(page, "newer")
    assert not left.exists()
    assert page.read_text() == "newer"


def test_concurrent_writers_leave_one_whole_file(tmp_path):
    path, texts = tmp_path / "page.md", [letter * 1_000_000 for letter in "abcdefgh"]
    with ThreadPoolExecutor(len(texts)) as pool:
        list(pool.map(partial(write_text, path), texts))
    assert path.read_text() in texts
    assert list(tmp_path.iterdir()) == [path]


def test_a_link_is_replaced_and_not_followed(tmp_path):
    target, link = tmp_path / "precious.md", tmp_path / "page.md"
    target.write_text("precious")
    link.symlink_to(target)
    write_text(link, "new")
    assert (link.read_text(), link.is_symlink()) == ("new", False)
    assert target.read_text() == "precious"


def test_a_full_disk_is_an_output_error_that_keeps_the_file(page):
    with small_files(40), pytest.raises(OutputError) as full:
        write_text(page, "new" * 100)
    assert full.value.path == page
    assert page.read_text() == "old"
    assert list(page.parent.iterdir()) == [page]


@pytest.mark.parametrize("folder", [False, True, None])
def test_checking_an_output_changes_nothing(folder, tmp_path):
    check_output(tmp_path / "new" / "below", folder)
    (tmp_path / "old").touch() if folder is False else (tmp_path / "old").mkdir()
    check_output(tmp_path / "old", folder)
    assert os.listdir(tmp_path) == ["old"]


@pytest.mark.parametrize("output", ["", "pipe", "file/below.json", "a" * 300, "a\0b"])
def test_an_output_that_cannot_be_written_is_refused(output, tmp_path):
    (tmp_path / "file").touch()
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OutputError):
        check_output(tmp_path / output)
    assert sorted(os.listdir(tmp_path)) == ["file", "pipe"]


# Reading


def load_place(path):
    pedpred.OnlinePredictor.load().load_place(path)


READERS = {
    "map": read_ground_at,
    "recording": open_scene,
    "model": pedpred.OnlinePredictor.load,
    "learned place": load_place,
    "bag": read_bag,
}


@pytest.mark.parametrize("read", READERS.values(), ids=READERS)
def test_a_missing_input_is_named_whatever_its_suffix(read, tmp_path):
    for name in ("nowhere", "nowhere.yaml", "nowhere.wkt"):
        with unread(tmp_path / name):
            read(tmp_path / name)


def test_folders_files_and_pipes_are_not_exchanged(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    file = Path(default_model()) / "model.json"
    for read, path in ((load_place, tmp_path), (READERS["model"], file), (check_input, tmp_path / "pipe")):
        with unread(path):
            read(path)


def test_an_error_of_a_decoder_keeps_its_cause(tmp_path):
    with (
        pytest.raises(InputError) as error,
        translate_errors(partial(InputError, tmp_path, "x")),
    ):
        (tmp_path / "none").read_bytes()
    assert (error.value.path, error.value.where) == (tmp_path, "x")
    assert isinstance(error.value.__cause__, FileNotFoundError)


def test_a_file_is_read_up_to_its_largest_size(page):
    assert read_bytes(page, 3) == b"old"
    with pytest.raises(ValueRuleError):
        read_bytes(page, 2)
