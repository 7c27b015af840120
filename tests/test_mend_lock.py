"""dvc.lock after a kill in the middle of its writing."""

from pedpred.config import KEPT, LOCK, keep_lock
from tools.mend_lock import RUNNING, is_whole, main

WHOLE = """\
schema: '2.0'
stages:
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
    for at in range(len(written)):
        LOCK.write_bytes(written[:at])
        if is_whole(LOCK):  # the end of a line may look like the end
            assert written[at - 1 : at] == b"\n"
        else:
            keep_lock(tmp_path)  # as a stage does that starts in that moment
            KEPT.write_text(WHOLE)
            main()
            assert LOCK.read_text() == KEPT.read_text() == WHOLE


def test_cut_note_of_who_writes_is_forgotten(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    RUNNING.parent.mkdir(parents=True)
    note = '{"write": {"data": {"pid": 7, "cmd": "dvc repro"}}, "read": {}}'
    for text, stays in ((note, True), (note[:-9], False)):
        RUNNING.write_text(text)
        main()
        assert RUNNING.exists() is stays
