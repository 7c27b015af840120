"""What follows a network's forecasts: requests, instants and links, in order, by hand."""

from dataclasses import replace

import numpy as np
import pytest

from pedpred.errors import ValueRuleError
from pedpred.features import FeatureTable, ForecastProtocol
from pedpred.forecasting import ForecastRequest, MethodRow
from pedpred.forecasting.blocks import forecast_blocks, instant_blocks
from pedpred.forecasting.detections import NO_DETECTIONS, Instant
from pedpred.forecasting.local_errors import Means
from pedpred.forecasting.postprocessing import PlaceKnowledge, Postprocessing
from pedpred.forecasting.regions import Regions
from pedpred.forecasting.selection import choose_modes
from pedpred.forecasting.trust import Sums, Trust
from pedpred.scenes import Predictions, Scene, Trajectories
from pedpred.tracking import Tracks
from tests.worlds import empty_map

TIME_S = np.array([0.0, 0.4, 0.44, 0.8, 0.4, 0.8, 1.2, 5.0])
"""Of track 3, which has two detections in quick succession, and of track 7, which is a second life at 5 s."""
SIZES = ForecastProtocol(dt_s=0.4, horizon_steps=3, max_age_intervals=1.5, lost_after_s=2.0)


def tracks_of(time_s=TIME_S):
    """States of two tracks; those of each row are unlike all others."""
    row = np.arange(8.0)
    position = np.stack([10 + row, 20 - 2 * row], axis=-1)
    return Tracks(
        np.repeat([3, 7], 4), np.repeat([3, 7], 4), np.array([0, 0, 0, 0, 1, 1, 1, 2]), time_s,
        np.array([0, 1, 2, 3, 0, 1, 2, 0]), position + 0.25, position,
        np.stack([1 + row / 10, -row / 10], axis=-1), np.zeros((8, 3)), row / 4,
    )  # fmt: skip


def request_for(rows, tracks=None, **given):
    """A request for some rows of a table at the tracks' detections."""
    tracks = tracks_of() if tracks is None else tracks
    size = len(tracks.time_s)
    zeros, pairs, future = np.zeros(size), (np.zeros((size, 2)) for _ in range(4)), np.zeros((size, 3, 2))
    about = tracks.track_id, zeros, zeros, tracks.time_s, tracks.position, zeros
    table = FeatureTable(*about, *pairs, future, zeros)
    people = Trajectories(tracks.time_s, tracks.track_id, tracks.detection)
    scene = Scene("two", people, empty_map(), 0.4)
    usual = {"tracker": None, "detection_interval_s": 0.3, "tracks": tracks}
    return ForecastRequest(scene, table, SIZES, np.array(rows, int), **usual | given)


def test_a_request_knows_its_times_and_rows():
    request = request_for([6, 1])
    np.testing.assert_allclose(request.ahead_s, [0.4, 0.8, 1.2])
    assert request.max_age_s == pytest.approx(0.45)
    np.testing.assert_array_equal(request.asked.time_s, [1.2, 0.4])
    assert request.past is request.tracks


@pytest.mark.parametrize("name", ["walking_model", "steps", "past"])
def test_what_a_request_lacks_is_refused(name):
    with pytest.raises(ValueRuleError):
        getattr(replace(request_for([0]), tracks=None), name)
    full = replace(request_for([0]), social_force="walking", clock="steps")
    assert getattr(full, name) in ("walking", "steps", full.tracks)


@pytest.mark.parametrize(
    ("rows", "present", "now_s", "asked"),
    [
        ([1], [0, 1, 4], [0.0, 0.4, 0.4], [1]),
        ([5, 3, 0], [0, 1, 4, 2, 4, 3, 5], [0.0, 0.4, 0.4, 0.44, 0.44, 0.8, 0.8], [6, 5, 0]),
        ([6], [0, 1, 4, 2, 4, 3, 5, 3, 6], [0.0, 0.4, 0.4, 0.44, 0.44, 0.8, 0.8, 1.2, 1.2], [8]),
        ([], [], [], []),
    ],
)
def test_everybody_is_present_at_each_instant_up_to_the_last(rows, present, now_s, asked):
    """Whose last detection is at most 0.45 s old; by row at each instant."""
    found = request_for(rows).present()
    for one, other in zip(found, (present, now_s, asked), strict=True):
        np.testing.assert_allclose(one, other)


def test_inputs_are_computed_from_who_is_around():
    """Rows 3 and 4 at 0.8 s: their extrapolated states, and everybody present then."""

    class Seen:
        def compute(self, seen, dt_s):
            return {"seen": seen, "dt_s": dt_s}

    found = request_for([3]).inputs(Seen(), np.array([3, 4]), np.array([0.8, 0.8]))
    seen = found["seen"]
    assert found["dt_s"] == 0.4
    np.testing.assert_allclose(seen.observers.position, [[13.0, 14.0], [14 + 0.4 * 1.4, 12 - 0.4 * 0.4]])
    np.testing.assert_array_equal(seen.around.position, [[13.0, 14.0], [15.0, 10.0]])
    np.testing.assert_array_equal(seen.time_s, [0.8, 0.8])


def test_blocks_of_2048_rows_begin_at_whole_instants():
    """Instants of 1000 rows each: at rows 0, 1000, ... Those that begin in other 2048 rows begin a block."""
    time_s = np.repeat(0.3 * np.arange(6), 1000)
    assert instant_blocks(time_s) == [(0, 3000), (3000, 5000), (5000, 6000)]
    assert instant_blocks(time_s + np.tile([0.0, 5e-7], 3000)) == [(0, 3000), (3000, 5000), (5000, 6000)]
    assert instant_blocks(np.repeat([1.0, 1.1], [2048, 1])) == [(0, 2048), (2048, 2049)]
    assert instant_blocks(np.repeat([1.0, 1.1], [2047, 2])) == [(0, 2049)]
    assert instant_blocks(np.zeros(5000)) == [(0, 5000)]
    assert instant_blocks(np.zeros(0)) == []


class Links:
    """A chain that lists what it is given, and knows at how many instants people were forgotten."""

    def __init__(self):
        self.known, self.forgotten = [], 0

    def initial(self, steps):
        assert steps == 3
        return self

    def without_people(self):
        self.forgotten += 1
        return self

    def apply(self, place, alone, position, time_s, person, detection, seen):
        assert place is self
        self.known.append((alone, position, time_s, person.tolist(), detection, seen.tolist()))
        return self, alone


def in_agent_frames(row, inputs):
    """Of each row a path ahead and to the left, of its number."""
    point = np.tile([[1.0, 0.0], [2.0, 0.5], [3.0, 1.0]], (len(row), 1, 1)) * (1 + row)[:, None, None]
    assert inputs == {"seen": len(row)}
    return Predictions.single(point, 0.4, frame="agent")


class Count:
    def compute(self, seen, dt_s):
        return {"seen": len(seen.time_s)}


def blocks_of(rows, tracks):
    """Rows and predictions of a request, and what the links were given."""
    links = Links()
    parts = list(forecast_blocks(request_for(rows, tracks), Count(), in_agent_frames, links))
    return parts, links


def test_links_are_applied_at_each_instant_to_who_is_present():
    """Paths are turned by the headings and begin where people are; a detection in a burst is not seen."""
    tracks = tracks_of()
    ((which, found),), links = blocks_of([6, 0, 2], tracks)
    np.testing.assert_array_equal(which, [1, 2, 0])
    assert [known[2] for known in links.known] == [0.0, 0.4, 0.44, 0.8, 1.2]
    assert [known[3] for known in links.known] == [[0], [0, 1], [0, 1], [0, 1], [0, 1]]
    seen = [[True], [True, True], [False, False], [True, True], [False, True]]
    assert [known[5] for known in links.known] == seen
    for row, k, forecast, i in ((0, 0, 0, 0), (2, 2, 1, 0), (4, 2, None, 1), (6, 4, 2, 1), (3, 4, None, 0)):
        alone, position, now_s, _, detection, _ = links.known[k]
        here = tracks.position[row] + (now_s - TIME_S[row]) * tracks.velocity[row]
        np.testing.assert_allclose(position[i], here)
        np.testing.assert_array_equal(detection[i], tracks.detection[row])
        cos, sin = np.cos(row / 4), np.sin(row / 4)
        ahead = np.array([[1.0, 0.0], [2.0, 0.5], [3.0, 1.0]]) * (1 + row)
        expected = here + ahead @ np.array([[cos, sin], [-sin, cos]])
        np.testing.assert_allclose(alone.point[i], expected)
        if forecast is not None:
            np.testing.assert_allclose(found.point[forecast], expected)
    assert found.frame == "world"
    assert links.forgotten == 0


@pytest.mark.parametrize(("gap_s", "forgotten"), [(1.99, 0), (2.0 + 5e-7, 0), (2.01, 1)])
def test_people_are_forgotten_after_2_s_without_anybody(gap_s, forgotten):
    time_s = np.append(TIME_S[:7], 1.2 + gap_s)
    parts, links = blocks_of([7], tracks_of(time_s))
    assert links.forgotten == forgotten
    assert [which.tolist() for which, _ in parts] == [[0]]


def test_rows_are_found_in_all_blocks():
    """2048 people at 0 and 0.4 s, in a block each."""
    row, both = np.arange(4096), np.arange(4096) // 2
    here = np.stack([row, -row], axis=-1) * 1.0
    tracks = Tracks(
        both, both, both, 0.4 * (row % 2), row % 2, here, here, np.zeros((4096, 2)), np.zeros((4096, 3)),
        np.zeros(4096),
    )  # fmt: skip
    request = request_for([4001, 8, 9, 4000], tracks)
    (one, first), (other, second) = forecast_blocks(request, Count(), in_agent_frames, Links())
    assert (one.tolist(), other.tolist()) == ([1, 3], [2, 0])
    for forecasts, rows in ((first, [8, 4000]), (second, [9, 4001])):
        expected = here[rows] + np.array([1.0, 0.0]) * (1 + np.array(rows))[:, None]
        np.testing.assert_allclose(forecasts.point[:, 0], expected)


def test_nothing_is_given_for_blocks_of_which_nobody_is_asked():
    assert not list(forecast_blocks(request_for([]), Count(), in_agent_frames, Links()))


def meeting():
    """Two people whose likelier modes meet, one of whom walks; a place that has taught shares and regions."""
    path = np.array(
        [[[[1.0, 0.0], [2.0, 0.0]], [[1.0, 2.0], [2.0, 3.0]]], [[[1.0, 0.1], [2.0, 0.1]], [[1.0, -3.0]] * 2]]
    )
    sigma = np.broadcast_to(0.1 * np.eye(2), (2, 2, 2, 2, 2))
    alone = Predictions(path.mean(axis=1), path, np.array([[0.9, 0.1], [0.55, 0.45]]), 0.4, sigma)
    products = np.broadcast_to(np.eye(2), (3, 2, 2, 2))
    sums = Sums(products, np.full((3, 2, 2), 0.05), np.full(3, 10000.0))
    regions = Regions.initial(2, 0.1, on_lines=True)
    regions = replace(regions, learned=np.full(regions.learned.shape, 0.5))
    place = PlaceKnowledge(Trust.of_place(sums), regions)
    return place, alone


def along(chain, place, alone):
    """The last forecasts of seven instants."""
    for k in range(7):
        here = np.array([[0.0, 0.02 * k], [2.0, 0.0]])
        place, after = chain.apply(place, alone, here, 0.3 * k, np.array([4, 9]), here, np.ones(2, bool))
    return place, after


def test_links_follow_each_other():
    """Trust moves the modes, people choose among those, and regions are scaled by the new weights."""
    place, alone = meeting()
    trust, regions, steps = place.trust, place.regions, Postprocessing(trust=True)
    found_place, found = along(steps, place, alone)
    detections, looked_s = NO_DETECTIONS, -np.inf
    for k in range(7):
        here = np.array([[0.0, 0.02 * k], [2.0, 0.0]])
        people = np.array([4, 9])
        detections = detections.append(0.3 * k, people, here)
        now = Instant(0.3 * k, people, np.ones(2, bool), detections, looked_s)
        looked_s = 0.3 * k
        trust, moved = trust.update(now, alone)
        chosen = choose_modes(moved, here)
        regions, expected = regions.update(now, chosen)
    assert np.abs(moved.path - alone.path).max() > 0.01
    assert np.abs(chosen.weight - moved.weight).max() > 0.01
    for name, values in expected.arrays().items():
        np.testing.assert_array_equal(getattr(found, name), values)
    np.testing.assert_array_equal(found_place.regions.learned, regions.learned)
    np.testing.assert_array_equal(found_place.trust.weights, trust.weights)
    apart = along(replace(steps, together=False), place, alone)[1]
    np.testing.assert_array_equal(apart.weight, alone.weight)


def test_a_chain_without_links_changes_nothing():
    place, after = along(
        Postprocessing(together=False, learning=False), PlaceKnowledge(None, None), meeting()[1]
    )
    assert (place.trust, place.regions) == (None, None)
    np.testing.assert_array_equal(after.path, meeting()[1].path)


def test_detections_are_kept_1_s_longer_than_the_horizon():
    """Of ten steps of 0.4 s: at 6 s those since 1 s."""
    place, here = PlaceKnowledge(None, None), np.zeros((1, 2))
    alone = Predictions.single(np.zeros((1, 10, 2)), 0.4)
    for now_s in np.arange(0.0, 6.5, 0.5):
        known = here, now_s, np.array([4]), here, np.ones(1, bool)
        place, _ = Postprocessing(together=False, learning=False).apply(place, alone, *known)
    assert place.detections.time_s.tolist() == np.arange(1.0, 6.5, 0.5).tolist()


def test_links_begin_unlearned():
    default = Postprocessing().initial(4)
    assert default.trust is None
    assert (default.regions.noise_m, default.regions.on_lines) == (0.0, False)
    place = Postprocessing(noise_m=0.2, trust=True).initial(4)
    assert (place.regions.noise_m, place.regions.on_lines, place.regions.steps[-1]) == (0.2, True, 3)
    assert place.trust.place.errors.shape == (3, 4, 2)
    assert Postprocessing(learning=False).initial(4) == PlaceKnowledge(None, None)
    assert Postprocessing(learning=False, trust=True).initial(4).regions is None


def test_a_place_is_kept_as_numbers():
    """What is None stays None, and what others have not learned stays unlearned."""
    place, alone = along(Postprocessing(trust=True), *meeting())
    plain = place.plain()
    again = Postprocessing(trust=True).initial(2).restored(plain)
    np.testing.assert_array_equal(again.regions.learned, place.regions.learned)
    np.testing.assert_array_equal(again.trust.place.errors, place.trust.without_people().place.errors)
    left = place.without_people()
    assert (left.regions.pending, left.trust.past, len(left.trust.person)) == ((), (), 0)
    np.testing.assert_array_equal(left.regions.learned, place.regions.learned)
    nothing = PlaceKnowledge(None, None)
    assert nothing.plain() == dict.fromkeys(("trust", "regions", "local_errors"))
    assert nothing.without_people() == nothing.restored(plain) == nothing
    part = Postprocessing(trust=True).initial(2).restored(plain | {"trust": None})
    assert not part.trust.place.errors.any()
    assert part.regions.learned.any()
    assert len(alone)


def test_local_errors_are_kept_where_both_places_have_them():
    links = Postprocessing(learning=False, local_errors=True)
    initial = links.initial(2)
    one = Means(*(np.ones_like(part) for part in Means.empty(2, rows=1)))
    one = one._replace(square=2 * one.square)
    learned = replace(initial, local_errors=replace(initial.local_errors, means=one))
    kept = links.initial(2).restored(learned.plain())
    np.testing.assert_array_equal(kept.local_errors.means.error, one.error)
    unlearned = learned.plain() | {"local_errors": None}
    assert len(initial.restored(unlearned).local_errors.means.number) == 0
    assert PlaceKnowledge(None, None).restored(learned.plain()).local_errors is None


def test_rows_of_methods_are_checked():
    assert MethodRow(("real", "simulated")).settings == {}
    for wrong in (
        (("elsewhere",), {}),
        (("real", "elsewhere"), {}),
        (("real",), [1]),
        ("real", {}),
        ("", {}),
    ):
        with pytest.raises(ValueRuleError):
            MethodRow(*wrong)
