"""Messages as bytes for a follower, and what it publishes."""

import numpy as np
from scipy.spatial.transform import Rotation

from pedpred.online import OnlinePredictor
from pedpred.ros.message_types import serialize
from pedpred.ros.planning import ROW
from pedpred.ros.scene_messages import header
from pedpred.ros2.follower import Follower
from pedpred.ros2.settings import NodeSettings
from tests.bags import GRID, PEOPLE, TF

UNMOVED = Rotation.identity(), np.zeros(3)


def follower_of(is_subscribed=lambda topic: True, clock=lambda: 0.0, **values):
    """A follower that does not wait for a map, with some settings; for grids it has one of 60 m."""
    settings = NodeSettings(**{"use_map": False} | values)
    follower = Follower(OnlinePredictor.load(None, settings.online()), settings, is_subscribed, clock)
    if settings.occupancy_cell_m:
        follower.take_map(grid(np.zeros((120, 120)), position={"x": -30.0, "y": -30.0}))
    return follower


def people(time_s, frame="map", **places):
    """A message of people; `places`: name -> x, y and perhaps z, m."""
    here = [
        {"name": name, "position": dict(zip("xyz", map(float, (*at, 0.0)[:3]), strict=True))}
        for name, at in places.items()
    ]
    return serialize(PEOPLE, {"header": header(round(time_s * 1e9), frame), "people": here})


def transform(parent, child, turn, offset, time_s=0.0):
    rotation = dict(zip("xyzw", map(float, turn.as_quat()), strict=True))
    translation = dict(zip("xyz", map(float, offset), strict=True))
    return {
        "header": header(round(time_s * 1e9), parent),
        "child_frame_id": child,
        "transform": {"translation": translation, "rotation": rotation},
    }


def transforms(*poses):
    return serialize(TF, {"transforms": list(poses)})


def move(follower, time_s, *poses, fixed=False):
    """Send transforms of a time: (parent, child, (turn, offset))."""
    sent = (transform(parent, child, *pose, time_s) for parent, child, pose in poses)
    follower.inbox.take_transforms(transforms(*sent), time_s, fixed)


def answered(follower, raw, now_s=0.0, clock_ns=10**9):
    """Topic -> content of what is published for a message of people."""
    follower.inbox.take_people(raw, clock_ns, now_s)
    return contents(follower.outputs(now_s))


def contents(outputs):
    return {output.topic: output.content for output in outputs}


def seen(published):
    """Name -> ((x, y), (vx, vy)) of the people in a message of `predictions/people`."""
    listed = published["predictions/people"]["people"]
    return {
        one["name"]: tuple((one[of]["x"], one[of]["y"]) for of in ("position", "velocity")) for one in listed
    }


def rows_of(cloud):
    return np.frombuffer(cloud["data"].tobytes(), ROW)


def tracks_of(published):
    """The numbers of all people in the table."""
    rows = rows_of(published["predictions"])
    return set((rows["track_high"].astype(np.int64) * 2**32 + rows["track_id"]).tolist())


def grid(cells, yaw_rad=0.0, frame="map", **about):
    """A message of a map whose cells are per cent [Y, X]; `about` are other fields of its `info`."""
    height, width = np.shape(cells)
    turn = {"z": float(np.sin(yaw_rad / 2)), "w": float(np.cos(yaw_rad / 2))}
    info = {"resolution": 0.5, "width": width, "height": height} | about
    info["origin"] = {"position": info.pop("position", {}), "orientation": turn}
    data = np.asarray(cells, np.int8).ravel()
    return serialize(GRID, {"header": header(0, frame), "info": info, "data": data})
