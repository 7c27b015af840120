"""Definitions of messages that are not among the types of a ROS distribution, for bags that bring none.

Each entry is an edition of a package: bags do not say which one they were written with. The first one that
fits a message to its last byte is taken.
"""

from __future__ import annotations

_STAMPED = "std_msgs/Header header\n"

_PEOPLE = {
    "people_msgs/msg/Person": "string name\ngeometry_msgs/Point position\ngeometry_msgs/Point velocity\n"
    "float64 reliability\nstring[] tagnames\nstring[] tags\n",
    "people_msgs/msg/People": f"{_STAMPED}people_msgs/Person[] people\n",
    "people_msgs/msg/PositionMeasurement": f"{_STAMPED}string name\nstring object_id\n"
    "geometry_msgs/Point pos\n"
    "float64 reliability\nfloat64[9] covariance\nbyte initialization\n",
    "people_msgs/msg/PositionMeasurementArray": _STAMPED
    + "people_msgs/PositionMeasurement[] people\nfloat32[] cooccurrence\n",
}

_MATCHED = "uint64 track_id\nbool is_occluded\nbool is_matched\nuint64 detection_id\n"
_ESTIMATED = (
    "builtin_interfaces/Duration age\n"
    "geometry_msgs/PoseWithCovariance pose\ngeometry_msgs/TwistWithCovariance twist\n"
)


def _spencer(detections: str = "") -> dict[str, str]:
    return {
        "spencer_tracking_msgs/msg/TrackedPerson": f"{_MATCHED}{detections}{_ESTIMATED}",
        "spencer_tracking_msgs/msg/TrackedPersons": _STAMPED
        + "spencer_tracking_msgs/TrackedPerson[] tracks\n",
    }


_BOX = "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size\n"


def _vision(hypothesis: dict[str, str], detection: str) -> dict[str, str]:
    return {
        "vision_msgs/msg/BoundingBox3D": _BOX,
        **hypothesis,
        "vision_msgs/msg/Detection3D": f"{_STAMPED}vision_msgs/ObjectHypothesisWithPose[] results\n"
        f"vision_msgs/BoundingBox3D bbox\n{detection}",
        "vision_msgs/msg/Detection3DArray": f"{_STAMPED}vision_msgs/Detection3D[] detections\n",
    }


_HYPOTHESIS = "vision_msgs/msg/ObjectHypothesisWithPose"
_LIKELY = "float64 score\ngeometry_msgs/PoseWithCovariance pose\n"
_NESTED = {
    "vision_msgs/msg/ObjectHypothesis": "string class_id\nfloat64 score\n",
    _HYPOTHESIS: "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose\n",
}
_CLOUD = "sensor_msgs/PointCloud2 source_cloud\n"


def _hunav(before: str, after: str, more: dict[str, str]) -> dict[str, str]:
    body = "geometry_msgs/Pose position\nfloat32 yaw\ngeometry_msgs/Twist velocity\n"
    sizes = "".join(
        f"float32 {name}\n" for name in ("desired_velocity", "radius", "linear_vel", "angular_vel")
    )
    goals = "geometry_msgs/Pose[] goals\nbool cyclic_goals\nfloat32 goal_radius\n"
    obstacles = "geometry_msgs/Point[] closest_obs\n"
    return {
        **more,
        "hunav_msgs/msg/Agent": f"int32 id\nuint8 type\nuint8 skin\n{before}int8 group_id\n{body}{sizes}"
        f"{after}{goals}{obstacles}",
        "hunav_msgs/msg/Agents": f"{_STAMPED}hunav_msgs/Agent[] agents\n",
    }


_FACTORS = ("vel", "dist", *(f"{kind}_force_factor" for kind in ("social", "goal", "obstacle", "other")))
_BEHAVIOUR = "uint8 type\nuint8 state\nuint8 configuration\nfloat32 duration\nbool once\n"

_FORCES = ("desired", "obstacle", "social", "group_coherence", "group_gaze", "group_repulsion", "random")
_PEDSIM = {
    "pedsim_msgs/msg/AgentForce": "".join(f"geometry_msgs/Vector3 {name}_force\n" for name in _FORCES),
    "pedsim_msgs/msg/AgentState": f"{_STAMPED}uint64 id\nuint16 type\nstring social_state\n"
    "geometry_msgs/Pose pose\ngeometry_msgs/Twist twist\npedsim_msgs/AgentForce forces\n",
    "pedsim_msgs/msg/AgentStates": f"{_STAMPED}pedsim_msgs/AgentState[] agent_states\n",
}
_LEGS = {
    "leg_tracker/msg/Person": "geometry_msgs/Pose pose\nuint32 id\n",
    "leg_tracker/msg/PersonArray": f"{_STAMPED}leg_tracker/Person[] people\n",
}
_OBSTACLES = {
    "nav2_dynamic_msgs/msg/Obstacle": "unique_identifier_msgs/UUID uuid\nfloat32 score\n"
    "geometry_msgs/Point position\ngeometry_msgs/Vector3 velocity\ngeometry_msgs/Vector3 size\n",
    "nav2_dynamic_msgs/msg/ObstacleArray": f"{_STAMPED}nav2_dynamic_msgs/Obstacle[] obstacles\n",
    "unique_identifier_msgs/msg/UUID": "uint8[16] uuid\n",
}
_ZED = {
    "zed_msgs/msg/Keypoint2Di": "uint32[2] kp\n",
    "zed_msgs/msg/Keypoint2Df": "float32[2] kp\n",
    "zed_msgs/msg/Keypoint3D": "float32[3] kp\n",
    "zed_msgs/msg/BoundingBox2Di": "zed_msgs/Keypoint2Di[4] corners\n",
    "zed_msgs/msg/BoundingBox2Df": "zed_msgs/Keypoint2Df[4] corners\n",
    "zed_msgs/msg/BoundingBox3D": "zed_msgs/Keypoint3D[8] corners\n",
    "zed_msgs/msg/Skeleton2D": "zed_msgs/Keypoint2Df[70] keypoints\n",
    "zed_msgs/msg/Skeleton3D": "zed_msgs/Keypoint3D[70] keypoints\n",
    "zed_msgs/msg/Object": "string label\nint16 label_id\nstring sublabel\nfloat32 confidence\n"
    "float32[3] position\nfloat32[6] position_covariance\nfloat32[3] velocity\nbool tracking_available\n"
    "int8 tracking_state\nint8 action_state\nzed_msgs/BoundingBox2Di bounding_box_2d\n"
    "zed_msgs/BoundingBox3D bounding_box_3d\nfloat32[3] dimensions_3d\nbool skeleton_available\n"
    "int8 body_format\nzed_msgs/BoundingBox2Df head_bounding_box_2d\n"
    "zed_msgs/BoundingBox3D head_bounding_box_3d\nfloat32[3] head_position\n"
    "zed_msgs/Skeleton2D skeleton_2d\nzed_msgs/Skeleton3D skeleton_3d\n",
    "zed_msgs/msg/ObjectsStamped": f"{_STAMPED}zed_msgs/Object[] objects\n",
}
_MAPS = {
    "map_msgs/msg/OccupancyGridUpdate": f"{_STAMPED}int32 x\nint32 y\nuint32 width\nuint32 height\n"
    "int8[] data\n",
}

EDITIONS: tuple[dict[str, str], ...] = (
    {
        **_PEOPLE,
        **_PEDSIM,
        **_LEGS,
        **_OBSTACLES,
        **_ZED,
        **_MAPS,
        **_spencer(),
        **_vision(_NESTED, "string id\n"),
        **_hunav(
            "string name\n",
            "hunav_msgs/AgentBehavior behavior\n",
            {"hunav_msgs/msg/AgentBehavior": _BEHAVIOUR + "".join(f"float32 {name}\n" for name in _FACTORS)},
        ),
    },
    {
        **_PEOPLE,
        **_spencer("uint64[] detection_ids\n"),
        **_vision({_HYPOTHESIS: f"string id\n{_LIKELY}"}, f"{_CLOUD}bool is_tracking\nstring tracking_id\n"),
        **_hunav("uint8 behavior\nstring name\nuint8 behavior_state\n", "", {}),
    },
    {
        **_PEOPLE,
        **_spencer(),
        **_vision({_HYPOTHESIS: f"int64 id\n{_LIKELY}"}, _CLOUD),
    },
)
"""Type -> definition of each edition, the latest first."""
