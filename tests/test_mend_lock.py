"""dvc.lock after a kill in the middle of its writing."""

from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from stages.mend_lock import LOCK, accepted, main, mended

WHOLE = """\
schema: '2.0'
stages:
  config:
    cmd: python -m pedpred.config --check
    outs:
    - path: data/config.checked
      hash: md5
      md5: d41d8cd98f00b204e9800998ecf8427e
      size: 0
  features@eth:
    cmd: python -m stages.features +name=eth
    deps:
    - path: data/scenes/eth
      hash: md5
      md5: 9c0e3de43a5a1a7a5b3d0d4a0c5a1c11.dir
      size: 1024
      nfiles: 3
    params:
      params.yaml:
        scenes.eth.clocks: 3
    outs:
    - path: data/features/eth
      hash: md5
      md5: 1b2cf535f27731c974343645a3985328.dir
      size: 2048
      nfiles: 2
"""


@given(st.integers(0, len(WHOLE)))
def test_a_lock_that_is_cut_anywhere_keeps_its_whole_entries(at):
    kept = mended(WHOLE[:at])
    assert WHOLE.startswith(kept)
    entries = list(((accepted(kept) or {}) if kept else {}).get("stages", {}).items())
    assert entries[:-1] == list(accepted(WHOLE)["stages"].items())[: len(entries)][:-1]
    if WHOLE[:at].count("features@eth:\n"):
        assert entries


def test_a_whole_lock_stays_as_it_is(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    main()
    assert not LOCK.exists()
    LOCK.write_text(WHOLE)
    main()
    assert Path("dvc.lock").read_text() == WHOLE


def test_a_cut_lock_is_mended_in_place_and_an_empty_one_is_gone(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    LOCK.write_text(WHOLE[: WHOLE.index("data/features/eth")])
    main()
    assert LOCK.read_text() == WHOLE[: WHOLE.index("  features@eth")]
    LOCK.write_text("schema")
    main()
    assert not LOCK.exists()
