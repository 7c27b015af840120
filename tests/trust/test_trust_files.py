"""Foreign files are read right or refused by name; the short version of `make trust`."""

import numpy as np
import pytest
from PIL import Image

from pedpred.errors import InputError
from pedpred.files import MOST_PIXELS
from pedpred.reading import FORMATS, format_of
from pedpred.reading.options import ReadOptions
from pedpred.sources import SOURCES
from pedpred.storage.scenes import read_map, read_scene, write_scene
from tests.field_formats import WRITERS
from tests.trust.examples import place
from tests.trust.mutations import mutate
from tests.trust.readers import READERS, Reader
from tests.trust.trial import LOST, REFUSED, Bench, judged

USUAL, FEW = 10, {"conf": 4, "archive": 6, "data archive": 4}  # trials: the readers of `FEW` take long
ELSEWHERE = b"""
image: ../map.pgm
resolution: 0.1
origin: [0, 0, 0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.25
"""
CUTS = {
    "empty": lambda raw: b"",
    "zeros": lambda raw: bytes(len(raw)),
    "cut": lambda raw: raw[: len(raw) // 2],
    "cut, then zeros": lambda raw: raw[: len(raw) // 2] + bytes(len(raw) - len(raw) // 2),
}
"""What a system keeps of a file after a power cut."""


@pytest.mark.parametrize("name", READERS)
def test_a_damaged_file_is_read_right_or_refused_by_name(name, tmp_path):
    bench = Bench(name, READERS[name], tmp_path)
    outcomes = {str(seed): bench.trial(seed) for seed in range(FEW.get(name, USUAL))}
    for file, raw in bench.intact.items():
        outcomes |= {f"{file}, {kind}": bench.with_content(file, cut(raw)) for kind, cut in CUTS.items()}
    assert {damage: why for damage, (outcome, why) in outcomes.items() if outcome == LOST} == {}


def test_every_format_of_single_files_is_tried(tmp_path):
    assert set(SOURCES) <= set(READERS)
    tried = {name for reader in READERS.values() for name in reader.files}
    written = [write(tmp_path) for write in WRITERS.values()]
    assert {path.name for path in written} <= tried
    assert {reader.NAME for reader in FORMATS} == {format_of(path, ReadOptions()).NAME for path in written}


def test_damage_of_a_seed_is_reproducible():
    """As `python -m tests.trust.campaign --replay` needs it."""
    raw = b'{"a": [1, 2.5], "b": {"c": "x"}}'
    once, again = ([mutate(raw, "x.json", np.random.default_rng(seed)) for seed in range(99)] for _ in "ab")
    assert once == again
    assert len(set(once)) > 50


# Bombs


@pytest.fixture
def folder(tmp_path):
    write_scene(place(), tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("file", "content", "named"),
    [
        ("map.pgm", b"P5\n10000 8000\n255\n", f"at most {MOST_PIXELS} pixels"),
        ("map.pgm", b"P5\n8000 8000\n255\n", "map.pgm"),  # allowed, but nothing follows
        ("map.yaml", ELSEWHERE, "beside map.yaml"),
        ("map.yaml", b"image: !!python/object/apply:os.getcwd []\n", "map.yaml"),
        ("map.yaml", b"[" * 2_000, "map.yaml"),
        ("map.yaml", b"a: 1\n" * 100_000, "at most"),
        ("scene.json", b'{"schema":' * 100_000, "scene.json"),
        ("scene.json", b" " * 2**23, "at most"),
        ("map.pgm", b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n", "map.pgm"),  # for Ghostscript
    ],
)
def test_a_bomb_is_refused_by_name(folder, file, content, named):
    (folder / file).write_bytes(content)
    outcome, why = judged(Reader(lambda folder: None, (file,), read_scene), folder)
    assert outcome == REFUSED
    assert named in why


def test_map_beyond_the_largest_is_refused_before_it_is_decoded(folder, monkeypatch):
    monkeypatch.setattr(Image.Image, "convert", lambda *_: pytest.fail("it was decoded"))
    (folder / "map.pgm").write_bytes(b"P5\n40000 25000\n255\n")
    with pytest.raises(InputError):
        read_map(folder)
