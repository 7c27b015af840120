"""Recordings with forecasts, and their messages."""

import numpy as np
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from pedpred.geometry import rotate
from pedpred.ros.message_types import MARKERS
from tests.forecasts import windows_with
from tests.worlds import walled_scene

STEPS = 10
SHOWN = {"lstm": (1.0, 0.5, 0.0)}
LINES = {"truth", "lstm"}


def small_scene(tracks=3, detections=12):
    return walled_scene(np.random.default_rng(0), truth=True, tracks=tracks, detections=detections)


def walking_on(scene):
    """One window per detection, forecast and truth straight ahead along the true velocity."""
    people = scene.trajectories
    heading = np.arctan2(people.velocity[:, 1], people.velocity[:, 0])
    path = people.position[:, None] + 0.3 * np.arange(1, STEPS + 1)[:, None] * people.velocity[:, None]
    seen = {"track_id": people.track_id, "time_s": people.time_s, "heading_rad": heading}
    local = rotate(people.velocity, -heading)
    return windows_with(people.position, path, {"lstm": path}, velocity=local, **seen)


def decoded(path):
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return reader.get_header().profile, list(reader.iter_decoded_messages(log_time_order=False))


def contents(path, wanted=MARKERS):
    """The messages of one topic."""
    return [content for _, channel, _, content in decoded(path)[1] if channel.topic == wanted]
