"""Messages of the node beside the published definitions, and by the rules of viewers.

The definitions are those that the wheels of ROS bring (build/ros, see `make ros`). The rules are those by
which RViz (rviz_default_plugins) and the 3D panel of Foxglove leave a message out or warn of it.
"""

from pathlib import Path

import numpy as np
import pytest
from rosbags.typesys import get_types_from_msg

from pedpred.ros.message_types import known_types, serialize
from pedpred.ros2.diagnostics import DIAGNOSTICS_TYPE
from pedpred.ros2.outputs import MARKERS_TYPE, PEOPLE_TYPE, output_types
from pedpred.ros2.settings import NodeSettings
from tests.conftest import with_ros
from tests.following import answered, follower_of, people

SHARE = Path(__file__).parents[1] / "build/ros/share"
CLOUD, FIELD, GRID = "sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/PointField", "nav_msgs/msg/OccupancyGrid"
MARKER = "visualization_msgs/msg/Marker"
PUBLISHED = {*output_types(NodeSettings(occupancy_cell_m=0.5), 10).values(), DIAGNOSTICS_TYPE}
UNPUBLISHED = {PEOPLE_TYPE}
"""Types that no wheel has."""


@pytest.fixture(scope="module")
def messages():
    """Topic -> type and message, as it is on the wire, for three people; markers have numbers of 32 bits."""
    follower = follower_of(occupancy_cell_m=0.5)
    for k in range(2):
        here = {"": (0.1 * k, 0.0), "1": (2.0, 1.0 + 0.1 * k), str(2**32 + 1): (4.0, 1.0)}
        answers = answered(follower, people(5.0 + k / 10, **here))
    types = output_types(follower.settings, 10)
    return {
        topic: (types[topic], known_types().deserialize_cdr(serialize(types[topic], content), types[topic]))
        for topic, content in answers.items()
    }


def inner_types(fields):
    """The names of the types in the fields of a type."""
    for _, (node, about) in fields:
        if node.name == "NAME":
            yield about
        elif node.name in ("ARRAY", "SEQUENCE") and about[0][0].name == "NAME":
            yield about[0][1]


@with_ros
@pytest.mark.parametrize("kind", sorted(PUBLISHED - UNPUBLISHED))
def test_every_field_is_that_of_the_published_definition(kind):
    """Names, types and order, also of the types inside; and every constant is there with its value."""
    waiting, seen = [kind], set()
    while waiting:
        name = waiting.pop()
        package, _, short = name.split("/")
        text = (SHARE / package / "msg" / f"{short}.msg").read_text()
        published, own = get_types_from_msg(text, name)[name], known_types().fielddefs[name]
        assert list(published[1]) == list(own[1]), name
        assert {*map(tuple, own[0])} <= {*map(tuple, published[0])}, name
        seen.add(name)
        waiting += set(inner_types(own[1])) - seen


def test_viewers_find_every_place_of_a_cloud(messages):
    """RViz takes x, y, z as FLOAT32, and no sizes that do not fit; Foxglove wants fields within a point."""
    kind, cloud = messages["predictions"]
    assert kind == CLOUD
    constants = {name: value for name, _, value in known_types().fielddefs[FIELD][0]}
    sizes = {constants[name]: int(name.lstrip("UINTFLOA")) // 8 for name in constants}
    kinds = {field.name: field.datatype for field in cloud.fields}
    assert [kinds[name] for name in "xyz"] == [constants["FLOAT32"]] * 3
    assert len(cloud.data) == cloud.row_step * cloud.height
    assert cloud.row_step == cloud.width * cloud.point_step
    ends = [field.offset + sizes[field.datatype] * field.count for field in cloud.fields]
    assert [0, *ends[:-1]] == [field.offset for field in cloud.fields]
    assert max(ends) <= cloud.point_step
    assert not cloud.is_bigendian
    rows = np.frombuffer(cloud.data.tobytes(), np.uint8).reshape(cloud.width, cloud.point_step)
    assert np.isfinite(rows[:, :12].copy().view("<f4")).all()


def test_viewers_draw_every_marker(messages):
    """RViz refuses two of one namespace and id, markers without size or turn, and lines of one point."""
    kind, array = messages["predictions/markers"]
    assert kind == MARKERS_TYPE
    constants = {name: value for name, _, value in known_types().fielddefs[MARKER][0]}
    first, *markers = array.markers
    assert first.action == constants["DELETEALL"]
    assert len({(one.ns, one.id) for one in markers}) == len(markers) > 0
    assert sum(one.ns == "names" for one in markers) == 3
    for one in array.markers:
        turn = one.pose.orientation
        assert np.isclose(np.linalg.norm([turn.x, turn.y, turn.z, turn.w]), 1.0)
        assert one.header.frame_id == "map"
    for one in markers:
        assert one.action == constants["ADD"]
        assert 0.0 <= one.color.a <= 1.0
        needed = {"LINE_STRIP": "x", "TEXT_VIEW_FACING": "z", "CYLINDER": "xyz"}
        (name,) = (name for name in needed if constants[name] == one.type)
        assert all(getattr(one.scale, axis) > 0 for axis in needed[name])
        if name == "LINE_STRIP":
            assert len(one.points) >= 2
            assert len(one.colors) in (0, len(one.points))
        if name == "TEXT_VIEW_FACING":
            assert one.text


def test_viewers_draw_every_grid(messages):
    """RViz refuses grids without cells, of other sizes than they say, and unturned ones without a turn."""
    grids = [message for kind, message in messages.values() if kind == GRID]
    assert len(grids) == 11
    for grid in grids:
        assert len(grid.data) == grid.info.width * grid.info.height > 0
        assert grid.info.resolution > 0
        assert grid.info.origin.orientation.w == 1.0
        assert ((grid.data >= 0) & (grid.data <= 100)).all()
