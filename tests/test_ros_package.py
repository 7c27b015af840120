"""The files of ros/pedpred_ros agree with the node."""

import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import yaml

from pedpred.ros2.outputs import output_types
from pedpred.ros2.settings import PARAMETERS, NodeSettings
from tests.conftest import ROOT

PACKAGE = ROOT / "ros/pedpred_ros"


def test_the_file_of_parameters_has_the_nodes_names_and_kinds():
    given = yaml.safe_load((PACKAGE / "config/pedpred.yaml").read_text())["/**"]["ros__parameters"]
    known = {name: default for name, (default, _) in PARAMETERS.items()}
    assert given.keys() <= known.keys()
    for name, value in given.items():
        assert type(tuple(value) if isinstance(value, list) else value) is type(known[name]), name
    NodeSettings(**{name: tuple(v) if isinstance(v, list) else v for name, v in given.items()})


def test_rviz_and_the_costmap_layer_subscribe_to_known_topics():
    published = {
        f"/{topic}": kind for topic, kind in output_types(NodeSettings(occupancy_cell_m=0.1), 10).items()
    }
    shown = yaml.safe_load((PACKAGE / "rviz/pedpred.rviz").read_text())["Visualization Manager"]["Displays"]
    kinds = {one["Topic"]["Value"]: one["Class"] for one in shown if "Topic" in one}
    for topic in kinds.keys() - {"/map"}:
        assert kinds[topic].rpartition("/")[2] == published[topic].rpartition("/")[2].replace(
            "OccupancyGrid", "Map"
        )
    layers = yaml.safe_load((PACKAGE / "config/nav2_people_layer.yaml").read_text())
    layer = layers["local_costmap"]["local_costmap"]["ros__parameters"]["people_layer"]
    assert published[layer["map_topic"]] == "nav_msgs/msg/OccupancyGrid"


_ON_A_ROBOT = """
import sys
for name in "PIL lz4 matplotlib mcap pandas pyarrow scipy shapely skfmm torch tqdm zstandard".split():
    sys.modules[name] = None  # importing it is an error
import numpy as np
from pedpred import OnlinePredictor, warm_up
from pedpred.ros.message_types import serialize
from pedpred.ros.scene_messages import map_message
from pedpred.ros2 import diagnostics, main
from pedpred.ros2.follower import Follower
from pedpred.ros2.outputs import PEOPLE_TYPE
from pedpred.ros2.settings import NodeSettings
from pedpred.scenes import OccupancyMap
warm_up()
settings = NodeSettings(use_map=False, identities="assigned", occupancy_cell_m=0.5)
follower = Follower(OnlinePredictor.load(), settings)
ground = OccupancyMap(np.zeros((9, 9), bool), np.zeros(2), 0.5)
follower.take_map(serialize("nav_msgs/msg/OccupancyGrid", map_message(ground, 0)))
turn = {"translation": {"x": 1.0}, "rotation": {"w": 1.0}}
edges = [{"header": {"frame_id": "map"}, "child_frame_id": "robot", "transform": turn}]
follower.inbox.take_transforms(serialize("tf2_msgs/msg/TFMessage", {"transforms": edges}), 0.0, fixed=True)
people = {"header": {"frame_id": "robot"}, "people": [{"name": "7", "position": {"x": 1.0}}]}
follower.inbox.take_people(serialize(PEOPLE_TYPE, people), 10**9, 0.0)
topics = {output.topic for output in follower.outputs(0.0)}
assert topics >= {"predictions", "predictions/markers", "predicted_occupancy/horizon"}
"""


def test_a_robot_needs_no_libraries_that_read_files():
    """The predictor, its warm-up and what the node does between messages."""
    done = subprocess.run(
        [sys.executable, "-c", _ON_A_ROBOT], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_both_packages_have_one_version():
    (version,) = re.findall(r'^version = "(.*)"$', (ROOT / "pyproject.toml").read_text(), re.MULTILINE)
    assert ElementTree.parse(PACKAGE / "package.xml").findtext("version") == version  # noqa: S314 (our own file)
    assert f'version="{version}"' in (PACKAGE / "setup.py").read_text()


def test_help_lists_every_parameter_without_an_installed_ros():
    script = "import sys; sys.modules['rclpy'] = None; from pedpred.ros2.main import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", script, "--help"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert PARAMETERS.keys() <= {line.partition(" ")[0] for line in done.stdout.splitlines()}
