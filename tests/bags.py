"""Bags of ROS 1 and ROS 2 with people and maps, as tests need them."""

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from rosbags import rosbag1, rosbag2
from scipy.spatial.transform import Rotation

from pedpred.ros.message_types import known_editions
from tests.robots import CAMERA, ODOM, SPEED, STANDING, WALKING, from_robot, robot

GRID, PEOPLE, TF = "nav_msgs/msg/OccupancyGrid", "people_msgs/msg/People", "tf2_msgs/msg/TFMessage"
LISTS = {
    PEOPLE: ("people", "people_msgs/msg/Person"),
    "people_msgs/msg/PositionMeasurementArray": ("people", "people_msgs/msg/PositionMeasurement"),
    "spencer_tracking_msgs/msg/TrackedPersons": ("tracks", "spencer_tracking_msgs/msg/TrackedPerson"),
    "hunav_msgs/msg/Agents": ("agents", "hunav_msgs/msg/Agent"),
    "pedsim_msgs/msg/AgentStates": ("agent_states", "pedsim_msgs/msg/AgentState"),
    "vision_msgs/msg/Detection3DArray": ("detections", "vision_msgs/msg/Detection3D"),
    "geometry_msgs/msg/PoseArray": ("poses", "geometry_msgs/msg/Pose"),
    "leg_tracker/msg/PersonArray": ("people", "leg_tracker/msg/Person"),
    "nav2_dynamic_msgs/msg/ObstacleArray": ("obstacles", "nav2_dynamic_msgs/msg/Obstacle"),
    "zed_msgs/msg/ObjectsStamped": ("objects", "zed_msgs/msg/Object"),
}
"""Message of people -> its list, and the type of a person in it."""

PATHS = {3: [(0.0, 1.0), (0.5, 1.0), (1.0, 1.5)], 8: [(4.0, 0.0), (3.5, 0.1), (3.0, 0.2)]}


class Store:
    """Makes messages of one edition; fields that are not given are 0, empty or false."""

    def __init__(self, edition=0, ros1=False):
        self.ros1, self.types = ros1, known_editions(ros1)[edition]

    def make(self, kind, **given):
        fields = self.types.fielddefs[kind][1]
        return self.types.types[kind](**{name: given.get(name, self.zero(*about)) for name, about in fields})

    def zero(self, node, about):
        if node.name == "BASE":
            return {"string": "", "bool": False}.get(about[0], 0)
        if node.name == "NAME":
            return self.make(about)
        (inner, name), size = about
        if inner.name == "NAME":
            return [self.make(name) for _ in range(size)]
        return [] if name[0] == "string" else np.zeros(size, name[0])

    def raw(self, kind, message):
        """The bytes of a message."""
        serialize = self.types.serialize_ros1 if self.ros1 else self.types.serialize_cdr
        return bytes(serialize(message, kind))

    def header(self, time_s, frame="map"):
        stamp = self.make("builtin_interfaces/msg/Time", sec=int(time_s), nanosec=round(time_s % 1 * 1e9))
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id=frame)

    def pose(self, x, y, z=0.0):
        point = self.make("geometry_msgs/msg/Point", x=float(x), y=float(y), z=float(z))
        turn = self.make("geometry_msgs/msg/Quaternion", w=1.0)
        return self.make("geometry_msgs/msg/Pose", position=point, orientation=turn)

    def people(self, kind, time_s, places, frame="map"):
        """A message of people at some places: pairs of name and (x, y), or a dictionary of such."""
        field, one = LISTS[kind]
        pairs = places.items() if isinstance(places, dict) else places
        people = [self.person(one, name, self.pose(*at)) for name, at in pairs]
        return self.make(kind, header=self.header(time_s, frame), **{field: people})

    def person(self, kind, name, pose):
        """A person in a list of people, of one of the types of LISTS."""
        at, covered = pose.position, "geometry_msgs/msg/PoseWithCovariance"
        id_field, place = {
            "geometry_msgs/msg/Pose": ("", vars(pose)),
            "people_msgs/msg/Person": ("name", {"position": at}),
            "people_msgs/msg/PositionMeasurement": ("object_id", {"pos": at}),
            "spencer_tracking_msgs/msg/TrackedPerson": ("track_id", {"pose": self.make(covered, pose=pose)}),
            "hunav_msgs/msg/Agent": ("id", {"position": pose}),
            "pedsim_msgs/msg/AgentState": ("id", {"pose": pose}),
            "vision_msgs/msg/Detection3D": ("id", {"bbox": self.box(pose), "tracking_id": str(name)}),
            "leg_tracker/msg/Person": ("id", {"pose": pose}),
            "nav2_dynamic_msgs/msg/Obstacle": ("uuid", {"position": at}),
            "zed_msgs/msg/Object": (
                "label_id",
                {"label": "Person", "position": np.array([at.x, at.y, at.z], np.float32)},
            ),
        }[kind]
        if id_field == "uuid":
            name = self.make("unique_identifier_msgs/msg/UUID", uuid=np.full(16, int(name), np.uint8))
        elif id_field in ("name", "object_id") or "vision" in kind:
            name = str(name)
        elif id_field:
            name = int(name)
        return self.make(kind, **place, **{id_field: name})

    def box(self, pose):
        return self.make("vision_msgs/msg/BoundingBox3D", center=pose)

    def grid(self, frame="map"):
        """Three by two cells of half a metre; the one at (1, 0) is occupied, the next one unknown."""
        sizes = {"resolution": 0.5, "width": 3, "height": 2, "origin": self.pose(-1.0, 2.0)}
        info = self.make("nav_msgs/msg/MapMetaData", **sizes)
        data = np.array([0, 100, -1, 0, 0, 0], np.int8)
        return self.make(GRID, header=self.header(0.0, frame), info=info, data=data)

    def transform(self, parent, child, pose, time_s):
        turn, offset = pose
        rotation = self.make("geometry_msgs/msg/Quaternion", **dict(zip("xyzw", turn.as_quat(), strict=True)))
        translation = self.make("geometry_msgs/msg/Vector3", **dict(zip("xyz", offset, strict=True)))
        made = self.make("geometry_msgs/msg/Transform", translation=translation, rotation=rotation)
        named = {"header": self.header(time_s, parent), "child_frame_id": child, "transform": made}
        return self.make(TF, transforms=[self.make("geometry_msgs/msg/TransformStamped", **named)])

    def write(self, path, messages, storage=rosbag2.StoragePlugin.SQLITE3, times_s=None):
        """Write (topic, type, message) tuples in order of time; without times, a nanosecond apart."""
        ros2 = {"version": 9, "storage_plugin": storage}
        self.fill(rosbag1.Writer(path) if self.ros1 else rosbag2.Writer(path, **ros2), messages, times_s)
        return path

    def fill(self, writer, messages, times_s=None):
        """Write into a new bag."""
        with writer:
            known = {}
            for count, (topic, kind, message) in enumerate(messages):
                if topic not in known:
                    known[topic] = writer.add_connection(topic, kind, typestore=self.types)
                time_ns = count if times_s is None else round(times_s[count] * 1e9)
                writer.write(known[topic], time_ns, self.raw(kind, message))


def tracks_of(kind):
    """The numbers of the two tracks of PATHS: ids, names that are no numbers, or assigned ones."""
    return {"geometry_msgs/msg/PoseArray": (1, 2), "nav2_dynamic_msgs/msg/ObstacleArray": (-1, -2)}.get(
        kind, tuple(PATHS)
    )


def stream(store, kind=PEOPLE, frame="map", topic="/tracks"):
    """A map, and the people of PATHS at three instants."""
    yield "/map", GRID, store.grid()
    for step in range(3):
        here = {name: path[step] for name, path in PATHS.items()}
        yield topic, kind, store.people(kind, step / 2, here, frame)


def check(scene, names=tuple(PATHS)):
    for name, path in zip(names, PATHS.values(), strict=True):
        rows = scene.trajectories.track_id == name
        np.testing.assert_allclose(scene.trajectories.time_s[rows], [0.0, 0.5, 1.0])
        np.testing.assert_allclose(scene.trajectories.position[rows], path)
    assert np.argwhere(scene.occupancy.occupied).tolist() == [[1, 0]]
    assert scene.occupancy.occupied.shape == (3, 2)
    np.testing.assert_allclose(scene.occupancy.origin, [-1.0, 2.0])
    assert scene.detection_dt_s == pytest.approx(0.5)


def bag(store, path, *instants, frame="map", grid=True):
    """Write a bag; an instant is (time, places), see `Store.people`."""
    messages = [("/map", GRID, store.grid())] if grid else []
    messages += [("/people", PEOPLE, store.people(PEOPLE, time_s, here, frame)) for time_s, here in instants]
    return store.write(path, messages)


def moving_bag(store, path, frame="base_link", seen=from_robot, tf_s=None, localised=False, grid=None):
    """Write a bag with one who stands and one who walks before a robot, at 10 Hz for 5 s.

    Transforms come at 20 Hz between them, or at `tf_s`; those from map to odom if it is `localised`.
    """
    tf_s = np.arange(0, 5.2, 0.05) - 0.02 if tf_s is None else tf_s
    found = [(0.0, "/map", GRID, store.grid(grid))] if grid else []
    if frame == "camera":
        found.append((0.0, "/tf_static", TF, store.transform("base_link", "camera", CAMERA, 0.0)))
    for time_s in tf_s + 10.0:
        found.append((time_s, "/tf", TF, store.transform("odom", "base_link", robot(time_s), time_s)))
        if localised:
            found.append((time_s, "/tf", TF, store.transform("map", "odom", ODOM, time_s)))
    for time_s in 10.0 + np.arange(50) / 10:
        here = {"1": seen(STANDING, time_s), "2": seen(WALKING + time_s * SPEED, time_s)}
        found.append((time_s, "/people", PEOPLE, store.people(PEOPLE, time_s, here, frame)))
    found.sort(key=lambda one: one[0])
    return store.write(path, [message for _, *message in found], times_s=[time_s for time_s, *_ in found])


def check_moving(scene, pose=None):
    """People are where they were in odom, or in the frame in which odom has a pose."""
    turn, offset = pose or (Rotation.identity(), np.zeros(3))
    found = scene.trajectories
    time_s = found.time_s[found.track_id == 2]
    assert len(time_s) > 1
    for number, at in ((1, STANDING + 0 * time_s[:, None]), (2, WALKING + time_s[:, None] * SPEED)):
        expected = (turn.apply(at) + offset)[:, :2]
        np.testing.assert_allclose(found.position[found.track_id == number], expected, atol=1e-3)


def write_mcap(store, path, kind, encoding, schema, is_defined=False):
    """Write the bag of `stream` as another recorder might: an encoding of messages and of definitions."""
    with path.open("wb") as file:
        writer = Writer(file, use_chunking=False, enable_crcs=False)
        writer.start("ros1" if store.ros1 else "ros2")
        channels = {}
        for count, (topic, name, message) in enumerate(stream(store, kind)):
            if topic not in channels:
                title = name.replace("/msg/", "/") if encoding == "ros1" else name
                text = store.types.generate_msgdef(name, ros_version=1 if store.ros1 else 2)[0]
                known = writer.register_schema(title, schema, text.encode() if is_defined else b"")
                channels[topic] = writer.register_channel(topic, encoding, known)
            writer.add_message(channels[topic], count, store.raw(name, message), count)
        writer.finish()
    return path


def repacked(source, target, compression, **options):
    """Write the messages of a recording with another MCAP writer."""
    with source.open("rb") as old, target.open("wb") as new:
        writer = Writer(new, compression=compression, **options)
        writer.start("ros2")
        channels = {}
        for schema, channel, message in make_reader(old).iter_messages(log_time_order=False):
            if channel.id not in channels:
                known = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(channel.topic, "cdr", known)
            writer.add_message(channels[channel.id], message.log_time, message.data, message.publish_time)
        writer.finish()
