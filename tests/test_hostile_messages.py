"""What sensors, simulators and other nodes send by mistake: nothing stops a robot's forecasts for long."""

from contextlib import suppress

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from pedpred.errors import PedpredError
from pedpred.ros.message_types import UPDATE_TYPE, serialize
from pedpred.ros2.diagnostics import Latencies, status_values
from tests.bags import GRID, PEOPLE, TF
from tests.following import answered, follower_of, people, rows_of

ODD = st.sampled_from([0.0, -0.0, 1.0, -3.0, 1e-300, 1e8, 1e9, 1e300, np.inf, -np.inf, np.nan])
FRAMES = st.sampled_from(["map", "/map", "", "odom", "camera", "world", "m\u00e4p"])
STAMPS = (
    st.sampled_from([-(2**31), -5, 0, 3, 3, 4, 100, 2**31 - 1]),
    st.sampled_from([0, 1, 10**9, 2**32 - 1]),
)
NAMES = st.sampled_from(
    ["", "anna", "7", "007", "-1", "7.0", "9" * 19, "9" * 5000, "\u0667", "x" * 300, "a\nb"]
)


def headers(frames=FRAMES):
    made = st.builds(lambda sec, nanosec: {"sec": sec, "nanosec": nanosec}, *STAMPS)
    return st.builds(lambda stamp, frame: {"stamp": stamp, "frame_id": frame}, made, frames)


POINTS = st.fixed_dictionaries({"x": ODD, "y": ODD, "z": ODD})
TURNS = st.fixed_dictionaries({"x": ODD, "y": ODD, "z": ODD, "w": ODD}) | st.just({"z": 0.6, "w": 0.8})
LISTED = st.lists(st.fixed_dictionaries({"name": NAMES, "position": POINTS}), max_size=6)
CELLS = st.lists(st.sampled_from([-128, -1, 0, 50, 100, 127]), max_size=9).map(lambda x: np.array(x, np.int8))
SIZES = st.sampled_from([0, 1, 3, 20_000, 2**31, 2**32 - 1])
INFO = st.fixed_dictionaries(
    {
        "resolution": ODD.filter(lambda x: not 1e38 < abs(x) < np.inf) | st.just(0.05),
        "width": SIZES,
        "height": SIZES,
        "origin": st.fixed_dictionaries({"position": POINTS, "orientation": TURNS}),
    }
)
EDGES = st.fixed_dictionaries(
    {
        "header": headers(),
        "child_frame_id": FRAMES,
        "transform": st.fixed_dictionaries({"translation": POINTS, "rotation": TURNS | st.just({"w": 1.0})}),
    }
)
MESSAGES = {
    "take_people": (PEOPLE, st.fixed_dictionaries({"header": headers(), "people": LISTED})),
    "take_map": (GRID, st.fixed_dictionaries({"header": headers(), "info": INFO, "data": CELLS})),
    "take_map_update": (
        UPDATE_TYPE,
        st.fixed_dictionaries(
            {"header": headers(), "x": st.integers(-2, 2), "y": st.integers(-2, 2), "width": SIZES}
            | {"height": SIZES, "data": CELLS}
        ),
    ),
    "take_transforms": (TF, st.fixed_dictionaries({"transforms": st.lists(EDGES, max_size=5)})),
}
SENT = st.one_of(
    *[st.tuples(st.just(name), made.map(lambda one, kind=kind: serialize(kind, one)))
      for name, (kind, made) in MESSAGES.items()],
    st.tuples(st.sampled_from(sorted(MESSAGES)), st.binary(max_size=60)),
)  # fmt: skip
MORE = {"take_people": (10**9,), "take_transforms": (7.0,)}


def take(follower, name, raw, now_s, fixed):
    """Hand over a message as the node does, which logs every error and goes on."""
    more = MORE.get(name, ())
    more += (now_s,) if name == "take_people" else (fixed,) if name == "take_transforms" else ()
    with suppress(PedpredError):
        getattr(follower if name.startswith("take_map") else follower.inbox, name)(raw, *more)


def drain(follower, now_s):
    """Make all outputs, as bytes, and go on after an error, as the node does."""
    while True:
        try:
            for output in follower.outputs(now_s):
                serialize(output.kind, output.content)
            return
        except PedpredError:
            continue


@settings(max_examples=25)
@given(st.lists(st.tuples(SENT, st.booleans()), max_size=25))
def test_after_whatever_messages_a_sound_stream_is_forecast(sent):
    """From its first frame on, with all people; every error on the way is one of the package."""
    follower = follower_of(use_map=True, occupancy_cell_m=0.5)
    for k, ((name, raw), fixed) in enumerate(sent):
        take(follower, name, raw, k / 100, fixed)
        drain(follower, k / 100)
    drain(follower, 10.0)
    status_values(follower, Latencies())
    for k in range(3):
        walk = {"anna": (40.0 + k / 10, 0.0), "8": (50.0, 0.0)}
        published = answered(follower, people(1000.0 + k, follower.map.frame, **walk), 20.0 + k)
        rows = rows_of(published["predictions"])
        assert len(np.unique(rows[["track_id", "track_high"]])) == 2
        assert all(np.isfinite(rows[name]).all() for name in ("x", "y", "weight", "cov_xx", "cov_yy"))
