"""Bags that do not define their messages, and messages of ROS 1 in MCAP."""

import sqlite3
from contextlib import closing

import pytest

from pedpred.command.recordings import open_scene
from pedpred.errors import InputError
from pedpred.ros import ADAPTERS, read_bag
from pedpred.ros.definitions import EDITIONS
from tests.bags import PEOPLE, Filled, check, stream, write_mcap

WHOLE = [
    (kind, n) for n, edition in enumerate(EDITIONS) for kind in sorted(ADAPTERS) if kind in edition or not n
]


@pytest.mark.parametrize(("kind", "edition"), WHOLE)
@pytest.mark.parametrize("storage", ["mcap", "db3"])
def test_every_type_is_known_where_a_bag_does_not_define_it(kind, edition, storage, tmp_path):
    """In every edition of its package: MCAP with empty schemas, and .db3 as Humble writes them."""
    store, path = Filled(edition), tmp_path / "hall.mcap"
    if storage == "mcap":
        write_mcap(store, path, kind, "cdr", "ros2msg", b"")
    else:
        store.write(tmp_path / "hall", stream(store, kind))
        path = tmp_path / "hall" / "hall.db3"
        with closing(sqlite3.connect(path)) as base:
            base.executescript("DROP TABLE message_definitions; UPDATE schema SET schema_version = 3;")
    if edition == 2 and kind.startswith("vision_msgs"):
        with pytest.raises(InputError, match=r"id = ''.*who is who"):
            open_scene(path)
        return
    check(open_scene(path), (0, 1) if kind.endswith("PoseArray") else (3, 8))


def test_an_empty_definition_among_others_is_none(tmp_path):
    """As rosbag2 writes where a package is not there."""
    store = Filled(0)
    store.write(tmp_path / "hall", stream(store, PEOPLE))
    with closing(sqlite3.connect(tmp_path / "hall" / "hall.db3")) as base:
        base.execute(
            "UPDATE message_definitions SET encoding = 'unknown', encoded_message_definition = '' "
            "WHERE topic_type = ?",
            (PEOPLE,),
        )
        base.commit()
    check(read_bag(tmp_path / "hall"))


@pytest.mark.parametrize("kind", sorted(kind for kind in ADAPTERS if "vision" not in kind))
@pytest.mark.parametrize("defined", [True, False])
def test_messages_of_ros_1_in_mcap_are_read(kind, defined, tmp_path):
    """As `mcap convert` writes."""
    path = write_mcap(
        Filled(0, ros1=True), tmp_path / "hall.mcap", kind, "ros1", "ros1msg", b"yes" if defined else b""
    )
    check(open_scene(path), (0, 1) if kind.endswith("PoseArray") else (3, 8))


def test_another_encoding_is_named(tmp_path):
    path = write_mcap(Filled(0), tmp_path / "hall.mcap", PEOPLE, "json", "jsonschema", b"")
    with pytest.raises(InputError, match=r"no topic carries people, among.*people_msgs/msg/People in json"):
        open_scene(path)
