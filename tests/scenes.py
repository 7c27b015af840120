"""Any small scenes, and their comparison."""

from dataclasses import fields, is_dataclass

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pedpred.geometry import Homography
from pedpred.scenes import Camera, OccupancyMap, Scene, Trajectories
from pedpred.storage.scenes import write_scene
from pedpred.storage.tracks import tracks_table

number = st.floats(-1e6, 1e6)


@st.composite
def maps(draw, coordinate=number):
    occupied = draw(arrays(bool, st.tuples(st.integers(1, 9), st.integers(1, 9))))
    return OccupancyMap(occupied, draw(arrays(float, 2, elements=coordinate)), draw(st.floats(1e-3, 10.0)))


@st.composite
def scenes(draw, time_s=number, track_id=st.integers(0, 99)):  # noqa: B008
    """Any few people on any small map, with or without a camera and what only simulation knows."""
    rows = draw(st.integers(0, 6))
    column, pairs = arrays(float, rows, elements=number), arrays(float, (rows, 2), elements=number)
    times = draw(arrays(float, rows, elements=time_s))
    tracks = draw(arrays(np.int64, rows, elements=track_id))
    assume(len(set(zip(times.tolist(), tracks.tolist(), strict=True))) == rows)
    whole = arrays(np.int64, rows, elements=st.integers(-(2**63), 2**63 - 1))
    known = [draw(st.none() | values) for values in (pairs, pairs, column, whole, whole)]
    names = ("velocity", "goal", "desired_speed_mps", "group_id", "person_id")
    assert {"time_s", "track_id", "position", *names} == {field.name for field in fields(Trajectories)}
    trajectories = Trajectories(times, tracks, draw(pairs), **dict(zip(names, known, strict=True)))
    picture = draw(st.none() | arrays(np.uint8, (2, 3, 3)))
    camera = None if picture is None else Camera(Homography(np.diag([0.1, 0.3, 1.0]), 1), picture)
    remark = st.none() | st.text("ab \n\u00e9", max_size=9)
    why, how = draw(remark) if not rows else None, draw(remark)
    return Scene("place", trajectories, draw(maps()), draw(st.floats(1e-3, 10.0)), camera, why, how)


def assert_same(left, right):
    """Equality, field by field, to the last bit."""
    assert type(left) is type(right)
    for field in fields(left):
        one, other = getattr(left, field.name), getattr(right, field.name)
        if is_dataclass(one):
            assert_same(one, other)
        else:
            np.testing.assert_array_equal(one, other, err_msg=field.name)


def write_as_table(scene, folder, **options):
    """Write a scene folder as somebody else would: detections as CSV, and no map."""
    (folder / "tracks.csv").unlink(missing_ok=True)
    write_scene(scene, folder)
    for name in ("tracks.parquet", "map.yaml", "map.pgm"):
        (folder / name).unlink()
    tracks_table(scene.trajectories).to_csv(folder / "tracks.csv", index=False, **options)
