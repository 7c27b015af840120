"""The command `pedpred-ros2`: runs the node until SIGINT or SIGTERM."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import threading
from itertools import takewhile
from typing import Any

_SIGNALS = signal.SIGINT, signal.SIGTERM
_LOOK_S = 0.25
_MISSING = (
    "rclpy is not installed here: source the setup file of a ROS 2 installation whose Python has pedpred, "
    "or pip install 'pedpred[ros2]'"
)


def main() -> None:
    """Run the node; SIGINT and SIGTERM end it with exit code 0.

    No signal raises an exception: one in a callback from C, of the compiler or of the middleware, is lost or
    leaves objects behind with which the process crashes.
    """
    _handle_signals(lambda *_: os._exit(0))  # until people are received, nothing is lost
    if {"-h", "--help"} & set(takewhile(lambda word: word != "--ros-args", sys.argv[1:])):
        _parse(["--help"])  # also where no ROS is
    try:
        import rclpy
        from rclpy.signals import SignalHandlerOptions
    except ImportError as cause:
        raise SystemExit(f"{_MISSING} ({cause})") from cause
    # its own handlers shut the middleware down from another thread, whatever this one is doing there
    try:
        rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as cause:  # it names the argument, or the file and the line
        raise SystemExit(f"pedpred-ros2: {cause}") from cause
    _run(rclpy.utilities.remove_ros_args(sys.argv)[1:])


def _handle_signals(handler: Any) -> None:
    for number in _SIGNALS:
        signal.signal(number, handler)


def _parse(arguments: list[str]) -> None:
    """Refuse arguments that are not for ROS; `--help` lists the parameters and ends."""
    from pedpred.ros2.settings import described

    text = "Forecast people for planners. ROS arguments come after --ros-args. Parameters:\n\n" + described()
    parser = argparse.ArgumentParser(
        prog="pedpred-ros2", description=text, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.parse_args(arguments)


def _run(arguments: list[str]) -> None:
    import rclpy
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

    from pedpred.ros2.node import PedpredNode

    _parse(arguments)
    node = PedpredNode()
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        if not node.start():
            raise SystemExit(1)
        _spin(executor, node)
    except ExternalShutdownException:
        pass
    finally:
        _handle_signals(signal.SIG_IGN)  # a second one must not spoil the end
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()


def _spin(executor: Any, node: Any) -> None:
    """Call back until a signal ends that, never in the middle of a callback.

    The middleware waits in C, where Python handles no signal, so a timer wakes it at intervals.
    """
    from rclpy.clock import Clock, ClockType

    ended = threading.Event()
    node.create_timer(_LOOK_S, lambda: None, clock=Clock(clock_type=ClockType.STEADY_TIME))
    _handle_signals(lambda *_: ended.set())
    while not ended.is_set():
        executor.spin_once()
