"""A process that publishes and records raw messages: `python peer.py PLAN`, a JSON file.

    {"publish": [[topic, type, qos]], "send": [[time_s, index of publisher, hex]],
     "record": [[topic, type, qos]], "out": file, "limit_s": number,
     "until": topic that ends the recording, "count": after so many messages,
     "wait_for": [topic, subscribers], "transitions": [label], "node": of whom}

Times count from when the topic in `wait_for` has so many subscribers. A qos is two letters: r(eliable) or
b(est effort), v(olatile) or t(ransient local). Lines of `out`: topic, seconds of the monotonic clock, hex.
"""

import importlib
import json
import sys
import time
from pathlib import Path

import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy


def qos_of(letters):
    reliable = {"r": ReliabilityPolicy.RELIABLE, "b": ReliabilityPolicy.BEST_EFFORT}[letters[0]]
    lasting = {"v": DurabilityPolicy.VOLATILE, "t": DurabilityPolicy.TRANSIENT_LOCAL}[letters[1]]
    return QoSProfile(depth=200, reliability=reliable, durability=lasting)


def class_of(kind):
    package, _, name = kind.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), name)


def request(node, name, label):
    """Ask a lifecycle node for a transition; whether it succeeded."""
    from lifecycle_msgs.srv import ChangeState

    client = node.create_client(ChangeState, f"{name}/change_state")
    client.wait_for_service()
    asked = ChangeState.Request()
    asked.transition.label = label
    asked.transition.id = {"configure": 1, "activate": 3, "deactivate": 4, "cleanup": 2}[label]
    answer = client.call_async(asked)
    rclpy.spin_until_future_complete(node, answer)
    return answer.result().success


def main():
    plan = json.loads(Path(sys.argv[1]).read_text())
    rclpy.init()
    node = rclpy.create_node("peer_" + Path(sys.argv[1]).stem)
    counts = {}
    with Path(plan["out"]).open("w") as out:

        def record(topic, raw):
            counts[topic] = counts.get(topic, 0) + 1
            out.write(f"{topic} {time.monotonic()} {raw.hex()}\n")
            out.flush()

        for topic, kind, letters in plan.get("record", []):
            node.create_subscription(
                class_of(kind), topic, lambda raw, topic=topic: record(topic, raw), qos_of(letters), raw=True
            )
        sinks = [
            node.create_publisher(class_of(kind), topic, qos_of(letters))
            for topic, kind, letters in plan.get("publish", [])
        ]
        end_s = time.monotonic() + plan["limit_s"]
        topic, number = plan.get("wait_for", ["", 0])
        while number and node.count_subscribers(topic) < number and time.monotonic() < end_s:
            rclpy.spin_once(node, timeout_sec=0.05)
        begun_s, messages = time.monotonic(), plan.get("send", [])
        for at_s, index, text in messages:
            while (left_s := begun_s + at_s - time.monotonic()) > 0:
                rclpy.spin_once(node, timeout_sec=min(left_s, 0.05))
            sinks[index].publish(bytes.fromhex(text))
        for label in plan.get("transitions", []):
            out.write(f"{label} {request(node, plan['node'], label)}\n")
        until, count = plan.get("until"), plan.get("count", 0)
        while time.monotonic() < end_s and counts.get(until, 0) < count:
            rclpy.spin_once(node, timeout_sec=0.05)
    node.destroy_node()
    rclpy.shutdown()


main()
