"""Texts of a few hundred bytes that stand for more than the memory holds, and messages about any value."""

import json
import resource
import sys
from functools import partial
from pathlib import Path

import pytest
import yaml

from pedpred.command.prediction import read_tracker
from pedpred.errors import ConfigError, InputError, PedpredError, ValueRuleError, brief
from pedpred.files import read_json
from pedpred.plain import parse_yaml
from pedpred.ros import read_bag
from pedpred.storage.scenes import read_map, read_scene, write_scene
from tests.trust.examples import TRACKER, place

LONGEST = 2500  # characters of a message
MOST_MIB = 300


def aliases(depth, entry="[{}]"):
    """Lines of YAML, each of which stands for ten times what the one before stands for."""
    lines = [f"a0: &a0 {entry.format('x' if entry == '[{}]' else '')}"]
    tens = [",".join([f"*a{i - 1}"] * 10) for i in range(1, depth)]
    return "\n".join(lines + [f"a{i}: &a{i} {entry.format(ten)}" for i, ten in enumerate(tens, 1)]) + "\n"


ODD = {  # lines before, and the value
    "aliases": (aliases(4), "*a3"),
    "many aliases": (aliases(9), "*a8"),
    "too many aliases": (aliases(60), "*a59"),
    "merged mappings": (aliases(9, "{{<<: [{}], x: 1}}"), "*a8"),
    "inside itself": ("", "&s [*s]"),
    "deep": ("", "[" * 35 + "]" * 35),
    "too deep": ("", "[" * 900 + "]" * 900),
    "long list": ("", f"[{'7,' * 300}]"),
    "text": ("", "y" * 10_000),
    "too long a text": ("", "y" * 70_000),
    "huge number": ("", "9" * 10_000),
    "huge number, base 16": ("", "0x" + "f" * 10_000),
    "huge number, base 60": ("", "59:" * 3_000 + "59"),
    "no number": ("", ".nan"),
    "without end": ("", ".inf"),
    "time": ("", "2001-12-14t21:59:43.10-05:00"),
    "no time": ("", "2001-99-99"),
    "bytes": ("", "!!binary " + "AAAA" * 2_500),
    "set": ("", "!!set {x, y}"),
    "pairs": ("", "!!omap [x: 1, y: 2]"),
    "mapping": ("", "{x: 1}"),
    "nothing": ("", ""),
    "object": ("", "!!python/object/apply:os.getcwd []"),
}
MAP = {"image": "map.pgm", "resolution": "0.1", "origin": "[0, 0, {}]", "negate": "0", "occupied_thresh": "1"}
BAG = {"storage_identifier": "mcap", "compression_mode": "''", "relative_file_paths": "[a.mcap]"}
TRACKED = {name: str(value) for name, value in yaml.safe_load(TRACKER).items() if name != "kind"}


def map_with(field, value):
    fields = MAP | ({} if field == "yaw" else {field: value})
    yaw = value if field == "yaw" else "0"
    return "".join(f"{name}: {text.replace('{}', yaw)}\n" for name, text in fields.items())


def tracker_with(field, value):
    return "".join(f"{name}: {text}\n" for name, text in (TRACKED | {field: value}).items())


def bag_with(field, value):
    return "rosbag2_bagfile_information:\n" + "".join(
        f"  {k}: {v}\n" for k, v in (BAG | {field: value}).items()
    )


FILES = [
    *((map_with, field, "map.yaml", read_map) for field in (*MAP, "yaw")),
    *((tracker_with, field, "tracker.yaml", lambda f: read_tracker(f / "tracker.yaml")) for field in TRACKED),
    *((bag_with, field, "metadata.yaml", read_bag) for field in BAG),
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


@pytest.mark.parametrize(("text", "field", "file", "read"), FILES)
def test_an_odd_value_is_read_or_refused_by_name_within_bounds(
    text, field, file, read, tmp_path, little_memory
):
    write_scene(place(), tmp_path)
    for name, (before, value) in ODD.items():
        (tmp_path / file).write_text(before + text(field, value))
        check(read, tmp_path, name)


@pytest.mark.parametrize("value", ["*a3", "*a8", "*a59"])
def test_aliases_count_as_what_they_stand_for(value):
    depth = int(value[2:]) + 1
    with pytest.raises(ValueError, match=r"line .: more than 32768 values"):
        parse_yaml(aliases(max(depth, 6)) + f"value: {value if depth > 5 else '*a5'}")
    plain = parse_yaml(aliases(3) + "value: *a2")
    assert plain["value"] == [[["x"]] * 10] * 10


def test_a_long_list_is_refused():
    with pytest.raises(ValueError, match="more than 32768 values"):
        parse_yaml(f"[{'7,' * 60_000}]")


def test_a_usual_alias_and_a_merge_are_read():
    text = "usual: &usual {a: 1, b: 2}\nother: {<<: *usual, b: 3}\nsame: *usual\n"
    assert parse_yaml(text) == yaml.safe_load(text)


@pytest.mark.parametrize("text", ["a: 1\nb: 2\na: 3\n", "x: {a: 1, a: 1}", "{a: 1, 'a': 2}"])
def test_a_key_that_is_there_twice_is_named(text):
    with pytest.raises(ValueError, match=r"the key .*a' is there twice"):
        parse_yaml(text)


@pytest.mark.parametrize(
    "text",
    ['{"a": NaN}', '{"a": -Infinity}', '{"a": 1, "a": 2}', '{"a": ' + "9" * 10_000 + "}", '{"a":' * 9_000],
    ids=["no number", "without end", "twice", "huge number", "deep"],
)
def test_json_of_two_meanings_is_refused_by_name(text, tmp_path):
    (tmp_path / "x.json").write_text(text)
    with pytest.raises(InputError, match=r"x\.json") as refused:
        read_json(tmp_path / "x.json", partial(InputError, tmp_path / "x.json", "file"))
    assert len(str(refused.value)) < LONGEST


@pytest.mark.parametrize("field", ["schema", "name", "detection_dt_s", "homography", "unavailable"])
def test_an_odd_value_of_a_scene_is_read_or_refused_by_name(field, tmp_path):
    write_scene(place(), tmp_path)
    about = json.loads((tmp_path / "scene.json").read_text())
    deep = []
    for _ in range(300):
        deep = [deep]
    for value in (deep, [1] * 500_000, "x" * 2_000_000, 10**4000, 1e308, None, True, {"a": []}):
        (tmp_path / "scene.json").write_text(json.dumps(about | {field: value}))
        check(read_scene, tmp_path, field)


# Messages


def test_a_short_value_is_shown_as_python_writes_it():
    values = [None, True, -3, 2.5, "a'b", b"x", (), (1,), (1, 2), [], [[1], {}], {}, {"a": [1, "b"]}]
    values += [set(), {1}, frozenset(), frozenset({1}), {1: (2, 3), "b": {"c": None}}]
    assert [brief(value) for value in values] == [repr(value) for value in values]


@pytest.mark.parametrize(
    "value",
    [
        [0] * 10**6,
        dict.fromkeys(range(10**6)),
        "x" * 10**7,
        b"x" * 10**7,
        10**100_000,
        (("x" * 1000,) * 1000,) * 1000,
        set(range(10**5)),
    ],
    ids=lambda value: type(value).__name__,
)
@pytest.mark.parametrize("error", [ValueRuleError, ConfigError])
def test_a_message_is_short_whatever_the_value(value, error):
    assert len(str(error("field", value, "it must be less"))) < 600


def test_what_a_message_leaves_out_is_never_looked_at():
    deep = [0]
    for _ in range(60):
        deep = [deep] * 10  # stands for 10^60 numbers
    assert len(brief(deep)) < 600
    deep = []
    for _ in range(2 * sys.getrecursionlimit()):
        deep = [deep]
    assert brief(deep).count("[") < 20
