"""The node, publishers and recorders as processes of their own, which hear each other alone."""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from itertools import count
from pathlib import Path

from pedpred.ros.message_types import known_types
from tests.conftest import ROOT

PYTHON = ROOT / "build/ros/bin/python"
if not PYTHON.exists():
    PYTHON = Path(sys.executable)

NODE = PYTHON, "-m", "pedpred.ros2"
PACKAGES = ROOT / "tests/ros_packages"
CLOUD = "sensor_msgs/msg/PointCloud2"
LIMIT_S = 180


class Place:
    """Processes that hear each other; none outlives the test."""

    def __init__(self, folder, domain):
        self.folder, self.plans, self.processes = folder, count(), []
        self.environment = os.environ | {
            "ROS_DOMAIN_ID": domain,
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_LOG_DIR": str(folder / "log"),
            "PYTHONPATH": f"{PACKAGES}:{ROOT}",
            "PYTHONUNBUFFERED": "1",
        }

    def start(self, command, log):
        """Run a command, whose output is written to the file `log`."""
        with log.open("w") as out:
            process = subprocess.Popen(
                command, stdout=out, stderr=subprocess.STDOUT, env=self.environment, cwd=self.folder
            )
        self.processes.append(process)
        return process

    def run(self, command, **environment):
        """Run a command to its end."""
        how = {"cwd": self.folder, "capture_output": True, "text": True, "timeout": LIMIT_S, "check": False}
        return subprocess.run(command, env=self.environment | environment, **how)

    def wait(self, is_there, what, log=None):
        """Wait for something, at most `LIMIT_S`; the error has the text of the file `log`."""
        end_s = time.monotonic() + LIMIT_S
        while not is_there():
            text = log.read_text() if log else ""
            assert time.monotonic() < end_s, f"no {what} within {LIMIT_S} s {text}"
            time.sleep(0.05)

    def close(self):
        """Kill what still runs."""
        for process in self.processes:
            process.kill()
            process.wait(LIMIT_S)

    @contextmanager
    def node(self, *arguments, ready="forecasting people", number=signal.SIGTERM, command=NODE):
        """Run the node until the block ends, then end it by a signal; its output is in `log`."""
        log = self.folder / "node.txt"
        patient = "-p", "max_wait_s:=3600.0"  # a busy machine may be slow
        process = self.start([*command, "--ros-args", *arguments, *patient], log)
        self.wait(lambda: process.poll() is not None or ready in log.read_text(), repr(ready), log)
        assert process.poll() is None, log.read_text()
        try:
            yield log
        except subprocess.TimeoutExpired as cause:
            raise AssertionError(f"{cause}; the node printed {log.read_text()}") from cause
        assert process.poll() is None, f"the node has ended: {log.read_text()}"
        process.send_signal(number)
        assert process.wait(LIMIT_S) == 0, log.read_text()
        assert "Traceback" not in log.read_text()

    def peer(self, **plan):
        """Start a process of ros_packages/peer.py; returns it, its record and its output."""
        path = self.folder / f"plan{next(self.plans)}.json"
        out, log = path.with_suffix(".out"), path.with_suffix(".txt")
        path.write_text(json.dumps({"out": str(out), "limit_s": LIMIT_S} | plan))
        return self.start([PYTHON, PACKAGES / "peer.py", path], log), out, log

    def exchange(self, publish, beat, send, record, until, probe=(), since_s=100):
        """Publish in one process, record in another one; returns topic -> messages as they were received.

        Args:
            publish: topic, type, QoS of each publisher.
            beat: index of a publisher and an empty message, sent with later and later stamps until forecasts
                arrive.
            send: time (s), index of a publisher, message.
            record: topic, type, QoS.
            until: topic -> how many messages are awaited.
            probe: further messages that are sent with the beat.
            since_s: earlier forecasts are those of the beat.
        """
        number = next(self.plans)
        shared = {name: str(self.folder / f"{name}{number}") for name in ("ready", "done")}
        answers = [topic for topic, kind, _ in record if kind == CLOUD]
        asked = {"until": until, "answers": answers, "since_s": since_s}
        recorder, out, recorder_log = self.peer(record=record, **asked, **shared)
        sender, _, sender_log = self.peer(publish=publish, probe=probe, beat=beat, send=send, **shared)
        longest_s = 4 * LIMIT_S + send[-1][0]  # each wait of a peer ends before
        codes = recorder.wait(longest_s), sender.wait(longest_s)
        logs = recorder_log, sender_log, self.folder / "node.txt"
        assert codes == (0, 0), "\n".join(log.read_text() for log in logs)
        kinds = {topic: kind for topic, kind, _ in record}
        received = {topic: [] for topic in kinds}
        for line in out.read_text().splitlines():
            topic, _, text = line.split()
            received[topic].append(known_types().deserialize_cdr(bytes.fromhex(text), kinds[topic]))
        return received
