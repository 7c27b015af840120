"""The command `pedpred-ros2`: runs the node until it is interrupted or told to end."""

from __future__ import annotations

import argparse
import signal
import sys

_MISSING = (
    "rclpy is not installed here: source the setup file of a ROS 2 installation whose Python has pedpred, "
    "or pip install 'pedpred[ros2]'"
)


def main() -> None:
    """Run the node; SIGINT and SIGTERM end it with exit code 0."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        try:
            import rclpy
        except ImportError as cause:
            raise SystemExit(f"{_MISSING} ({cause})") from cause
        rclpy.init(args=sys.argv)
        _run(rclpy.utilities.remove_ros_args(sys.argv)[1:])
    except KeyboardInterrupt:
        return
    finally:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)  # a second one must not spoil the end


def _run(arguments: list[str]) -> None:
    import rclpy
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

    from pedpred.ros2.node import PedpredNode
    from pedpred.ros2.settings import described

    text = "Forecast people for planners. ROS arguments come after --ros-args. Parameters:\n\n" + described()
    parser = argparse.ArgumentParser(
        prog="pedpred-ros2", description=text, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.parse_args(arguments)
    node = PedpredNode()
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        if not node.start():
            raise SystemExit(1)
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()
