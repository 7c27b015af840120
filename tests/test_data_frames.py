"""`pedpred.predict`: forecasts of a data frame in one call are those of the command for the file of it."""

import numpy as np
import pandas as pd
import pytest

import pedpred
from pedpred.command import main
from pedpred.command.forecast_tables import COLUMNS
from pedpred.errors import InputError
from pedpred.scenes import OccupancyMap
from pedpred.storage.maps import write_map
from tests.refused import refused

WALKS = pd.DataFrame(
    [(0.4 * k, who, 0.4 * k, 1.5 * who) for k in range(8) for who in (1, 2)], columns=["time", "id", "x", "y"]
)
BY = ["track", "time", "mode", "step"]


@pytest.fixture(scope="module")
def forecasts():
    return pedpred.predict(WALKS)


def by_command(table, folder, *options, **csv):
    """The exact forecasts of `pedpred predict` for a data frame that is saved as CSV."""
    table.to_csv(folder / "walk.csv", **{"index": False, **csv})
    main(["predict", str(folder / "walk.csv"), "-o", str(folder / "theirs.parquet"), "--force", *options])
    return pd.read_parquet(folder / "theirs.parquet").sort_values(BY, ignore_index=True)


def assert_equal(found, expected):
    pd.testing.assert_frame_equal(found.sort_values(BY, ignore_index=True), expected, check_dtype=False)


def test_forecasts_of_a_frame_are_those_of_the_command(tmp_path, forecasts):
    assert tuple(forecasts.columns) == COLUMNS
    assert_equal(forecasts, by_command(WALKS, tmp_path))


def test_forecasts_lie_ahead_of_a_person_who_walks_straight(forecasts):
    last = forecasts[(forecasts.time == WALKS.time.max()) & (forecasts.step == 10)]
    best = last.loc[last.groupby("track").weight.idxmax()]
    np.testing.assert_allclose(best.x, WALKS.x.max() + 3.0, atol=1.0)  # 1 m/s for 3 s
    np.testing.assert_allclose(forecasts.groupby(["track", "time", "step"]).weight.sum(), 1.0)


@pytest.mark.parametrize("names", [{1: 70, 2: 2**53 + 1}, {1: "Ann", 2: "Bo"}, {1: 0.5, 2: 1.5}])
def test_ids_come_back_unchanged(forecasts, names):
    found = pedpred.predict(WALKS.assign(id=WALKS.id.map(names)))
    assert found.track.tolist() == forecasts.track.map(names).tolist()


def test_a_map_may_be_an_object_or_a_path(tmp_path, forecasts):
    cells = np.zeros((120, 80), bool)
    cells[70:80] = True
    ground = OccupancyMap(cells, np.array([-3.0, -2.0]), 0.1)
    write_map(ground, tmp_path)
    with_map = pedpred.predict(WALKS, ground)
    assert not np.allclose(with_map.x, forecasts.x)
    np.testing.assert_allclose(pedpred.predict(WALKS, str(tmp_path)).x, with_map.x)


@pytest.mark.parametrize(
    "change",
    [
        lambda t: t.set_index(["id", "time"]),
        lambda t: t.assign(time=pd.to_datetime(t.time + 1709683200, unit="s", utc=True)).set_index("time"),
    ],
    ids=["levels of the index", "dates"],
)
def test_an_index_means_what_its_columns_mean_in_a_file(change, tmp_path, forecasts):
    table = change(WALKS)
    found = pedpred.predict(table)
    np.testing.assert_allclose(found[["track", "x", "y"]], forecasts[["track", "x", "y"]], atol=1e-4)
    assert_equal(found, by_command(table, tmp_path, index=True))


def test_rows_without_a_position_are_missing_detections():
    gap = WALKS.assign(id=WALKS.id.map({1: "Ann", 2: "Bo"})).astype(object)
    gap.loc[5, ["x", "y"]] = np.nan, pd.NA
    pd.testing.assert_frame_equal(pedpred.predict(gap), pedpred.predict(gap.drop(index=5)))


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (lambda t: t.drop(columns="x"), "--columns"),
        (lambda t: t.assign(time=t.time.where(t.index != 3)), "row 4"),
        (lambda t: t.assign(x=100 * t.x, y=100 * t.y), "--unit"),
    ],
)
def test_errors_name_the_row_or_the_option(change, named):
    with pytest.raises(InputError, match=named):
        pedpred.predict(change(WALKS))


@pytest.mark.parametrize("wrong", [{"table": WALKS.to_dict("list")}, {"occupancy": np.zeros((3, 3))}])
def test_an_argument_of_another_kind_is_refused_by_name(wrong):
    with refused(next(iter(wrong))):
        pedpred.predict(**{"table": WALKS, **wrong})
