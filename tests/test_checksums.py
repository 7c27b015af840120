"""Checksums of results: the same, different, lost, or never there."""

import pandas as pd
import pytest

from tools import checksums


def compared(monkeypatch, folder, *options):
    monkeypatch.setattr("sys.argv", ["checksums", str(folder), *options])
    with pytest.raises(SystemExit) as ended:
        checksums.main()
    return ended.value.code


def project(folder, **files):
    for name, content in files.items():
        (folder / "models").mkdir(parents=True, exist_ok=True)
        (folder / "models" / name).write_text(content)
    return folder


@pytest.mark.parametrize(
    ("files", "fails"),
    [
        ({"one": "1", "other": "2"}, False),
        ({"one": "1", "other": "2", "new": "3"}, False),
        ({"one": "1", "other": "3"}, True),
        ({"one": "1"}, True),
    ],
    ids=["same", "new", "different", "lost"],
)
def test_results_must_be_there_and_the_same(tmp_path, monkeypatch, files, fails):
    before = checksums.checksums(project(tmp_path / "before", one="1", other="2"))
    listed = tmp_path / "before.txt"
    listed.write_text("".join(f"{digest} {name}\n" for name, digest in before.items()))
    now = project(tmp_path / "now", **files)
    assert compared(monkeypatch, now, "--against", str(listed)) == fails


def test_a_folder_without_results_and_a_missing_list_are_named(tmp_path, monkeypatch):
    assert f"{tmp_path}/nowhere: there are no results" in compared(monkeypatch, tmp_path / "nowhere")
    now = project(tmp_path / "now", one="1")
    assert f"{tmp_path}/none" in compared(monkeypatch, now, "--against", str(tmp_path / "none"))


@pytest.mark.parametrize(
    ("text", "problem"), [("", "it has no lines"), ("no results\n", ", line 1: it is no")]
)
def test_what_no_earlier_call_has_printed_is_compared_with_nothing(tmp_path, monkeypatch, text, problem):
    """As after a call that failed with its output in a file."""
    (tmp_path / "list").write_text(text)
    now = project(tmp_path / "now", one="1")
    assert problem in compared(monkeypatch, now, "--against", str(tmp_path / "list"))


def test_columns_that_are_no_numbers_have_the_checksum_of_what_they_say(tmp_path):
    columns = {"text": ["a", "b"], "gaps": [True, None], "lists": [[1], [2, 3]], "bytes": [b"a", b"bc"]}
    digests = []
    for name in ("one", "other", "changed"):
        (tmp_path / name / "data").mkdir(parents=True)
        table = {key: [*values, values[name == "changed"]] for key, values in columns.items()}
        pd.DataFrame(table).to_parquet(tmp_path / name / "data" / "table.parquet")
        digests.append(checksums.checksums(tmp_path / name))
    assert digests[0] == digests[1]
    assert all(digests[0][key] != digests[2][key] for key in digests[0])


def test_results_lie_in_a_folder_of_any_name(tmp_path):
    plain, named = (project(tmp_path / name, **{"about.list.json": "[1]"}) for name in ("plain", "metrics"))
    assert checksums.checksums(named) == checksums.checksums(plain)
