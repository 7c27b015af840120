"""Pictures show what their rules choose, and draw people, obstacles and curves where they are."""

import dataclasses
import io

import numpy as np
import pytest
import torch
from PIL import Image

from pedpred.geometry import Homography, rotate
from pedpred.metrics.calibration import radius2, squared_mahalanobis
from pedpred.models.lstm.autoencoder import GridAutoencoder
from pedpred.models.lstm.features.grids import occupancy_crops
from pedpred.report.canvas import avif_bytes, png_bytes
from pedpred.report.crops import grid_image
from pedpred.report.drives import episode_figure
from pedpred.report.gallery import draw_gallery
from pedpred.report.gather import Evaluated
from pedpred.report.instants import RULES, choose, depth_m
from pedpred.report.plan import obstacle_image, quarter_turns_of, turn_points
from pedpred.report.scene_picture import ellipse_outline, region_outlines
from pedpred.report.walls import RANKS, wall_windows
from pedpred.scenes import Camera, OccupancyMap, Predictions, Scene, Trajectories
from tests.forecasts import METHODS, windows_with
from tests.reports import MEETING, curves, metrics_of, planned, result_of, room

# Instants are chosen by rules


def chosen(rule, windows, scenes=None, crowd=1):
    """The instant that a rule chooses; scenes are rooms by default."""
    scenes = {name: room(name) for name in windows} if scenes is None else scenes
    return choose(RULES[rule], windows, scenes, crowd, METHODS)


def test_largest_and_smallest_gain_are_chosen():
    scenes = {"plain": planned(room()), "planted": planned(room(), planted_s=1.2)}
    best, least = (chosen(rule, scenes, crowd=4) for rule in ("gain", "loss"))
    assert (best.scene, best.time_s) == ("planted", pytest.approx(1.2))
    assert best.focus in best.rows
    assert (least.scene, least.time_s) == ("plain", 0.0)


AHEAD_S = (np.arange(10) + 1)[:, None] * 0.3


def crossing(starts, velocities, aside_m):
    """People at one instant; the truth gives way by `aside_m` ([n, 2], m) over the 3 s."""
    starts, velocities, aside_m = (np.array(part, float) for part in (starts, velocities, aside_m))
    straight = starts[:, None] + velocities[:, None] * AHEAD_S
    truth = straight + aside_m[:, None] * np.minimum(AHEAD_S, 1.0)
    seen = {"track_id": np.arange(len(starts)) + 7, "velocity": velocities}
    return {"hall": windows_with(starts, truth, {"kalman_cv": straight}, **seen)}


@pytest.mark.parametrize(
    ("velocities", "aside_m", "meet"),
    [
        ([[1, 0], [-1, 0]], [[0, 0.5], [0, -0.5]], True),
        ([[1, 0], [-1, 0]], [[0, 0.1], [0, -0.1]], False),  # they touch
        ([[-1, 0], [1, 0]], [[0, 0.5], [0, -0.5]], False),  # leaving each other
        ([[1, 0], [-0.1, 0]], [[0, 0.5], [0, -0.5]], False),  # one stands
    ],
)
def test_two_people_who_make_room_are_chosen(velocities, aside_m, meet):
    found = chosen("avoidance", crossing([[2, 5], [5, 5]], velocities, aside_m))
    assert (found is not None) == meet
    assert not meet or list(found.rows) == [0, 1]


def blocked():
    occupied = np.zeros((100, 100), bool)
    occupied[40:60, 40:60] = True
    nobody = Trajectories(np.zeros(0), np.zeros(0, int), np.zeros((0, 2)))
    return Scene("hall", nobody, OccupancyMap(occupied, np.zeros(2), 0.1), 0.4)


def test_depth_is_the_way_to_the_nearest_free_cell():
    points = np.array([[5.05, 5.05], [4.05, 5.05], [3.95, 5.05], [99.0, 0.0]])
    np.testing.assert_allclose(depth_m(points, blocked().occupancy), [1.0, 0.1, 0.0, 0.0], atol=0.05)


def test_person_who_turns_before_an_obstacle_is_chosen():
    starts = [[3, 5.05], [3, 4.25], [3, 8], [2.9, 5.05]]  # the last one walks through
    windows = crossing(starts, [[1, 0]] * 4, [[-1.0, 2.5], [-1.0, -2.5], [0, 0], [0, 0]])
    assert chosen("obstacle", windows, {"hall": blocked()}).who == 7


# Windows at walls

AHEAD = np.arange(1, 6)[:, None] * [1.0, 0.0]


def walled(people=9):
    """A wall at x > 6 m, and people who were there at all times."""
    occupied = np.zeros((100, 100), bool)
    occupied[60:] = True
    time_s, track = np.meshgrid([1.0, 2.0, 3.0], range(people), indexing="ij")
    position = np.stack([time_s.ravel(), track.ravel() * 0.5], axis=-1)
    trajectories = Trajectories(time_s.ravel(), track.ravel(), position)
    return Scene("hall", trajectories, OccupancyMap(occupied, np.zeros(2), 0.1), 1.0)


def at_walls(people=9, far=2):
    """Each person is seen at x = 1, 2, 3 and walks 1 m/step; the LSTM is off by 0.1 m per person's number.

    Of 5 steps ahead 0, 1 and 2 end in the wall; the last `far` people stand away and meet none.
    """
    track, x = np.repeat(np.arange(people), 3), np.tile([1.0, 2.0, 3.0], people)
    away = track >= people - far
    position = np.stack([np.where(away, 0.5, x), 0.5 + track], axis=-1)
    straight = position[:, None] + AHEAD * np.where(away, 0.2, 1.0)[:, None, None]
    truth = np.minimum(straight, [5.5, np.inf])
    lstm = truth + 0.1 * track[:, None, None] * [0.0, 1.0]
    return windows_with(position, truth, {"cv": straight, "lstm": lstm}, track_id=track, time_s=x)


def test_worst_window_of_each_person_at_a_wall_counts():
    windows = at_walls()
    rows = wall_windows(windows, walled(), METHODS)
    assert windows.time_s[rows].tolist() == [3.0] * len(RANKS)
    assert windows.track_id[rows].tolist() == [round(6 * rank) for rank in RANKS]
    assert not len(wall_windows(at_walls(people=3, far=3), walled(3), METHODS))


# People, forecasts and inputs


@pytest.mark.parametrize(("place", "row", "column"), [((2, 0), 10, 30), ((0, 2), 30, 10)])
def test_obstacle_ahead_is_drawn_above_and_left_is_left(place, row, column):
    agent = np.array([5.0, 5.0])
    for heading_rad in (0.0, 1.0, -2.5):
        occupied = np.zeros((100, 100), dtype=bool)
        x, y = np.floor((rotate(np.array(place), heading_rad) + agent) * 10 + 1e-9).astype(int)
        occupied[x - 1 : x + 2, y - 1 : y + 2] = True
        ground = OccupancyMap(occupied, np.zeros(2), 0.1)
        crop = occupancy_crops(ground, agent[None], np.array([heading_rad]), 60, 0.1)
        windows = windows_with(agent[None], np.zeros((1, 0, 2)), {}, packed_grid=crop)
        drawn = np.argwhere(grid_image(windows.grid(0))).mean(axis=0) + 0.5
        np.testing.assert_allclose(drawn, (row, column), atol=1.5)


def gaussians(apart_m, weight=(0.6, 0.4)):
    """Two round modes of 1 m spread, one step ahead of one person."""
    path = np.array([[[[0.0, 0.0]], [[apart_m, 0.0]]]])
    covariance = np.tile(np.eye(2), (1, 2, 1, 1, 1))
    return Predictions(path[:, 0], path, np.array([weight]), 0.3, covariance)


def test_region_has_a_part_around_every_likely_mode():
    one = np.concatenate(region_outlines(gaussians(0.0), 0, 0, 0.9))
    np.testing.assert_allclose(np.linalg.norm(one, axis=-1), np.sqrt(radius2(0.9)), rtol=0.02)
    assert len(region_outlines(gaussians(8.0), 0, 0, 0.9)) == 2
    assert len(region_outlines(gaussians(8.0, (0.95, 0.05)), 0, 0, 0.9)) == 1


def test_obstacles_and_people_turn_together():
    occupied = np.zeros((7, 4), dtype=bool)
    occupied[5, 1] = occupied[0, 3] = True
    occupancy = OccupancyMap(occupied, np.array([2.0, -3.0]), 0.5)
    for turns in range(4):
        image, (left, right, bottom, top) = obstacle_image(occupancy, turns)
        centres = turn_points(occupancy.center_of(np.argwhere(occupied)), turns)
        columns, rows = np.floor((centres - [left, bottom]) / 0.5).astype(int).T
        assert image[rows, columns].all()
        assert image.sum() == 2
        assert image.shape == (round((top - bottom) / 0.5), round((right - left) / 0.5))


def test_plan_lies_like_the_picture():
    """A step to the right in the camera's picture is a step to the right in the plan."""
    right_down = np.array([[0.0, 0.02], [-0.02, 0.0]])  # world from (row, column), unturned
    for turns in range(4):
        matrix = np.eye(3)
        matrix[:2, :2] = rotate(right_down.T, np.array(-turns * np.pi / 2)).T
        camera = Camera(Homography(matrix), np.zeros((480, 640, 3), np.uint8))
        step = camera.homography.to_world(np.array([[0.0, 0.0], [0.0, 50.0]]))
        found = turn_points(np.diff(step, axis=0)[0], quarter_turns_of(camera))
        np.testing.assert_allclose(found, (1.0, 0.0), atol=1e-9)


@pytest.mark.parametrize("share", [0.5, 0.95])
def test_ellipse_is_drawn_where_its_share_ends(share):
    centre, covariance = np.array([3.0, -1.0]), np.array([[0.5, 0.2], [0.2, 0.3]])
    outline = ellipse_outline(centre, covariance, share)
    np.testing.assert_allclose(squared_mahalanobis(outline - centre, covariance), radius2(share))


# Curves, crops and sheets


def galleries():
    scene, windows = room(), {"hall": planned(room(), planted_s=0.9)}
    matrix = np.array([[0.0, 0.03, 0.0], [-0.03, 0.0, 20.0], [0.0, 0.0, 1.0]])
    picture = np.random.default_rng(7).integers(0, 256, (600, 600, 3), dtype=np.uint8)
    seen = room(camera=Camera(Homography(matrix), picture))
    torch.manual_seed(0)
    network, sets = GridAutoencoder(60, 8), {"sim_test": [scene], "main": [scene] * 3}
    simulated, real = result_of(metrics_of(MEETING)), result_of(metrics_of(MEETING), "hall", ["real/home"])
    drawn = [
        Evaluated("sim", "simulated", [simulated], sets, windows, curves(), network),
        Evaluated("real", "real", [real], {"hall": [seen]}, windows, {}, network),
    ]
    sections = [section for own in drawn for section in draw_gallery(own, METHODS)]
    return [picture for section in sections for picture in section.pictures]


def test_all_pictures_come_out_the_same_twice_and_small():
    first, second = galleries(), galleries()
    assert len(first) == 12
    for one, two in zip(first, second, strict=True):
        file = png_bytes(one.figure)
        assert file == png_bytes(two.figure), one.name
        # the layout's last digits depend on addresses in memory, and lines would move with them
        bounds = np.array([axes.get_position(original=True).bounds for axes in one.figure.axes])
        np.testing.assert_allclose(bounds, np.round(bounds, 6), rtol=0, atol=1e-12)
        if "camera" not in one.name:  # its background is noise here, the worst case for a PNG
            assert len(file) < 300_000, one.name
    packed = avif_bytes(first[0].figure, 10)
    assert packed == avif_bytes(second[0].figure, 10)
    assert len(packed) < len(png_bytes(first[0].figure))


def test_instants_need_people_who_move():
    scene, windows = room(), planned(room())
    still = {"hall": dataclasses.replace(windows, velocity=0.0 * windows.velocity)}
    result, sets = result_of(metrics_of(MEETING)), {"sim_test": [scene]}
    sections = draw_gallery(Evaluated("sim", "simulated", [result], sets, still, {}, None), METHODS)
    titles = [section.title for section in sections]
    assert "Error over the horizon" in titles
    assert "Instants, chosen by rule" not in titles


@pytest.mark.parametrize("ahead_m", [(1.0, 9.0), (7.0, 7.5), (9.0, 1.0)])
def test_drives_leave_room_for_titles_and_scale(ahead_m):
    way = np.linspace(0.0, 1.0, 30)[:, None] * ahead_m
    people = Trajectories(0.25 * np.arange(30), np.ones(30, int), way)
    about = {"goal": [*ahead_m], "risk": 0.1, "reached": False, "method": "modes", "time_s": 25.7}
    drive = (
        Scene("hall", people, OccupancyMap.free_around(way), 0.25),
        about | {"radius_m": 0.3, "contacts": []},
    )
    picture = Image.open(io.BytesIO(png_bytes(episode_figure([drive] * 3)))).convert("L")
    inked = np.asarray(picture) < 200
    assert not inked[[0, 1, -2, -1]].any()
    assert not inked[:, [0, 1, -2, -1]].any()
