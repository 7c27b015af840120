"""The ground of predicted occupancy: no cost stays in a costmap where nobody is expected any more."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pedpred.online import OnlinePredictor
from pedpred.ros.message_types import serialize
from pedpred.ros.planning import HORIZON
from pedpred.ros.scene_messages import map_message
from pedpred.ros2.follower import Follower
from pedpred.ros2.grounds import Grounds
from pedpred.ros2.settings import NodeSettings
from pedpred.scenes import OccupancyMap, Predictions, predicted_occupancy
from pedpred.scenes.occupancy import FARTHEST_M
from tests.bags import GRID
from tests.following import answered, follower_of, people

MAP = OccupancyMap(np.zeros((30, 30), bool), np.array([-1.0, -1.0]), 0.2)


def cells_of(ground):
    """Lowest and highest corner, m."""
    return np.r_[ground.origin, ground.origin + ground.extent_m]


def holds(outer, inner):
    return (outer[:2] <= inner[:2] + 1e-6).all() and (outer[2:] >= inner[2:] - 1e-6).all()


@pytest.mark.parametrize("every", [1, 5, 20])
def test_a_costmap_that_reads_some_of_the_grids_has_the_costs_of_the_last_one_alone(every):
    """As Nav2's static layer in a rolling costmap: it resets the cells that the new grid holds, no others."""
    now_s, costs = 0.0, {}
    online = NodeSettings(occupancy_cell_m=0.5)
    follower = Follower(OnlinePredictor.load(), online, clock=lambda: now_s)
    walkers = {"anna": (0.0, 1.3, 0, 40), "ben": (9.0, -1.2, 10, 24), "eve": (-6.0, 0.0, 30, 35)}
    for k in range(60):
        now_s = k / 10
        if k == 28:
            follower.map_came(serialize(GRID, map_message(MAP, 0)))
        here = {
            name: (x + v * now_s, 1.0) for name, (x, v, first, end) in walkers.items() if first <= k < end
        }
        answers = answered(follower, people(5.0 + now_s, **here), now_s)
        if k % every or HORIZON[1:] not in answers:
            continue
        grid = answers[HORIZON[1:]]
        info, data = grid["info"], np.asarray(grid["data"])
        low = np.array([info["origin"]["position"][axis] for axis in "xy"])
        size = np.array([info["width"], info["height"]])
        end = low + info["resolution"] * size
        costs = {at: cost for at, cost in costs.items() if not ((low <= at) & (at <= end)).all()}
        assert not costs
        row, column = np.nonzero(data.reshape(size[::-1]))
        middle = low + info["resolution"] * (np.stack([column, row], -1) + 0.5)
        costs |= dict.fromkeys(map(tuple, middle.tolist()), 1)


def walkers_at(*xs):
    path = np.array([[[[x, 0.0], [x + 3.0, 1.0]]] for x in xs]).reshape(-1, 1, 2, 2)
    spread = np.full((*path.shape, 2), 0.04) * np.eye(2)
    return Predictions(path[:, 0], path, np.ones((len(path), 1)), 1.0, spread)


@given(st.lists(st.tuples(st.floats(0, 2), st.floats(-20, 20), st.booleans(), st.booleans()), max_size=20))
@settings(max_examples=50)
def test_a_ground_holds_all_cells_on_which_somebody_was_just_shown(frames):
    now_s, shown = 0.0, []
    grounds = Grounds(lambda: now_s, 0.1)
    for wait_s, x, is_mapped, is_somebody in frames:
        now_s += wait_s
        people_here = walkers_at(x) if is_somebody else walkers_at()
        ground, _ = grounds.ground(people_here, MAP if is_mapped else None, "map", 0.2)
        assert ground.resolution_m == 0.2
        for then_s, before in shown:
            assert now_s - then_s > 3.0 or holds(cells_of(ground), before)
        grid = np.argwhere(predicted_occupancy(people_here, ground).max(axis=0) >= 0.005)
        if len(grid):
            low, high = grid.min(axis=0), grid.max(axis=0) + 1
            shown.append((now_s, np.r_[ground.origin + 0.2 * low, ground.origin + 0.2 * high]))


def test_without_a_map_a_ground_holds_everybody_who_is_expected():
    """With larger cells, where there would be too many, too."""
    for xs in ((0.0,), (0.0, 80.0), (0.0, 400.0)):
        ground, shown = Grounds(lambda: 0.0, 0.1).ground(walkers_at(*xs), None, "map", 0.1)
        assert len(shown) == len(xs)
        corners = cells_of(ground).reshape(2, 2)
        wide = OccupancyMap.free_around(corners, 5.0, ground.resolution_m)
        shares = predicted_occupancy(walkers_at(*xs), wide).max(axis=0)
        cells = wide.center_of(np.argwhere(shares >= 0.005))
        low, high = corners
        assert ((low < cells) & (cells < high)).all()


@pytest.mark.parametrize("place", [*product((-FARTHEST_M, 0.0, FARTHEST_M), repeat=2)])
@pytest.mark.parametrize(("count", "step"), [(1, 0.0), (1, 1.3e-9), (3, 1.3e-9)])
def test_there_is_a_grid_of_who_walks_to_the_largest_coordinate(place, count, step):
    """A map begins no farther away, and people are expected beyond."""
    follower = follower_of(occupancy_cell_m=0.1)
    for k in range(10):
        at = np.array(place) * (1.0 - (9 - k) * step)
        here = {str(n): at - np.sign(at) * n for n in range(count)}
        answers = answered(follower, people(1.0 + k / 10, **here))
        grid = answers["predicted_occupancy/horizon"]
        assert grid["info"]["resolution"] < 0.31
        assert grid["data"].max() > 0 or step


@pytest.mark.parametrize("far_m", [600.0, 5e3, 1e7])
def test_a_false_detection_far_away_hides_nobody(far_m, caplog):
    """Where most people are counts, and of two people the place where somebody was shown."""
    follower = follower_of(occupancy_cell_m=0.1)
    for k in range(8):
        far = {"far": (far_m, far_m)} if k > 3 else {}
        answers = answered(follower, people(1.0 + k / 10, **far, anna=(1.0, 0.0)))
        grid = answers["predicted_occupancy/horizon"]
        assert grid["info"]["resolution"] < 0.31
        assert grid["data"].max() > 30
        assert ("1 of 2 people are too far from the others" in caplog.text) == bool(far)
    grounds = Grounds(lambda: 0.0, 0.1)
    grounds.ground(walkers_at(1e6), None, "map", 0.1)
    ground, shown = grounds.ground(walkers_at(0.0, 1e6, 1.0, 2.0), None, "map", 0.1)
    assert shown.path[:, 0, 0, 0].tolist() == [0.0, 1.0, 2.0]
    assert ground.resolution_m == 0.1


def test_a_ground_returns_to_what_people_need():
    """After three seconds; at once in another frame, and where cells would be larger."""
    now_s, one = 0.0, walkers_at(1.0)
    grounds = Grounds(lambda: now_s, 0.1)
    alone = cells_of(Grounds(lambda: 0.0, 0.1).ground(one, None, "map", 0.1)[0])
    grounds.ground(walkers_at(7.0), None, "odom", 0.1)
    assert not holds(alone, cells_of(grounds.ground(one, None, "odom", 0.1)[0]))
    assert holds(alone, cells_of(grounds.ground(one, None, "map", 0.1)[0]))
    grounds.ground(walkers_at(1e5), None, "map", 0.1)
    assert holds(alone, cells_of(grounds.ground(one, None, "map", 0.1)[0]))
    grounds.ground(walkers_at(7.0), None, "map", 0.1)
    now_s = 3.1
    assert holds(alone, cells_of(grounds.ground(one, None, "map", 0.1)[0]))
    assert holds(alone, cells_of(grounds.ground(walkers_at(), None, "map", 0.1)[0]))
