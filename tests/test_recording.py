"""Recordings are read as bags and by standard ROS 2 tools; animations and layouts show them."""

import json
from dataclasses import replace

import numpy as np
import pytest
import yaml
from PIL import Image, ImageSequence

from pedpred.errors import ValueRuleError
from pedpred.geometry import rotate
from pedpred.metrics.calibration import radius2, squared_mahalanobis
from pedpred.report.animation import Animation, busiest_start, positions_at, write_animation
from pedpred.ros import check_recordable, read_bag, write_recording
from pedpred.ros.foxglove import write_layout
from pedpred.ros.message_types import FRAMES, MAP, MARKERS, PEOPLE, TYPES
from pedpred.scenes import Predictions, Trajectories
from tests.forecasts import METHODS
from tests.recorded import LINES, SHOWN, STEPS, contents, decoded, small_scene, walking_on
from tests.refused import refused


@pytest.mark.parametrize("has_velocity", [True, False])
def test_a_recording_is_read_as_a_bag(tmp_path, has_velocity):
    """People and map come back; stamps have whole nanoseconds."""
    scene = small_scene()
    if not has_velocity:
        scene = replace(scene, trajectories=replace(scene.trajectories, velocity=None))
    write_recording(scene, tmp_path / "hall.mcap")
    found = read_bag(tmp_path / "hall.mcap")
    assert found.name == "hall"
    for name in ("track_id", "position"):
        expected = getattr(scene.trajectories, name)[
            np.lexsort((scene.trajectories.track_id, scene.trajectories.time_s))
        ]
        np.testing.assert_array_equal(getattr(found.trajectories, name), expected)
    np.testing.assert_allclose(found.trajectories.time_s, scene.trajectories.time_s, atol=1e-9)
    np.testing.assert_array_equal(found.occupancy.occupied, scene.occupancy.occupied)
    np.testing.assert_allclose(found.occupancy.origin, scene.occupancy.origin)
    assert found.occupancy.resolution_m == pytest.approx(scene.occupancy.resolution_m)


def test_every_message_can_be_read_and_has_its_time_and_frame(tmp_path):
    scene = small_scene()
    for name in ("scene.mcap", "again.mcap"):
        write_recording(scene, tmp_path / name, walking_on(scene), SHOWN)
    assert (tmp_path / "scene.mcap").read_bytes() == (tmp_path / "again.mcap").read_bytes()
    profile, messages = decoded(tmp_path / "scene.mcap")
    assert profile == "ros2"
    assert {channel.topic: schema.name for schema, channel, _, _ in messages} == TYPES
    times = [message.log_time for _, _, message, _ in messages]
    assert times == sorted(times)
    assert len([channel for _, channel, _, _ in messages if channel.topic == MAP]) == 1
    instants = iter(np.unique(scene.trajectories.time_s))
    for _, channel, message, content in messages:
        nested = {MARKERS: "markers", FRAMES: "transforms"}.get(channel.topic)
        for part in getattr(content, nested) if nested else [content]:
            assert part.header.stamp.sec * 10**9 + part.header.stamp.nanosec == message.log_time
            assert part.header.frame_id == ("world" if channel.topic == FRAMES else "map")
        if channel.topic == PEOPLE:
            assert message.log_time == pytest.approx(1e9 * next(instants), abs=1)
    assert next(instants, None) is None


def test_markers_show_people_and_paths_where_they_are(tmp_path):
    """Instants of forecasts may be rounded."""
    scene = small_scene(tracks=1)
    windows = walking_on(scene)
    windows = replace(windows, time_s=np.abs(windows.time_s - 1e-9))
    write_recording(scene, tmp_path / "scene.mcap", windows, SHOWN)
    for row, content in enumerate(contents(tmp_path / "scene.mcap")):
        clearing, *markers = content.markers
        assert clearing.action == 3
        by_name = {marker.ns: marker for marker in markers}
        assert set(by_name) == {"people", "velocity", *LINES}
        at = by_name["people"].pose.position
        assert (at.x, at.y) == tuple(scene.trajectories.position[row])
        for name in LINES:
            path = [(point.x, point.y) for point in by_name[name].points]
            np.testing.assert_array_equal(path, [windows.position[row], *windows.truth[row]])
        start, end = ((point.x, point.y) for point in by_name["velocity"].points)
        np.testing.assert_allclose(np.subtract(end, start), 0.75 * scene.trajectories.velocity[row])


def test_an_error_ellipse_ends_where_its_share_ends(tmp_path):
    scene = small_scene(tracks=1)
    windows, covariance = walking_on(scene), np.array([[0.5, 0.2], [0.2, 0.3]])
    spread = np.tile(covariance, (len(scene.trajectories), STEPS, 1, 1))
    given = {"lstm": Predictions.single(windows.predictions["lstm"].point, 0.3, spread)}
    write_recording(scene, tmp_path / "scene.mcap", replace(windows, predictions=given), SHOWN)
    for row, content in enumerate(contents(tmp_path / "scene.mcap")):
        disc = next(marker for marker in content.markers if marker.ns == "lstm ellipse")
        centre = np.array([disc.pose.position.x, disc.pose.position.y])
        np.testing.assert_allclose(centre, windows.predictions["lstm"].point[row, -1])
        yaw = 2 * np.arctan2(disc.pose.orientation.z, disc.pose.orientation.w)
        ends = rotate(np.diag([disc.scale.x, disc.scale.y]) / 2, np.array([yaw, yaw]))
        np.testing.assert_allclose(squared_mahalanobis(ends, covariance), radius2(0.9))


def test_modes_are_lines_whose_alpha_is_their_weight(tmp_path):
    scene = small_scene(tracks=2)
    windows, weight = walking_on(scene), np.array([0.75, 0.25])
    point = windows.predictions["lstm"].point
    path, rows = np.stack([point, point + 1.0], axis=1), len(point)
    modes = Predictions(point, path, np.tile(weight, (rows, 1)), windows.dt_s)
    windows = replace(windows, predictions={"lstm": modes})
    write_recording(scene, tmp_path / "scene.mcap", windows, SHOWN)
    drawn = contents(tmp_path / "scene.mcap")
    lines = [[marker for marker in content.markers if marker.ns == "lstm modes"] for content in drawn]
    assert sum(map(len, lines)) == 2 * rows
    for here in lines:
        assert len({marker.id for marker in here}) == len(here), "viewers keep one marker per id"
        np.testing.assert_allclose([marker.color.a for marker in here], np.tile(weight, len(here) // 2))
    first = np.array([(p.x, p.y) for p in lines[0][1].points[1:]])
    row = int(np.flatnonzero(windows.time_s == windows.time_s.min())[0])
    np.testing.assert_array_equal(first, path[row, 1])


def test_what_cannot_be_written_is_named(tmp_path):
    scene = small_scene()
    with refused("method"):
        write_recording(scene, tmp_path / "x.mcap", None, SHOWN)
    early = replace(scene, trajectories=replace(scene.trajectories, time_s=scene.trajectories.time_s - 100))
    for refusing in (check_recordable, lambda scene: write_recording(scene, tmp_path / "x.mcap")):
        with refused("time_s"):
            refusing(early)


def test_the_layout_shows_the_topics_that_are_written(tmp_path):
    write_layout(small_scene().occupancy, ["cv"], tmp_path / "layout.json")
    layout = json.loads((tmp_path / "layout.json").read_text())
    assert set(layout["configById"]["3D!plan"]["topics"]) <= set(TYPES)
    assert {layout["layout"]["first"], layout["layout"]["second"]} == set(layout["configById"])


def test_a_replayed_map_is_latched(tmp_path):
    """As numbers of rmw: 1 is keep last, reliable and transient local, 2 is volatile."""
    write_recording(small_scene(), tmp_path / "x.mcap")
    channels = {channel.topic: channel for _, channel, _, _ in decoded(tmp_path / "x.mcap")[1]}
    durability = {}
    for topic, channel in channels.items():
        (offered,) = yaml.safe_load(channel.metadata["offered_qos_profiles"])
        assert (offered["history"], offered["reliability"], offered["depth"]) == (1, 1, 10)
        durability[topic] = offered["durability"]
    assert durability == {"/map": 1, "/tf_static": 1, "/people": 2, "/markers": 2}


# The animated plan


def test_people_move_between_detections_and_vanish_in_gaps():
    time_s, position = np.array([0.0, 0.4, 2.0]), np.array([[0.0, 0.0], [0.4, 0.8], [2.0, 0.0]])
    trajectories = Trajectories(time_s, np.zeros(3), position)
    np.testing.assert_allclose(positions_at(trajectories, 0.1, 0.6)[0], [0.1, 0.2])
    np.testing.assert_allclose(positions_at(trajectories, 0.4, 0.6)[0], [0.4, 0.8])
    assert positions_at(trajectories, 1.0, 0.6) == {}
    assert positions_at(trajectories, 2.3, 0.6) == {}


def test_the_busiest_stretch_is_found():
    assert busiest_start(np.array([9.0, 0.0, 5.0, 5.5, 6.0, 6.2]), 1.0) == 5.0  # the earliest of two
    with pytest.raises(ValueRuleError):
        busiest_start(np.zeros(0), 1.0)


@pytest.mark.parametrize(("frame_s", "frames"), [(0.2, 5), (0.15, 7)])
def test_an_animation_keeps_the_pace_of_the_people(tmp_path, frame_s, frames):
    scene, films = small_scene(tracks=1), [tmp_path / "a.gif", tmp_path / "b.gif"]
    animation = Animation("lstm", duration_s=1.0, frame_s=frame_s, tail_s=1.0, width_px=80)
    for film in films:
        write_animation(scene, walking_on(scene), animation, METHODS, film)
    assert films[0].read_bytes() == films[1].read_bytes()
    with Image.open(films[0]) as shown:
        assert (shown.n_frames, shown.width) == (frames, 80)
        lengths_ms = [frame.info["duration"] for frame in ImageSequence.Iterator(shown)]
    assert sum(lengths_ms) == pytest.approx(1000 * frame_s * frames, abs=5)
    with pytest.raises(ValueRuleError):
        write_animation(scene, walking_on(scene), replace(animation, method="cv"), METHODS, films[0])
