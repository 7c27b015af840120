"""The ROS 2 node under load: `python -m benchmarks.ros [--seconds 300] [--people 20] [--rate-hz 30]`.

A publisher, the node and a recorder are processes of their own on build/ros/bin/python (see `make ros`), with
real middleware and best-effort people. Measured: the time from activation to the first forecast; messages
without a forecast after that; time from the sending of people to the arrival of their forecast; processor
time of the node per message, which depends less on what else the machine does; memory from `_SETTLED_S` after
activation on; and the load of the machine, the mean number of processes that want a core.
"""

from __future__ import annotations

import argparse
import itertools
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from benchmarks.tables import keep, show
from pedpred.errors import InputError, user_errors
from tools.arguments import count, output, positive

ROOT = Path(__file__).resolve().parents[1]
PYTHON, STREAM = ROOT / "build/ros/bin/python", "from benchmarks.ros import stream; stream()"
_ACTIVE = re.compile(r"\[(\d+\.\d+)\] \[pedpred\]: forecasting people of")
_SETTLED_S, _WATCH_S, _LIMIT_S = 30.0, 1.0, 90.0
SILENCE_S, STREAM_LIMIT_S, DEPTH = 3.0, 60.0, 200
ROOM_M = 20.0


# In the Python that has rclpy


def publish(node: Any, out: TextIO, people: int, rate_hz: float, seconds: float) -> None:
    """Publish walkers, best effort, until a node has listened for so many seconds; write their stamps, ns."""
    from people_msgs.msg import People
    from rclpy.qos import QoSProfile, ReliabilityPolicy

    from pedpred.ros.message_types import serialize
    from pedpred.ros.scene_messages import header

    rng = np.random.default_rng(0)
    start, velocity = rng.uniform(0.0, ROOM_M, (people, 2)), rng.normal(0.0, 1.0, (people, 2))
    sink = node.create_publisher(
        People, "people", QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    )
    begun_s, end_s = time.monotonic(), time.monotonic() + STREAM_LIMIT_S
    subscribed = False
    for k in itertools.count():
        if not subscribed and sink.get_subscription_count():
            subscribed, end_s = True, time.monotonic() + seconds
        if time.monotonic() > end_s:
            break
        position = ROOM_M / 2 + np.abs((start + velocity * k / rate_hz) % (2 * ROOM_M) - ROOM_M) / 2
        listed = [
            {"name": str(i + 1), "position": {"x": float(x), "y": float(y)}}
            for i, (x, y) in enumerate(position)
        ]
        stamp_ns = time.time_ns()
        sink.publish(serialize("people_msgs/msg/People", {"header": header(stamp_ns), "people": listed}))
        out.write(f"{stamp_ns}\n")
        if (left_s := begun_s + (k + 1) / rate_hz - time.monotonic()) > 0:
            time.sleep(left_s)


def record(node: Any, out: TextIO) -> None:
    """Write stamps of forecasts and when they came, ns, until none has come for `SILENCE_S`."""
    import rclpy
    from sensor_msgs.msg import PointCloud2

    latest_s = time.monotonic() + STREAM_LIMIT_S

    def receive(cloud: PointCloud2) -> None:
        nonlocal latest_s
        stamp, latest_s = cloud.header.stamp, time.monotonic()
        out.write(f"{stamp.sec * 10**9 + stamp.nanosec} {time.time_ns()}\n")

    node.create_subscription(PointCloud2, "predictions", receive, DEPTH)
    while time.monotonic() < latest_s + SILENCE_S:
        rclpy.spin_once(node, timeout_sec=0.1)


def stream() -> None:
    """Publish or record in a process of its own: `publish FILE PEOPLE RATE_HZ SECONDS`, `record FILE`."""
    import rclpy

    role, path, *numbers = sys.argv[1:]
    rclpy.init()
    node = rclpy.create_node(role)
    with Path(path).open("w") as out:
        if role == "publish":
            people, rate_hz, seconds = map(float, numbers)
            publish(node, out, int(people), rate_hz, seconds)
        else:
            record(node, out)
    node.destroy_node()
    rclpy.shutdown()


# In this Python


def resident_mib(process: subprocess.Popen) -> float:
    """Memory of a process that is in RAM, MiB."""
    text = Path(f"/proc/{process.pid}/status").read_text()
    return int(re.findall(r"VmRSS:\s+(\d+)", text)[0]) / 1024


def processor_s(process: subprocess.Popen) -> float:
    """Time on a core of all threads of a process so far, s."""
    ticks = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()[11:13]
    return sum(map(int, ticks)) / os.sysconf("SC_CLK_TCK")


def end(processes: Sequence[subprocess.Popen]) -> None:
    """End processes, and those that have not ended by themselves after some time by force."""
    for process in processes:
        process.terminate()
    until_s = time.monotonic() + _LIMIT_S
    for process in processes:
        try:
            process.wait(max(until_s - time.monotonic(), 0.0))
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def measure(folder: Path, people: int, rate_hz: float, seconds: float) -> dict[str, Any]:
    """Run the three processes and measure them."""
    environment = os.environ | {
        "ROS_DOMAIN_ID": "99",
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_LOG_DIR": str(folder),
        "PYTHONPATH": f"{ROOT}:{ROOT / 'tests/ros_packages'}",
    }
    sent, received, log = (folder / name for name in ("sent", "received", "log"))
    node = ["-m", "pedpred.ros2", "--ros-args", "-p", "use_map:=false", "--disable-rosout-logs"]
    commands = [
        ["-c", STREAM, "record", received],
        ["-c", STREAM, "publish", sent, str(people), str(rate_hz), str(seconds)],
        node,
    ]
    with log.open("w") as out:
        recorder, publisher, node = (
            subprocess.Popen([PYTHON, *command], env=environment, stdout=out, stderr=subprocess.STDOUT)
            for command in commands
        )
    samples, begun_s = [], time.monotonic()
    try:
        while publisher.poll() is None and time.monotonic() < begun_s + seconds + _LIMIT_S:
            samples.append((time.time(), resident_mib(node), processor_s(node), os.getloadavg()[0]))
            time.sleep(_WATCH_S)
        recorder.wait(_LIMIT_S)
    finally:
        end([node, publisher, recorder])
    times_ns = np.loadtxt(received, np.int64, ndmin=2)
    if not times_ns.size:
        raise SystemExit(f"no forecast came; output of the processes:\n{log.read_text()}")
    active_s = float(_ACTIVE.findall(log.read_text())[0])
    sent_ns = np.loadtxt(sent, np.int64, ndmin=1)
    due_ns = sent_ns[sent_ns >= times_ns[0, 0]]
    latency_ms = (times_ns[:, 1] - times_ns[:, 0]) / 1e6
    watched = np.array(samples)
    settled = watched[watched[:, 0] >= active_s + min(_SETTLED_S, seconds / 2)]
    during = (due_ns >= settled[0, 0] * 1e9) & (due_ns <= settled[-1, 0] * 1e9)
    return {
        "people": people,
        "rate_hz": rate_hz,
        "first_s": times_ns[0, 1] / 1e9 - active_s,
        "messages": len(due_ns),
        "lost": len(np.setdiff1d(due_ns, times_ns[:, 0])),
        "median_ms": float(np.median(latency_ms)),
        "95 %_ms": float(np.percentile(latency_ms, 95)),
        "largest_ms": float(latency_ms.max()),
        "processor_ms": 1000 * (settled[-1, 2] - settled[0, 2]) / during.sum(),
        "memory_mib": settled[-1, 1],
        "grown_mib": settled[-1, 1] - settled[0, 1],
        "load": settled[:, 3].mean(),
    }


@user_errors()
def main() -> None:
    """Measure, print, and keep the figures when asked to."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.ros", description=__doc__)
    parser.add_argument("--seconds", type=positive, default=300.0)
    parser.add_argument("--people", type=count, default=20)
    parser.add_argument("--rate-hz", type=positive, default=30.0)
    parser.add_argument("--json", type=output, help="write the figures there")
    options = parser.parse_args()
    if not PYTHON.exists():
        raise InputError(PYTHON, "", "it is missing", "Run `make ros`")
    with tempfile.TemporaryDirectory() as folder:
        row = measure(Path(folder), options.people, options.rate_hz, options.seconds)
    show("The node with a publisher and a recorder, best effort", [row])
    keep(row, options.json)


if __name__ == "__main__":
    main()
