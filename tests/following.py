"""Messages as bytes for a follower, and its answers."""

import numpy as np

from pedpred.online import OnlinePredictor
from pedpred.ros.message_types import serialize
from pedpred.ros.planning import ROW
from pedpred.ros.scene_messages import header
from pedpred.ros2.follower import Follower
from pedpred.ros2.settings import NodeSettings
from tests.bags import GRID, PEOPLE, TF


def follower_of(**values):
    """A follower that does not wait for a map, with some settings; for grids it has one without walls."""
    settings = NodeSettings(**{"use_map": False} | values)
    return ready(Follower(OnlinePredictor.load(None, settings.online()), settings, clock=lambda: 0.0))


def ready(follower):
    """The follower, with a map of 60 m if its settings ask for grids."""
    if follower.settings.occupancy_cell_m:
        follower.map_came(grid(np.zeros((120, 120)), position={"x": -30.0, "y": -30.0}))
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


def answered(follower, raw, now_s=0.0):
    """Topic -> content of the answers to a message of people."""
    follower.people_came(raw, 10**9, now_s)
    return {answer.topic: answer.content for answer in follower.answers(now_s)}


def rows_of(cloud):
    return np.frombuffer(cloud["data"].tobytes(), ROW)


def grid(cells, yaw_rad=0.0, frame="map", **about):
    """A message of a map whose cells are per cent [Y, X]; `about` are other fields of its `info`."""
    height, width = np.shape(cells)
    turn = {"z": float(np.sin(yaw_rad / 2)), "w": float(np.cos(yaw_rad / 2))}
    info = {"resolution": 0.5, "width": width, "height": height} | about
    info["origin"] = {"position": info.pop("position", {}), "orientation": turn}
    data = np.asarray(cells, np.int8).ravel()
    return serialize(GRID, {"header": header(0, frame), "info": info, "data": data})
