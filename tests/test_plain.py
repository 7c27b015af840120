"""JSON and YAML are parsed within bounds; messages about any value are short."""

import resource
from functools import partial
from pathlib import Path

import pytest
import yaml

from pedpred.command.prediction import read_tracker
from pedpred.errors import ConfigError, InputError, PedpredError, ValueRuleError
from pedpred.files import read_json
from pedpred.plain import parse_json, parse_yaml
from pedpred.storage.scenes import read_map, write_scene
from tests.refused import unread
from tests.trust.examples import TRACKER, place

LONGEST = 2500  # characters of a message
MOST_MIB = 300


def aliases(depth, entry="[{}]"):
    """Lines of YAML, each of which stands for ten times what the one before stands for."""
    lines = [f"a0: &a0 {entry.format('x' if entry == '[{}]' else '')}"]
    tens = [",".join([f"*a{i - 1}"] * 10) for i in range(1, depth)]
    return "\n".join(lines + [f"a{i}: &a{i} {entry.format(ten)}" for i, ten in enumerate(tens, 1)]) + "\n"


ODD = {  # lines before, and the value
    "many aliases": (aliases(9), "*a8"),
    "inside itself": ("", "&s [*s]"),
    "long list": ("", f"[{'7,' * 300}]"),
    "long text": ("", "y" * 70_000),
    "huge number": ("", "0x" + "f" * 10_000),
    "mapping": ("", "{x: 1}"),
    "nothing": ("", ""),
    "object": ("", "!!python/object/apply:os.getcwd []"),
}
MAP = {"image": "map.pgm", "resolution": "0.1", "origin": "[0, 0, 0]", "negate": "0", "occupied_thresh": "1"}
TRACKED = {name: str(value) for name, value in yaml.safe_load(TRACKER).items() if name != "kind"}
FILES = [
    *(("map.yaml", MAP, field, read_map) for field in MAP),
    *(("tracker.yaml", TRACKED, field, lambda f: read_tracker(f / "tracker.yaml")) for field in TRACKED),
]


@pytest.fixture
def little_memory():
    """Let the process grow by `MOST_MIB` and no more."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + MOST_MIB * 2**20, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_AS, before)


def check(read, folder, what):
    """Read; an error must name the file in few words."""
    message = str(folder)
    try:
        read(folder)
    except PedpredError as error:
        message = str(error)
    assert str(folder) in message, what
    assert len(message) < LONGEST, what
    assert "MemoryError" not in message, what


@pytest.mark.parametrize(("file", "fields", "field", "read"), FILES)
def test_an_odd_value_is_read_or_refused_within_bounds(file, fields, field, read, tmp_path, little_memory):
    write_scene(place(), tmp_path)
    for name, (before, value) in ODD.items():
        lines = [f"{key}: {text}" for key, text in (fields | {field: value}).items()]
        (tmp_path / file).write_text(before + "\n".join(lines))
        check(read, tmp_path, name)


@pytest.mark.parametrize("depth", [6, 60])
def test_aliases_count_as_what_they_stand_for(depth):
    with pytest.raises(ValueError, match="32768 values"):
        parse_yaml(aliases(depth) + f"value: *a{depth - 1}")
    assert parse_yaml(aliases(3) + "value: *a2")["value"] == [[["x"]] * 10] * 10


@pytest.mark.parametrize("parse", [parse_yaml, parse_json])
@pytest.mark.parametrize("text", ['{"a": 1, "a": 2}', '{"x": {"a": 1, "b": 2, "a": 1}}'])
def test_a_key_that_is_there_twice_is_named(parse, text):
    with pytest.raises(ValueError, match="a'"):
        parse(text)


def test_json_outside_the_standard_is_refused_by_file(tmp_path):
    path, deep = tmp_path / "x.json", '{"a":' * 9_000
    for text in ('{"a": NaN}', '{"a": -Infinity}', '{"a": ' + "9" * 10_000 + "}", deep):
        path.write_text(text)
        with unread(path):
            read_json(path, partial(InputError, path, "file"))


# Messages


def test_a_message_is_short_whatever_the_value():
    for value in (dict.fromkeys(range(10**6)), (("x" * 1000,) * 1000,) * 1000):
        for error in (ValueRuleError, ConfigError):
            assert len(str(error("field", value, "it must be less"))) < 600
