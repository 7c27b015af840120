"""Text files of the ETH/UCY comparison: one made here, what can be wrong with it, and the real ones."""

import numpy as np
import pytest

from pedpred.errors import InputError
from pedpred.sources.eth_ucy import read_text
from tests.worlds import EXCERPT, recorded

SETTINGS = {
    "recording": "street",
    "frame_rate_hz": 25.0,
    "annotation_frames": 10,
    "resolution_m": 0.5,
    "margin_m": 1.0,
}
ROWS = ["0.0\t1.0\t2.0\t3.0", "0.0\t2.0\t-4.0\t6.0", "10.0\t1.0\t2.5\t3.0"]
FACTS = {  # people, detections, last frame
    EXCERPT: (17, 381, 1740),
    "zara01": (148, 5153, 9010),
    "zara02": (204, 9722, 10520),
    "zara03": (137, 5005, 7530),
    "students001": (415, 21813, 4430),
    "students003": (434, 17953, 5400),
}


def write_street(folder, rows=ROWS):
    (folder / "street.txt").write_text("".join(f"{row}\n" for row in rows))
    return folder


def test_frames_become_seconds_and_the_map_is_free(tmp_path):
    scene = read_text(write_street(tmp_path), "street", SETTINGS)
    seen = scene.trajectories
    assert scene.detection_dt_s == 0.4
    rows = sorted(zip(seen.time_s.tolist(), seen.track_id.tolist(), seen.position.tolist(), strict=True))
    assert rows == [(0.0, 1, [2, 3]), (0.0, 2, [-4, 6]), (0.4, 1, [2.5, 3])]
    assert not scene.occupancy.occupied.any()
    assert scene.occupancy.origin.tolist() == [-5, 2]
    assert (np.array(scene.occupancy.occupied.shape) * 0.5).tolist() == [8.5, 5]


@pytest.mark.parametrize(
    ("rows", "line"),
    [
        ([], None),
        ([*ROWS, "10 1 9 9"], 4),
        ([*ROWS, "20 1 2.5"], 4),
        ([*ROWS, "20.5 1 2 3"], 4),
        ([*ROWS, "20 1 1e5 3000"], None),
    ],
)
def test_a_wrong_row_is_named(tmp_path, rows, line):
    with pytest.raises(InputError) as error:
        read_text(write_street(tmp_path, rows), "street", SETTINGS)
    assert (error.value.path.name, error.value.where) == ("street.txt", line)


@pytest.mark.parametrize("name", FACTS)
def test_the_recordings_have_the_known_people(name):
    """Counted in the files with numpy.loadtxt."""
    scene = recorded(name)
    seen, (people, detections, last) = scene.trajectories, FACTS[name]
    assert (len(np.unique(seen.track_id)), len(seen)) == (people, detections)
    assert seen.time_s.max() == last / 25
    assert scene.detection_dt_s == pytest.approx(seen.usual_interval_s()) == 0.4
    cells = scene.occupancy.cell_of(seen.position)
    assert ((cells >= 0) & (cells < scene.occupancy.occupied.shape)).all()
