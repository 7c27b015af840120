"""Checksums of results depend on what files hold, not on how they are stored."""

import pandas as pd

from tools.checksums import checksums


def test_columns_have_the_checksum_of_their_values(tmp_path):
    columns = {"text": ["a", "b"], "gaps": [True, None], "lists": [[1], [2, 3]], "bytes": [b"a", b"bc"]}
    digests = []
    for name in ("one", "other", "changed"):
        (tmp_path / name / "data").mkdir(parents=True)
        table = {key: [*values, values[name == "changed"]] for key, values in columns.items()}
        pd.DataFrame(table).to_parquet(tmp_path / name / "data" / "table.parquet")
        digests.append(dict(checksums(tmp_path / name)))
    assert digests[0] == digests[1]
    assert len(digests[0]) == len(columns)
    assert all(digests[0][key] != digests[2][key] for key in digests[0])


def test_results_lie_in_a_folder_of_any_name(tmp_path):
    for name in ("plain", "metrics"):
        (tmp_path / name / "models").mkdir(parents=True)
        (tmp_path / name / "models" / "list.json").write_text("[1]")
    assert dict(checksums(tmp_path / "plain")) == dict(checksums(tmp_path / "metrics")) != {}
