"""State of the ROS node: its map, diagnostics, parameters, file of the place and log."""

import logging
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pedpred.errors import PedpredError
from pedpred.ros.message_types import UPDATE_TYPE, serialize
from pedpred.ros.scene_messages import header
from pedpred.ros2.counts import Counts
from pedpred.ros2.diagnostics import OK, WARN, diagnose
from pedpred.ros2.log import RosHandler, guarded
from pedpred.ros2.settings import LIVE, PARAMETERS, NodeSettings, unchangeable
from tests.bags import PEOPLE
from tests.following import answered, follower_of, grid, people
from tests.refused import refused

BOXES = "vision_msgs/msg/Detection3DArray"


# The map


def update(x, y, values, frame="map"):
    height, width = np.shape(values)
    content = {"header": header(0, frame), "data": np.asarray(values, np.int8).ravel()}
    return serialize(UPDATE_TYPE, content | {"x": x, "y": y, "width": width, "height": height})


def test_forecasts_are_in_the_frame_of_the_map():
    """A map in another frame begins anew; one without a frame is where forecasts are."""
    follower = follower_of(use_map=True, map_frame="/hall")
    for k, frame in enumerate(("hall", "world")):
        follower.take_map(grid(np.full((5, 4), 100), frame=frame if k else ""))
        published = answered(follower, people(1.0 + k, frame, anna=(1.0, 0.0)))
        assert published["predictions"]["header"]["frame_id"] == frame
        assert follower.map.text == "4 x 5 cells, 100.0 % blocked"


def test_an_update_changes_the_map_or_is_refused():
    """As if the map had come whole, also where it is turned."""
    cells, part, yaw_rad = np.zeros((6, 8), np.int8), np.full((2, 3), 100), 0.5
    follower, plain = follower_of(use_map=True), follower_of(use_map=True)
    follower.take_map_update(update(0, 0, part))
    assert follower.map.occupancy is None
    follower.take_map(grid(cells, yaw_rad))
    follower.take_map_update(update(4, 1, part))
    cells[1:3, 4:7] = 100
    plain.take_map(grid(cells, yaw_rad))
    for take, odd in (
        (follower.take_map_update, update(6, 1, part)),
        (follower.take_map, grid(cells, resolution=0.0)),
    ):
        with pytest.raises(PedpredError):
            take(odd)
        np.testing.assert_array_equal(follower.map.occupancy.occupied, plain.map.occupancy.occupied)
    before = follower.map.occupancy
    follower.take_map_update(update(4, 1, part - 1))
    assert follower.map.occupancy is before  # what blocks is the same
    follower.take_map(grid(0 * cells, yaw_rad))  # the same bytes as at first
    assert not follower.map.occupancy.occupied.any()


@given(st.lists(st.sampled_from(["free", "blocked", "update"]), max_size=8))
@settings(max_examples=10)
def test_a_map_that_comes_twice_is_one_map(events):
    """Two subscriptions receive a latched map, and other messages may come between the copies."""
    doubled, plain = follower_of(use_map=True), follower_of(use_map=True)
    maps = {name: grid(np.full((5, 4), value)) for name, value in (("free", 0), ("blocked", 100))}
    for sent_ns, event in enumerate(("free", *events), start=1):
        if event != "update":
            last = maps[event], sent_ns
        for follower in (doubled, plain):
            if event == "update":
                follower.take_map_update(update(1, 1, [[100, 0]]))
            else:
                follower.take_map(*last)
        doubled.take_map(*last)
        np.testing.assert_array_equal(doubled.map.occupancy.occupied, plain.map.occupancy.occupied)


# Diagnostics


def diagnosed(follower, now_s=0.0, kinds=(PEOPLE,), before=None, **more):
    return diagnose(follower, now_s, kinds, before or Counts(), **more)


def test_a_sound_stream_is_ok_and_what_is_wrong_is_not():
    follower = follower_of()
    answered(follower, people(1.0, anna=(1.0, 0.0)))
    assert diagnosed(follower, latency_ms=250.0)[0] == OK
    for known, named in (
        ({"kinds": []}, ""),
        ({"now_s": 9.0}, ""),
        ({"now_s": 9.0, "kinds": [PEOPLE, BOXES]}, "people_type"),
        ({"latency_ms": 1700.0}, "1700 ms"),
        ({"clock_ns": 0}, "use_sim_time"),
        ({"rivals": 1}, "namespace"),
    ):
        level, text = diagnosed(follower, **known)
        assert level == WARN
        assert named in text


@pytest.mark.parametrize("age_s", [9.0, -5.0])
def test_stamps_of_another_clock_are_a_warning(age_s):
    follower = follower_of()
    answered(follower, people(60.0, anna=(1.0, 0.0)), 0.0, round((60.0 + age_s) * 1e9))
    assert diagnosed(follower)[0] == WARN
    assert f"{age_s:.1f} s" not in diagnosed(follower, clock_ns=0)[1]  # without a clock it says nothing


def test_no_map_and_a_frame_that_moves_are_a_warning():
    follower = follower_of(use_map=True, map_frame="robot1/base_link")
    answered(follower, people(1.0, "robot1/base_link", anna=(1.0, 0.0)))
    level, text = diagnosed(follower)
    assert (level, "map_frame" in text) == (WARN, True)
    follower.take_map(grid(np.zeros((5, 4))))
    answered(follower, people(1.1, anna=(1.0, 0.0)))
    assert diagnosed(follower) == (OK, "forecasts with map")


def test_messages_without_forecasts_are_a_warning():
    """As where all stamps are the same."""
    follower = follower_of()
    for k in range(50):
        answered(follower, people(1.0), k / 10)
    assert diagnosed(follower, 4.9)[0] == WARN
    assert follower.counts.late == follower.counts.left_out == 49


def test_two_clocks_are_a_warning_while_time_jumps():
    follower = follower_of()
    for k in range(10):
        answered(follower, people((1.0 if k % 2 else 1000.0) + k / 10, anna=(1.0, 0.0)), k / 10)
    assert diagnosed(follower, 1.0)[0] == WARN
    assert diagnosed(follower, 1.0, before=replace(follower.counts))[0] == OK


def test_no_detection_of_a_chosen_class_is_a_warning():
    """One of such a class ends it; only these are forecast."""
    follower = follower_of(people_type=BOXES, class_ids=("0",))
    for k, (label, level) in enumerate((("person", WARN), ("0", OK), ("person", OK))):
        box = {"id": "1", "results": [{"hypothesis": {"class_id": label}}]}
        stamp = header(10**9 + k * 10**8, "map")
        answered(follower, serialize(BOXES, {"header": stamp, "detections": [box]}))
        found, text = diagnosed(follower)
        assert (found, "class_ids" in text) == (level, level == WARN)
    assert (follower.counts.detections, follower.counts.others) == (1, 2)


# Parameters


def test_parameters_that_mean_nothing_are_refused():
    for field, wrong in (
        ("people_type", {"people_type": "my_msgs/msg/Tracks"}),
        ("people_type", {"people_type": "tracks", "people_fields": "tracks,position=position"}),
        ("people", {"people_fields": "tracks"}),
        ("identities", {"identities": "x"}),
        ("map_frame", {"map_frame": "/"}),
    ):
        with refused(field):
            NodeSettings(**wrong)


def test_the_same_value_again_is_no_change():
    """`ros2 param load` sets all parameters of a file, in whatever state the node is."""
    used = NodeSettings(max_age_s=1.0)
    again = {name: getattr(used, name) for name in PARAMETERS}
    again |= {"class_ids": list(used.class_ids), "occupancy_cell_m": 0.5}
    assert {"transform_timeout_s", "occupancy_cell_m"} <= LIVE
    assert unchangeable(again, used) == []
    other = {"max_age_s": 0.5, "class_ids": ["dog"], "use_map": False, "publish_markers": False}
    assert unchangeable(again | other, used) == ["class_ids", "max_age_s", "use_map"]


# The file of the place


def test_what_was_learned_is_kept_and_damage_renamed(tmp_path, caplog, monkeypatch):
    """Here in the home folder; without a name nothing is written."""
    monkeypatch.setenv("HOME", str(tmp_path))
    path = tmp_path / "hall.json"
    follower_of().save_place()
    assert not list(tmp_path.iterdir())
    follower_of(place_file="~/hall.json").save_place()
    written = path.read_bytes()
    for raw, level in ((written, logging.INFO), (written[:-20], logging.WARNING)):
        path.write_bytes(raw)
        caplog.clear()
        again = follower_of(place_file="~/hall.json")
        with caplog.at_level("INFO"):
            again.load_place()
        assert level in {record.levelno for record in caplog.records}
        again.save_place()
        assert path.read_bytes() == written
    assert (tmp_path / "hall.json.unused").read_bytes() == written[:-20]


# The log


def test_errors_in_callbacks_are_logged_and_end_nothing(tmp_path, caplog):
    follower = follower_of(place_file=str(tmp_path))
    guarded("left out", follower.save_place)()
    for raw in (b"?", None):
        guarded("left out", follower.take_map)(raw)
    assert [record.levelno for record in caplog.records] == [logging.ERROR] * 3


class Kept:
    """A logger of rclpy that keeps its texts."""

    def __init__(self):
        self.texts = []

    def error(self, text):
        """Keep a text."""
        self.texts.append(text)

    warning = info = error


def test_kinds_of_errors_do_not_hide_each_other():
    kept = Kept()
    handler, log = RosHandler(kept), logging.Logger("node")
    log.addHandler(handler)
    for k in range(300):
        log.error("left out: %s", k, extra={"kind": ("people", "ValueRuleError", "id")})
        log.error("left out: %s", k, extra={"kind": ("map", "ValueRuleError", "data")})
        log.warning("another wording")
    assert kept.texts == ["left out: 0", "left out: 0", "another wording"]
