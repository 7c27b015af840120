"""When the ROS node publishes what: for subscribers, viewers and costmaps, and when people have gone."""

from dataclasses import replace

import pytest

from pedpred.ros.scene_messages import header
from pedpred.ros2.outputs import MARKERS, output_types
from pedpred.ros2.settings import NodeSettings
from tests.following import answered, contents, follower_of, people, seen


def test_outputs_are_emptied_once_people_have_gone():
    """Trackers may be silent when there are no people, or end; a simulation that pauses changes nothing."""
    follower = follower_of(occupancy_cell_m=0.5)
    assert list(follower.clear_outputs(10**12)) == []
    for k in range(5):
        clock_ns = 10**11 + k * 10**8
        assert answered(follower, people(5.0 + k / 10, **{"7": (2.0, 1.0)}), k / 10, clock_ns)
        assert list(follower.clear_outputs(clock_ns + 29 * 10**8)) == []
    published = contents(follower.clear_outputs(10**11 + 34 * 10**8))
    assert published.keys() == output_types(follower.settings, 10).keys() - {"predictions/names"}
    assert not published["predicted_occupancy/horizon"]["data"].any()
    assert len(published[MARKERS]["markers"]) == 1  # delete all
    assert (published["predictions"]["width"], follower.counts.people) == (0, 0)
    assert published["predictions"]["header"] == header(8_400_000_000)
    assert list(follower.clear_outputs(10**12)) == []  # once
    assert seen(answered(follower, people(6.0, **{"7": (2.0, 1.0)}))).keys() == {"7"}
    assert contents(follower.clear_outputs(10**9, 0.0)).keys() == published.keys()  # the node ends


@pytest.mark.parametrize("clock_s", [0, 1000])
def test_empty_outputs_have_the_stamp_of_now(clock_s):
    """Wherever the clock has jumped since, as in a simulation that begins again; stamps are 3 s behind it."""
    follower = follower_of()
    assert answered(follower, people(97.0, anna=(1.0, 0.0)), 0.0, 100 * 10**9)
    published = contents(follower.clear_outputs(clock_s * 10**9))
    stamp = {"sec": max(clock_s - 3, 0), "nanosec": 0}  # none is before 0, which readers refuse
    assert published["predictions"]["header"]["stamp"] == stamp
    assert published[MARKERS]["markers"][0]["header"]["stamp"] == stamp


# Subscribers


def test_messages_without_subscribers_are_not_made():
    """But for the forecasts themselves: they are kept for later subscribers."""
    topics = set()
    follower = follower_of(topics.__contains__, occupancy_cell_m=0.5)
    assert answered(follower, people(5.0, **{"7": (2.0, 1.0)})).keys() == {"predictions"}
    topics |= {"predictions/people", "predicted_occupancy/step_3"}
    assert answered(follower, people(5.1, **{"7": (2.0, 1.1)})).keys() == {"predictions"} | topics


@pytest.mark.parametrize("end", ["no subscribers", "switched off"])
def test_no_latched_topic_keeps_people_who_are_gone(end):
    """Later subscribers are sent the last message, also of a topic that had no subscribers meanwhile."""
    topics = {*output_types(NodeSettings(occupancy_cell_m=0.5), 10)}
    follower = follower_of(topics.__contains__, occupancy_cell_m=0.5)
    last = answered(follower, people(5.0, **{"7": (20.0, 1.0)}))
    shown = last["predicted_occupancy/horizon"]
    assert shown["data"].any()
    if end == "no subscribers":
        topics.clear()
        last |= contents(follower.clear_outputs(10**9, 0.0))
    else:
        off = {"occupancy_cell_m": 0.0, "publish_markers": False, "publish_people": False}
        follower.settings = replace(follower.settings, **off)
        last |= answered(follower, people(5.1, **{"7": (20.0, 1.0)}))
        assert last["predictions"]["width"]
    assert last["predictions/people"]["people"] == []
    assert len(last[MARKERS]["markers"]) == 1  # delete all
    assert not any(last[topic]["data"].any() for topic in last if topic.startswith("predicted_occupancy"))
    assert last["predicted_occupancy/horizon"]["info"]["origin"] == shown["info"]["origin"]
    assert answered(follower, people(5.2)).keys() <= {"predictions", *topics}  # once


def test_that_all_have_gone_is_shown_at_once():
    follower, here = follower_of(occupancy_cell_m=0.5, max_age_s=0.0), {"7": (2.0, 1.0)}
    for at_s, places, shown in ((7.0, here, True), (7.02, {}, True), (7.04, {}, False), (7.06, here, False)):
        published = answered(follower, people(at_s, **places))
        assert (MARKERS in published, "predicted_occupancy/horizon" in published) == (shown, shown)


@pytest.mark.parametrize(("step_s", "least", "most"), [(0.02, 9, 13), (0.099, 50, 50)])
def test_markers_and_grids_come_at_most_at_12_hz(step_s, least, most):
    """Viewers need no more: at 50 Hz, about every tenth of a second; at 10 Hz each time."""
    follower = follower_of(occupancy_cell_m=0.5)
    found = [answered(follower, people(5.0 + k * step_s, **{"7": (2.0, 1.0)})).keys() for k in range(50)]
    assert all({"predictions", "predictions/people"} <= topics for topics in found)
    for topic in (MARKERS, "predicted_occupancy/horizon"):
        assert least <= sum(topic in topics for topics in found) <= most


def test_viewers_and_costmaps_take_at_most_half_of_the_time():
    now_s = 0.0

    def slow(topic):
        nonlocal now_s
        now_s += 0.5 * (topic == MARKERS)  # as if markers took half a second
        return True

    follower, shown = follower_of(slow, lambda: now_s), []
    for k in range(20):
        shown.append(MARKERS in answered(follower, people(5.0 + k / 10, **{"7": (2.0, 1.0)})))
        now_s += 0.125
    assert shown == ([True] + 3 * [False]) * 5


# Maps and grids


def test_without_a_map_there_are_no_grids(caplog):
    follower = follower_of()
    follower.settings = replace(follower.settings, occupancy_cell_m=0.5)
    assert answered(follower, people(1.0, eve=(1.0, 1.0))).keys() == {
        "predictions",
        "predictions/names",
        "predictions/people",
        MARKERS,
    }
    assert caplog.records


def test_grids_cover_the_map_in_cells_of_at_least_0_1_m():
    follower = follower_of(occupancy_cell_m=0.02)
    info = answered(follower, people(1.0, eve=(1.0, 1.0)))["predicted_occupancy/horizon"]["info"]
    assert info["resolution"] == 0.1
    assert info["width"] * info["resolution"] == pytest.approx(60.0)
