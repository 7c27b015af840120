"""Launch the node with the parameters of config/pedpred.yaml, and RViz if asked for."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode, Node
from launch_ros.parameter_descriptions import ParameterValue


def generate_launch_description():
    """The node `pedpred`; arguments name topics, namespace, file of parameters, simulated time, RViz.

    `tf:=tf` takes the transforms of the namespace, as the launch files of Nav2 remap them.
    """
    share = Path(get_package_share_directory("pedpred_ros"))
    arguments = {
        "params_file": str(share / "config" / "pedpred.yaml"),
        "namespace": "",
        "people": "people",
        "map": "map",
        "tf": "/tf",
        "use_sim_time": "false",
        "autostart": "true",
        "rviz": "false",
    }
    chosen = {name: LaunchConfiguration(name) for name in arguments}
    switches = {name: ParameterValue(chosen[name], value_type=bool) for name in ("use_sim_time", "autostart")}
    transforms = [("/tf", chosen["tf"]), ("/tf_static", [chosen["tf"], "_static"])]
    node = LifecycleNode(
        package="pedpred_ros",
        executable="pedpred",
        name="pedpred",
        namespace=chosen["namespace"],
        parameters=[chosen["params_file"], switches],
        remappings=[("people", chosen["people"]), ("map", chosen["map"]), *transforms],
        output="screen",
    )
    shown = (
        "predictions",
        "predictions/markers",
        "predicted_occupancy/horizon",
    )  # in the namespace of the node
    viewer = Node(
        package="rviz2",
        executable="rviz2",
        namespace=chosen["namespace"],
        remappings=[("/map", chosen["map"]), *transforms, *((f"/{topic}", topic) for topic in shown)],
        arguments=["-d", str(share / "rviz" / "pedpred.rviz")],
        parameters=[{"use_sim_time": switches["use_sim_time"]}],
        condition=IfCondition(chosen["rviz"]),
    )
    declared = [DeclareLaunchArgument(name, default_value=value) for name, value in arguments.items()]
    return LaunchDescription([*declared, node, viewer])
