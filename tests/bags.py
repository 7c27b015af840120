"""Bags of ROS 1 and ROS 2 with people and maps, as tests need them."""

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation

from pedpred.ros.message_types import known_editions
from tests.robots import CAMERA, ODOM, SPEED, STANDING, WALKING, from_robot, robot

GRID, PEOPLE, TF = "nav_msgs/msg/OccupancyGrid", "people_msgs/msg/People", "tf2_msgs/msg/TFMessage"
DEFINITIONS = {
    "people_msgs/msg/Person": "string name\ngeometry_msgs/Point position\ngeometry_msgs/Point velocity",
    "people_msgs/msg/People": "std_msgs/Header header\npeople_msgs/Person[] people",
    "people_msgs/msg/PositionMeasurement": "std_msgs/Header header\nstring object_id\n"
    "geometry_msgs/Point pos",
    "people_msgs/msg/PositionMeasurementArray": "std_msgs/Header header\n"
    "people_msgs/PositionMeasurement[] people",
    "spencer_tracking_msgs/msg/TrackedPerson": "uint64 track_id\ngeometry_msgs/PoseWithCovariance pose",
    "spencer_tracking_msgs/msg/TrackedPersons": "std_msgs/Header header\n"
    "spencer_tracking_msgs/TrackedPerson[] tracks",
    "hunav_msgs/msg/Agent": "int32 id\nstring name\ngeometry_msgs/Pose position",
    "hunav_msgs/msg/Agents": "std_msgs/Header header\nhunav_msgs/Agent[] agents",
    "pedsim_msgs/msg/AgentState": "uint64 id\ngeometry_msgs/Pose pose",
    "pedsim_msgs/msg/AgentStates": "std_msgs/Header header\npedsim_msgs/AgentState[] agent_states",
    "vision_msgs/msg/BoundingBox3D": "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size",
    "vision_msgs/msg/Detection3D": "std_msgs/Header header\nvision_msgs/BoundingBox3D bbox\nstring id",
    "vision_msgs/msg/Detection3DArray": "std_msgs/Header header\nvision_msgs/Detection3D[] detections",
    "leg_tracker/msg/Person": "geometry_msgs/Pose pose\nuint32 id",
    "leg_tracker/msg/PersonArray": "std_msgs/Header header\nleg_tracker/Person[] people",
    "unique_identifier_msgs/msg/UUID": "uint8[16] uuid",
    "nav2_dynamic_msgs/msg/Obstacle": "unique_identifier_msgs/UUID uuid\ngeometry_msgs/Point position",
    "nav2_dynamic_msgs/msg/ObstacleArray": "std_msgs/Header header\nnav2_dynamic_msgs/Obstacle[] obstacles",
    "zed_msgs/msg/Object": "string label\nint16 label_id\nfloat32[3] position",
    "zed_msgs/msg/ObjectsStamped": "std_msgs/Header header\nzed_msgs/Object[] objects",
}
"""The used fields of each type, as its package defines them."""

LISTS = {
    "people_msgs/msg/People": ("people", "people_msgs/msg/Person"),
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
    """Makes messages of one ROS version."""

    def __init__(self, kind):
        self.ros1 = kind == Stores.ROS1_NOETIC
        self.types = get_typestore(kind)
        for name, fields in DEFINITIONS.items():
            if name not in self.types.fielddefs:
                self.types.register(get_types_from_msg(fields, name))

    def make(self, kind, **fields):
        return self.types.types[kind](**fields)

    def header(self, time_s, frame):
        stamp = self.make("builtin_interfaces/msg/Time", sec=int(time_s), nanosec=round(time_s % 1 * 1e9))
        number = {"seq": 0} if self.ros1 else {}
        return self.make("std_msgs/msg/Header", **number, stamp=stamp, frame_id=frame)

    def pose(self, x, y):
        point = self.make("geometry_msgs/msg/Point", x=x, y=y, z=0.0)
        turn = self.make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
        return self.make("geometry_msgs/msg/Pose", position=point, orientation=turn)

    def people(self, kind, time_s, frame="map"):
        """The people of PATHS at a multiple of half a second."""
        header = self.header(time_s, frame)
        field, one = LISTS[kind]
        here = {who: self.pose(*path[round(2 * time_s)]) for who, path in PATHS.items()}
        several = [self.person(one, who, pose, header) for who, pose in here.items()]
        return self.make(kind, header=header, **{field: several})

    def person(self, kind, who, pose, header):
        """A person in a list of people, of one of the types of LISTS."""
        at = pose.position
        fields = {
            "geometry_msgs/msg/Pose": lambda: vars(pose),
            "people_msgs/msg/Person": lambda: {"name": str(who), "position": at, "velocity": at},
            "people_msgs/msg/PositionMeasurement": lambda: {
                "header": header,
                "object_id": str(who),
                "pos": at,
            },
            "spencer_tracking_msgs/msg/TrackedPerson": lambda: {"track_id": who, "pose": self.sure(pose)},
            "hunav_msgs/msg/Agent": lambda: {"id": who, "name": "agent", "position": pose},
            "pedsim_msgs/msg/AgentState": lambda: {"id": who, "pose": pose},
            "vision_msgs/msg/Detection3D": lambda: {
                "header": header,
                "bbox": self.box(pose),
                "id": str(who),
            },
            "leg_tracker/msg/Person": lambda: {"id": who, "pose": pose},
            "nav2_dynamic_msgs/msg/Obstacle": lambda: {"uuid": self.uuid(who), "position": at},
            "zed_msgs/msg/Object": lambda: {
                "label": "Person",
                "label_id": who,
                "position": np.array([at.x, at.y, at.z], np.float32),
            },
        }
        given = fields[kind]()
        return self.make(kind, **{name: value for name, value in given.items() if name != "__msgtype__"})

    def sure(self, pose):
        return self.make("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=np.zeros(36))

    def box(self, pose):
        size = self.make("geometry_msgs/msg/Vector3", x=1.0, y=1.0, z=1.0)
        return self.make("vision_msgs/msg/BoundingBox3D", center=pose, size=size)

    def uuid(self, number):
        given = np.frombuffer(int(number).to_bytes(16, "big"), np.uint8)
        return self.make("unique_identifier_msgs/msg/UUID", uuid=given)

    def grid(self, frame="map"):
        """Three by two cells of half a metre; the one at (1, 0) is occupied, the next one unknown."""
        header, data = self.header(0.0, frame), np.array([0, 100, -1, 0, 0, 0], np.int8)
        sizes = {"resolution": 0.5, "width": 3, "height": 2, "origin": self.pose(-1.0, 2.0)}
        about = self.make("nav_msgs/msg/MapMetaData", map_load_time=header.stamp, **sizes)
        return self.make("nav_msgs/msg/OccupancyGrid", header=header, info=about, data=data)

    def write(self, path, messages, storage=rosbag2.StoragePlugin.SQLITE3, times_s=None):
        """Write (topic, type, message) tuples in order of time; without times, a nanosecond apart."""
        ros2 = {"version": 9, "storage_plugin": storage}
        self.fill(rosbag1.Writer(path) if self.ros1 else rosbag2.Writer(path, **ros2), messages, times_s)

    def fill(self, writer, messages, times_s=None):
        """Write into a new bag."""
        serialise = self.types.serialize_ros1 if self.ros1 else self.types.serialize_cdr
        with writer:
            known = {}
            for count, (topic, kind, message) in enumerate(messages):
                if topic not in known:
                    known[topic] = writer.add_connection(topic, kind, typestore=self.types)
                time_ns = count if times_s is None else round(times_s[count] * 1e9)
                writer.write(known[topic], time_ns, serialise(message, kind))


class Filled(Store):
    """Makes messages of one edition with all fields, which are 0, empty or false where PATHS say nothing."""

    def __init__(self, edition, ros1=False):
        self.ros1, self.types = ros1, known_editions(ros1)[edition]

    def make(self, kind, **fields):
        types = self.types.fielddefs[kind][1]
        filled = {name: fields.get(name, self.nothing(*about)) for name, about in types}
        return self.types.types[kind](
            **filled | ({"tracking_id": fields["id"]} if "tracking_id" in filled else {})
        )

    def nothing(self, node, about):
        if node.name == "BASE":
            return {"string": "", "bool": False}.get(about[0], 0)
        if node.name == "NAME":
            return self.make(about)
        (inner, name), size = about
        if inner.name == "NAME":
            return [self.make(name) for _ in range(size)]
        if name[0] == "string":
            return []
        return np.zeros(size, name[0])


def tracks_of(kind):
    """The numbers of the two tracks of PATHS: ids, names that are no numbers, or assigned ones."""
    return {"geometry_msgs/msg/PoseArray": (1, 2), "nav2_dynamic_msgs/msg/ObstacleArray": (-1, -2)}.get(
        kind, tuple(PATHS)
    )


def stream(store, kind, frame="map"):
    yield "/map", "nav_msgs/msg/OccupancyGrid", store.grid()
    for time_s in (0.0, 0.5, 1.0):
        yield "/tracks", kind, store.people(kind, time_s, frame)


def check(scene, names=tuple(PATHS)):
    for name, path in zip(names, PATHS.values(), strict=True):
        rows = scene.trajectories.track_id == name
        np.testing.assert_allclose(scene.trajectories.time_s[rows], [0.0, 0.5, 1.0])
        np.testing.assert_allclose(scene.trajectories.position[rows], path)
    assert np.argwhere(scene.occupancy.occupied).tolist() == [[1, 0]]
    assert scene.occupancy.occupied.shape == (3, 2)
    np.testing.assert_allclose(scene.occupancy.origin, [-1.0, 2.0])
    assert scene.detection_dt_s == pytest.approx(0.5)


def bag(store, path, *instants, frame="map", kind=PEOPLE, grid=True):
    """Write a bag; an instant is (time, {name: (x, y)}) or (time, [(name, (x, y)), ...])."""
    messages = [("/map", "nav_msgs/msg/OccupancyGrid", store.grid())] if grid else []
    for time_s, people in instants:
        header = store.header(time_s, frame)
        here = people.items() if isinstance(people, dict) else people
        several = [store.person("people_msgs/msg/Person", who, store.pose(*at), header) for who, at in here]
        messages.append(("/people", kind, store.make(kind, header=header, people=several)))
    store.write(path, messages)
    return path


def transform(store, parent, child, pose, time_s):
    turn, offset = pose
    x, y, z, w = map(float, turn.as_quat())
    rotation = store.make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)
    x, y, z = map(float, offset)
    translation = store.make("geometry_msgs/msg/Vector3", x=x, y=y, z=z)
    made = store.make("geometry_msgs/msg/Transform", translation=translation, rotation=rotation)
    header = store.header(time_s, parent)
    one = store.make(
        "geometry_msgs/msg/TransformStamped", header=header, child_frame_id=child, transform=made
    )
    return store.make(TF, transforms=[one])


def _two_people(store, time_s, frame, seen):
    header, several = store.header(time_s, frame), []
    for who, at in (("1", STANDING), ("2", WALKING + time_s * SPEED)):
        x, y, z = map(float, seen(at, time_s))
        pose = store.pose(x, y)
        pose.position.z = z
        several.append(store.person("people_msgs/msg/Person", who, pose, header))
    return store.make(PEOPLE, header=header, people=several)


def moving_messages(store, frame="base_link", seen=from_robot, tf_s=None, localised=False, grid=None):
    """Who stands and who walks before a robot, at 10 Hz for 5 s, and transforms at 20 Hz between them."""
    tf_s = np.arange(0, 5.2, 0.05) - 0.02 if tf_s is None else tf_s
    found = [(0.0, "/map", GRID, store.grid(grid))] if grid else []
    if frame == "camera":
        found.append((0.0, "/tf_static", TF, transform(store, "base_link", "camera", CAMERA, 0.0)))
    for time_s in tf_s + 10.0:
        found.append((time_s, "/tf", TF, transform(store, "odom", "base_link", robot(time_s), time_s)))
        if localised:
            found.append((time_s, "/tf", TF, transform(store, "map", "odom", ODOM, time_s)))
    for time_s in 10.0 + np.arange(50) / 10:
        found.append((time_s, "/people", PEOPLE, _two_people(store, time_s, frame, seen)))
    return sorted(found, key=lambda one: one[0])


def write_timed(store, path, found):
    """Write (time, topic, type, message) tuples in this order."""
    store.write(path, [message for _, *message in found], times_s=[time_s for time_s, *_ in found])
    return path


def moving_bag(store, path, *given, **options):
    """Write a bag of `moving_messages`."""
    return write_timed(store, path, moving_messages(store, *given, **options))


def check_moving(scene, pose=None, atol=1e-3):
    """Where everybody is in odom, or in the frame in which odom has a pose."""
    turn, offset = pose or (Rotation.identity(), np.zeros(3))
    found = scene.trajectories
    time_s = found.time_s[found.track_id == 2]
    assert len(time_s) > 1
    for who, at in ((1, STANDING + 0 * time_s[:, None]), (2, WALKING + time_s[:, None] * SPEED)):
        expected = (turn.apply(at) + offset)[:, :2]
        np.testing.assert_allclose(found.position[found.track_id == who], expected, atol=atol)


def write_mcap(store, path, kind, encoding, schema, text=""):
    """Write the bag of `stream` as another recorder might: an encoding of messages and of definitions."""
    with path.open("wb") as file:
        writer = Writer(file, use_chunking=False, enable_crcs=False)
        writer.start("ros1" if store.ros1 else "ros2")
        channels = {}
        for count, (topic, name, message) in enumerate(stream(store, kind)):
            if topic not in channels:
                said = name.replace("/msg/", "/") if encoding == "ros1" else name
                known = writer.register_schema(said, schema, text and _definition(store, name))
                channels[topic] = writer.register_channel(topic, encoding, known)
            serialise = store.types.serialize_ros1 if encoding == "ros1" else store.types.serialize_cdr
            writer.add_message(channels[topic], count, bytes(serialise(message, name)), count)
        writer.finish()
    return path


def _definition(store, kind):
    return store.types.generate_msgdef(kind, ros_version=1 if store.ros1 else 2)[0].encode()


def repacked(source, target, compression, **options):
    """Write the messages of a recording with another MCAP writer."""
    with source.open("rb") as old, target.open("wb") as new:
        writer = Writer(new, compression=compression, **options)
        writer.start("ros2")
        reader, channels = make_reader(old), {}
        for record in reader.iter_metadata():
            writer.add_metadata(record.name, record.metadata)
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            if channel.id not in channels:
                known = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(channel.topic, "cdr", known)
            writer.add_message(channels[channel.id], message.log_time, message.data, message.publish_time)
        writer.finish()
