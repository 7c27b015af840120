"""The laboratory recordings, read as configured, are what is known about them."""

from dataclasses import replace

import numpy as np
import pytest
import yaml

from pedpred.scenes import checked_placement
from pedpred.simulation.sensor import SensorSettings, apply_sensor
from pedpred.sources import SOURCES
from tests.conftest import ROOT
from tests.worlds import PLACES

SENSORS = yaml.safe_load((ROOT / "conf/sensors/detectors.yaml").read_text())
FACTS = {  # people, detections, first and last frame, frames per second; width of passages and where
    "lab_corner": (137, 18704, 53, 885, 16, 3.0, [(1.0, None)]),
    "lab_t_junction": (134, 13569, 89, 1088, 16, 2.4, [(None, 2.0), (-4.0, None), (3.0, None)]),
    "lab_bottleneck": (348, 128783, 0, 958, 16, 3.0, [(None, -0.5), (None, 0.0), (None, 0.5)]),
    "lab_crossing": (223, 83897, 721, 1250, 25, 4.0, [(-2.0, None), (None, 4.5)]),
}


@pytest.fixture(scope="module", params=FACTS)
def place(request, laboratory_folder):
    """A recording as configured, and its name."""
    row = PLACES[request.param]
    return SOURCES[row["source"]](laboratory_folder, request.param, row["settings"]), request.param


def test_people_and_frames(place):
    scene, name = place
    people, detections, first, last, rate_hz, *_ = FACTS[name]
    seen = scene.trajectories
    assert (len(np.unique(seen.track_id)), len(seen)) == (people, detections)
    assert (seen.time_s.min(), seen.time_s.max()) == (first / rate_hz, last / rate_hz)
    assert scene.detection_dt_s == pytest.approx(1 / rate_hz)


def test_nobody_is_in_a_wall_or_off_the_map(place):
    scene, _ = place
    cells = scene.occupancy.cell_of(scene.trajectories.position)
    assert ((cells >= 0) & (cells < scene.occupancy.occupied.shape)).all()
    assert not scene.occupancy.is_occupied(scene.trajectories.position).any()


def test_a_map_that_is_drawn_wrongly_is_noticed(place, caplog):
    """The bottleneck and the crossing are nearly their own mirror images in one direction."""
    scene, name = place
    assert checked_placement(scene).worst == 0.0
    assert not caplog.records
    for x, y in ((-1, 1), (1, -1)):
        ground = replace(scene.occupancy, occupied=scene.occupancy.occupied[::x, ::y])
        checked_placement(replace(scene, occupancy=ground))
    assert len(caplog.records) == (1 if name in ("lab_bottleneck", "lab_crossing") else 2)


def test_passages_keep_their_width(place):
    scene, name = place
    ground, (*_, width_m, lines) = scene.occupancy, FACTS[name]
    for x, y in lines:  # a cut across the map, where one coordinate is fixed
        column, row = ground.cell_of(np.array([x or 0.0, y or 0.0]))
        cut = ground.occupied[:, row] if x is None else ground.occupied[column]
        assert (~cut).sum() * ground.resolution_m == pytest.approx(width_m)


def test_corridors_go_on_beyond_their_open_ends(place):
    scene, name = place
    settings = PLACES[name]["settings"]
    middle = scene.trajectories.position.mean(axis=0)
    for edge in np.array(settings["open_ends"], dtype=float):
        outwards = np.array([1.0, -1.0]) * (edge[1] - edge[0])[::-1] / np.linalg.norm(edge[1] - edge[0])
        outwards *= np.sign(outwards @ (edge.mean(axis=0) - middle))
        ahead = edge.mean(axis=0) + outwards * np.arange(0.1, settings["open_end_m"], 0.1)[:, None]
        assert not scene.occupancy.is_occupied(ahead).any()
        beside = ahead + 1.05 * (edge[1] - edge[0]) / 2
        assert scene.occupancy.is_occupied(beside).all()


def test_the_tracker_gets_detections_at_the_rate_of_a_robot(place):
    scene, name = place
    sensor = SensorSettings(**SENSORS[PLACES[name]["sensor"]])
    seen = apply_sensor(scene, sensor, np.random.default_rng(0))
    assert seen.detection_dt_s == pytest.approx(0.4 if name == "lab_crossing" else 0.375)
    assert seen.trajectories.usual_interval_s() == pytest.approx(seen.detection_dt_s)
    assert set(map(tuple, seen.trajectories.position)) <= set(map(tuple, scene.trajectories.position))
