"""A process that publishes, records raw messages or manages a node: `python peer.py PLAN`, a JSON file.

A publisher: {"publish": [[topic, type, qos]], "probe": [[index of publisher, hex]],
    "beat": [index, hex], "send": [[time_s, index, hex]], "limit_s": number, "ready": file,
    "sent": file, "done": file}
Where the plan has `ready`, it waits until somebody listens to each topic, then sends the probes and the beat
again and again until the file is there, the beat each time with a later stamp, so that it is answered each
time; times of `send` count from then on. It makes the file `sent`, if the plan has it, when all is sent, and
stays until the file `done` is there: what is on its way may be lost with its sender.

A recorder: {"record": [[topic, type, qos]], "until": {topic: count}, "out": file, "limit_s": number,
    "answers": [topic], "since_s": number, "ready": file, "done": file}
It makes the file `ready` when an answer to the beat has come on each of the topics in `answers`: then all is
connected. Lines of `out` are what comes afterwards: topic, seconds of the monotonic clock, hex; answers with
an earlier stamp than `since_s` are to the beat and left out. It ends after so many messages, or with an error
when none of them has come for `limit_s`, and then makes the file `done`.

A manager: {"transitions": [label], "node": name, "out": file, "limit_s": number}

A qos is two letters: r(eliable) or b(est effort), v(olatile) or t(ransient local).
"""

import importlib
import json
import struct
import sys
import time
from collections import Counter
from pathlib import Path

import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

TICK_S, PROBE_S, LATER_NS = 0.02, 0.1, 10**7
_STAMP = struct.Struct("<iI")
_STAMP_AT = 4  # after the header of CDR, where a message begins with a std_msgs/Header


def qos_of(letters):
    reliable = {"r": ReliabilityPolicy.RELIABLE, "b": ReliabilityPolicy.BEST_EFFORT}[letters[0]]
    lasting = {"v": DurabilityPolicy.VOLATILE, "t": DurabilityPolicy.TRANSIENT_LOCAL}[letters[1]]
    return QoSProfile(depth=200, reliability=reliable, durability=lasting)


def class_of(kind):
    package, _, name = kind.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), name)


def until(node, limit_s, is_there, what, each_tick=lambda: None):
    """Handle messages until something is there."""
    end_s = time.monotonic() + limit_s
    while not is_there():
        if time.monotonic() > end_s:
            raise SystemExit(f"waited {limit_s} s for {what}")
        each_tick()
        rclpy.spin_once(node, timeout_sec=TICK_S)


def stamp_ns(raw):
    second, nanosecond = _STAMP.unpack_from(raw, _STAMP_AT)
    return second * 10**9 + nanosecond


def later(raw, by_ns):
    """A message that begins with a header, with a later stamp."""
    changed = bytearray(raw)
    _STAMP.pack_into(changed, _STAMP_AT, *divmod(stamp_ns(raw) + by_ns, 10**9))
    return bytes(changed)


def publish(node, plan):
    sinks = [
        node.create_publisher(class_of(kind), topic, qos_of(qos)) for topic, kind, qos in plan["publish"]
    ]
    limit_s = plan["limit_s"]
    if "ready" in plan:
        sent_s, count, (beating, beat) = -PROBE_S, 0, plan["beat"]

        def probe():
            nonlocal sent_s, count
            if time.monotonic() - sent_s >= PROBE_S:
                sent_s, count = time.monotonic(), count + 1
                for index, text in plan["probe"]:
                    sinks[index].publish(bytes.fromhex(text))
                sinks[beating].publish(later(bytes.fromhex(beat), count * LATER_NS))

        topics = " ".join(topic for topic, _, _ in plan["publish"])
        heard = lambda: all(sink.get_subscription_count() for sink in sinks)  # noqa: E731
        until(node, limit_s, heard, f"subscribers of {topics}")
        until(node, limit_s, Path(plan["ready"]).exists, "the recorder to hear all probes", probe)
    begun_s = time.monotonic()
    for at_s, index, text in plan["send"]:
        while (left_s := begun_s + at_s - time.monotonic()) > 0:
            rclpy.spin_once(node, timeout_sec=min(left_s, TICK_S))
        sinks[index].publish(bytes.fromhex(text))
    if "sent" in plan:
        Path(plan["sent"]).touch()
    until(node, 2 * limit_s, Path(plan["done"]).exists, "the recorder to end")


def record(node, plan):
    answered, counts, heard_s = set(), Counter(), {}
    ready, limit_s = Path(plan["ready"]), plan["limit_s"]
    with Path(plan["out"]).open("w") as out:

        def note(topic, raw):
            heard_s[topic] = time.monotonic()
            if topic in plan["answers"] and stamp_ns(raw) < plan["since_s"] * 10**9:
                answered.add(topic)
            elif ready.exists():
                counts[topic] += 1
                out.write(f"{topic} {time.monotonic()} {raw.hex()}\n")

        for topic, kind, qos in plan["record"]:
            node.create_subscription(
                class_of(kind), topic, lambda raw, topic=topic: note(topic, raw), qos_of(qos), raw=True
            )
        until(node, 2 * limit_s, lambda: answered >= set(plan["answers"]), f"answers on {plan['answers']}")
        ready.touch()
        for topic, count in plan["until"].items():
            heard_s[topic] = time.monotonic()
            while counts[topic] < count:
                if time.monotonic() - heard_s[topic] > limit_s:
                    heard = f"{counts[topic]} of {count} messages on {topic}"
                    raise SystemExit(f"heard {heard}, and none for {limit_s} s")
                rclpy.spin_once(node, timeout_sec=TICK_S)


def manage(node, plan):
    """Ask a lifecycle node for transitions; write whether they succeeded."""
    from lifecycle_msgs.srv import ChangeState

    service = f"{plan['node']}/change_state"
    client = node.create_client(ChangeState, service)
    if not client.wait_for_service(plan["limit_s"]):
        raise SystemExit(f"waited {plan['limit_s']} s for the service {service}")
    numbers = {"configure": 1, "activate": 3, "deactivate": 4, "cleanup": 2}
    with Path(plan["out"]).open("w") as out:
        for label in plan["transitions"]:
            asked = ChangeState.Request()
            asked.transition.label, asked.transition.id = label, numbers[label]
            answer = client.call_async(asked)
            until(node, plan["limit_s"], answer.done, f"an answer to {label}")
            out.write(f"{label} {answer.result().success}\n")


def main():
    plan = json.loads(Path(sys.argv[1]).read_text())
    rclpy.init()
    node = rclpy.create_node("peer_" + Path(sys.argv[1]).stem)
    try:
        if "transitions" in plan:
            manage(node, plan)
        elif "record" in plan:
            record(node, plan)
        else:
            publish(node, plan)
    finally:
        if "record" in plan:
            Path(plan["done"]).touch()
        node.destroy_node()
        rclpy.shutdown()


main()
