"""Publish people, or record when forecasts come; `benchmarks.ros` runs it with a Python that has rclpy.

`publish FILE PEOPLE RATE_HZ SECONDS`: walkers on `people`, best effort, stamped with the time of sending,
until somebody has listened for so long. `record FILE`: forecasts on `predictions`, until none has come for
`SILENCE_S`. Lines of the file: stamp (ns); of a record also when the forecast of that stamp came (ns).
"""

from __future__ import annotations

import sys
import time
from itertools import count
from pathlib import Path
from typing import Any, TextIO

import numpy as np
import rclpy
from people_msgs.msg import People
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import PointCloud2

from pedpred.ros.message_types import serialize
from pedpred.ros.scene_messages import header

SILENCE_S, LIMIT_S, DEPTH = 3.0, 60.0, 200
ROOM_M = 20.0


def publish(node: Any, out: TextIO, people: int, rate_hz: float, seconds: float) -> None:
    """Publish people at a rate until somebody has listened for so many seconds."""
    rng = np.random.default_rng(0)
    start, velocity = rng.uniform(0.0, ROOM_M, (people, 2)), rng.normal(0.0, 1.0, (people, 2))
    sink = node.create_publisher(
        People, "people", QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    )
    begun_s, end_s = time.monotonic(), time.monotonic() + LIMIT_S
    heard = False
    for k in count():
        if not heard and sink.get_subscription_count():
            heard, end_s = True, time.monotonic() + seconds
        if time.monotonic() > end_s:
            break
        places = ROOM_M / 2 + np.abs((start + velocity * k / rate_hz) % (2 * ROOM_M) - ROOM_M) / 2
        listed = [
            {"name": str(i + 1), "position": {"x": float(x), "y": float(y)}}
            for i, (x, y) in enumerate(places)
        ]
        stamp_ns = time.time_ns()
        sink.publish(serialize("people_msgs/msg/People", {"header": header(stamp_ns), "people": listed}))
        out.write(f"{stamp_ns}\n")
        if (left_s := begun_s + (k + 1) / rate_hz - time.monotonic()) > 0:
            time.sleep(left_s)


def record(node: Any, out: TextIO) -> None:
    """Note when forecasts come, until none has come for a while."""
    latest_s = time.monotonic() + LIMIT_S

    def came(cloud: PointCloud2) -> None:
        nonlocal latest_s
        stamp, latest_s = cloud.header.stamp, time.monotonic()
        out.write(f"{stamp.sec * 10**9 + stamp.nanosec} {time.time_ns()}\n")

    node.create_subscription(PointCloud2, "predictions", came, DEPTH)
    while time.monotonic() < latest_s + SILENCE_S:
        rclpy.spin_once(node, timeout_sec=0.1)


def main() -> None:
    """Do one of the two."""
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


if __name__ == "__main__":
    main()
