"""Recent detections of a person on a robot: which are kept, what velocities are measured from, by hand."""

import numpy as np
import pytest

from pedpred.online.past import add_detection, earliest, first_seen, kept_before, slots_for
from pedpred.tracking.spacing import latest_apart


@pytest.mark.parametrize(
    ("now_s", "row"),
    [(0.05, 2), (0.99, 2), (1.05, 2), (1.1, 3), (1.15 - 5e-7, 4), (1.149, 3), (9.0, 5)],
)
def test_velocities_are_measured_over_0_05_s_at_least(now_s, row):
    """From the latest detection that is old enough, of a person with rows 2 to 5; the first if none is."""
    kept_s = np.array([-9.0, 0.0, 0.0, 1.05, 1.1, 1.16, 1.2])
    assert latest_apart(kept_s, 2, 6, now_s) == row


def test_detections_in_a_burst_are_not_kept():
    """At 0, 0.4, 0.42, 0.46 and 0.9 s: that at 0.42 s follows within 0.05 s."""
    times_s = [0.0, 0.4, 0.42, 0.46, 0.9]
    place = np.array([[0.0, 1.0], [0.2, 1.0], [0.3, 1.2], [0.4, 1.0], [0.84, 0.56]])
    past, kept, velocity = first_seen(1, 3), [True], [[0.0, 0.0]]
    for k in range(1, 5):
        past = add_detection(
            past, np.array(times_s[k - 1 : k]), place[k - 1 : k], times_s[k], place[k : k + 1]
        )
        kept.append(bool(past["kept"][0]))
        velocity.append(past["last_velocity"][0].tolist())
    assert kept == [True, True, False, True, True]
    expected = [[0.0, 0.0], [0.5, 0.0], [0.3 / 0.42, 0.2 / 0.42], [0.2 / 0.06, 0.0], [1.0, -1.0]]
    np.testing.assert_allclose(velocity, expected, atol=1e-12)
    np.testing.assert_array_equal(past["trail_s"], [[0.0, 0.4, 0.46]])
    np.testing.assert_array_equal(past["trail"][0], place[[0, 1, 3]])
    assert kept_before(past, np.array([0])).tolist() == [3]


def test_the_oldest_detections_make_room():
    """Slots for 0.05 s are three; of five detections, those at 0.2, 0.3 and 0.4 s are before the last one."""
    assert slots_for(0.05) == 3
    past = first_seen(2, 3)
    first = np.array([[5.0, 5.0], [6.0, 6.0]])
    np.testing.assert_array_equal(earliest(past, np.array([0, 1]), first), first)
    for k in range(1, 6):
        before = np.full(2, 0.1 * (k - 1)), np.full((2, 2), k - 1.0)
        past = add_detection(past, *before, 0.1 * k, np.full((2, 2), float(k)))
    np.testing.assert_allclose(past["trail_s"], [[0.2, 0.3, 0.4]] * 2)
    np.testing.assert_array_equal(earliest(past, np.array([1]), first[:1]), [[2.0, 2.0]])
