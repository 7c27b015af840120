"""dvc.lock after a kill in the middle of its writing."""

from pedpred.config import KEPT, LOCK, keep_lock
from tools.mend_lock import RUNNING, is_whole, main

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
      nfiles: 3
    params:
      params.yaml:
        scenes.eth.clocks: 3
        scenes.eth.label: Zürich
"""


def test_a_lock_that_is_cut_anywhere_becomes_the_copy(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    LOCK.write_text(WHOLE)
    keep_lock(tmp_path)
    written = WHOLE.encode()
    assert len(written) > len(WHOLE)
    for at in range(len(written)):
        LOCK.write_bytes(written[:at])
        if is_whole(LOCK):  # the end of a line may look like the end
            assert written[at - 1 : at] == b"\n"
        else:
            keep_lock(tmp_path)  # as a stage does that starts in that moment
            KEPT.write_text(WHOLE)
            main()
            assert LOCK.read_text() == KEPT.read_text() == WHOLE


def test_a_stage_keeps_the_lock_that_it_finds(tmp_path):
    keep_lock(tmp_path)
    assert not (tmp_path / KEPT).exists()
    (tmp_path / LOCK).write_text(WHOLE)
    keep_lock(tmp_path)
    assert (tmp_path / KEPT).read_text() == WHOLE
    (tmp_path / LOCK).write_text(WHOLE[:-9])  # as while another `dvc repro` writes it
    keep_lock(tmp_path)
    assert (tmp_path / KEPT).read_text() == WHOLE


def test_a_cut_note_of_who_writes_is_forgotten(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    RUNNING.parent.mkdir(parents=True)
    note = '{"write": {"data": {"pid": 7, "cmd": "dvc repro"}}, "read": {}}'
    RUNNING.write_text(note)
    main()
    assert RUNNING.read_text() == note
    RUNNING.write_text(note[:-9])
    main()
    assert not RUNNING.exists()
