"""The real recordings, read as configured, are what is known about them."""

import numpy as np
import pytest
from PIL import Image

from pedpred.errors import InputError
from pedpred.geometry import Homography
from pedpred.scenes import Camera
from pedpred.sources.ewap import ALONE, occupancy_from_image, read_sequence
from tests.worlds import PLACES, recorded

PAIRS = {  # eth, hotel
    "rows": (8908, 6544),
    "tracks": (360, 390),
    "instants": (1448, 1168),
    "duration_s": (773.4, 722.4),
    "extent": ([[-7.45, -3.27], [13.87, 13.29]], [[-3.29, -10.25], [4.38, 4.32]]),
    "groups": (58, 41),
    "occupied": (923, 213),
    "points_on_obstacles": (0, 9),
    "wrong_order_on_obstacles": (126, 6),
    "wrong_order_outside": (0.0, 0.17),
    "obstacles": ([[-1.02, -0.83], [14.58, 13.07]], [[-1.42, -10.13], [-0.58, 2.01]]),
    "picture": ((480, 640, 3), (576, 720, 3)),
}
FACTS = {p: {name: pair[k] for name, pair in PAIRS.items()} for k, p in enumerate(("eth", "hotel"))}


@pytest.fixture(scope="module", params=FACTS)
def real(request):
    """A real scene, as configured, and what is known about it."""
    return recorded(request.param), FACTS[request.param]


def test_real_detections(real):
    scene, facts = real
    trajectories = scene.trajectories
    assert len(trajectories) == facts["rows"]
    assert len(np.unique(trajectories.track_id)) == facts["tracks"]
    assert len(np.unique(trajectories.time_s)) == facts["instants"]
    assert np.ptp(trajectories.time_s) == pytest.approx(facts["duration_s"], abs=0.05)
    assert scene.detection_dt_s == pytest.approx(0.4)
    extent = [trajectories.position.min(axis=0), trajectories.position.max(axis=0)]
    np.testing.assert_allclose(extent, facts["extent"], atol=0.006)


def test_real_tracks_have_no_holes(real):
    trajectories = real[0].trajectories
    order = np.lexsort((trajectories.time_s, trajectories.track_id))
    same = np.diff(trajectories.track_id[order]) == 0
    np.testing.assert_allclose(np.diff(trajectories.time_s[order])[same], 0.4)


def test_real_groups(real):
    scene, facts = real
    groups = np.unique(scene.trajectories.group_id)
    assert groups.tolist() == [ALONE, *range(facts["groups"])]
    members = [np.unique(scene.trajectories.track_id[scene.trajectories.group_id == g]) for g in groups[1:]]
    assert min(map(len, members)) >= 2


def test_real_obstacles(real):
    scene, facts = real
    occupancy, position = scene.occupancy, scene.trajectories.position
    assert occupancy.occupied.sum() == facts["occupied"]
    assert occupancy.is_occupied(position).sum() == facts["points_on_obstacles"]
    cells = occupancy.center_of(np.argwhere(occupancy.occupied))
    np.testing.assert_allclose([cells.min(axis=0), cells.max(axis=0)], facts["obstacles"], atol=0.1)
    np.testing.assert_allclose(occupancy.origin / 0.1, np.rint(occupancy.origin / 0.1), atol=1e-6)
    assert (position - occupancy.origin >= 1.0).all()
    assert (occupancy.origin + occupancy.extent_m - position >= 1.0).all()


def test_real_annotations_are_whole_pixels(real):
    scene, facts = real
    assert isinstance(scene.camera, Camera)
    assert scene.camera.picture.shape == facts["picture"]
    pixels = scene.camera.homography.to_image(scene.trajectories.position)
    np.testing.assert_allclose(pixels, np.rint(pixels), atol=3e-5)
    assert (pixels > -0.5).all()
    assert (pixels < np.array(facts["picture"][:2]) - 0.5).all()


def test_wrong_pixel_order_would_be_noticed(real, ewap_folder):
    """H takes (row, column). Read as (column, row), eth walks through walls and hotel leaves the picture."""
    scene, facts = real
    wrong = Homography(scene.camera.homography.matrix[:, [1, 0, 2]], first_pixel=1)
    with Image.open(ewap_folder / f"seq_{scene.name}" / "map.png") as image:
        blocked = np.asarray(image) > 127
    points = scene.trajectories.position
    occupancy = occupancy_from_image(blocked, wrong, points, scene.occupancy.resolution_m, 1.0)
    pixels = wrong.to_image(points)
    outside = ~((pixels > -0.5) & (pixels < np.array(blocked.shape) - 0.5)).all(axis=1)
    assert occupancy.is_occupied(points).sum() == facts["wrong_order_on_obstacles"]
    assert outside.mean() == pytest.approx(facts["wrong_order_outside"], abs=0.005)


def test_a_transposed_homography_file_is_refused(ewap_folder, tmp_path):
    for path in (ewap_folder / "seq_hotel").iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    matrix = np.loadtxt(tmp_path / "H.txt")
    np.savetxt(tmp_path / "H.txt", matrix[:, [1, 0, 2]])
    with pytest.raises(InputError, match=r"H\.txt"):
        read_sequence(tmp_path, "hotel", PLACES["hotel"]["settings"])
