"""How far people go in the report: means by speed, whichever way they head, and what is emphasised."""

import numpy as np
import pytest

from pedpred.geometry import rotate
from pedpred.report.displacement import FEWEST, displacement_section
from tests.forecasts import METHODS, windows_with

STEPS, DT_S = 10, 0.3


def walkers(speed_mps, factor, heading_rad, count=FEWEST):
    """Windows of people who walk straight, and forecasts that go `factor` times as far."""
    heading = np.full(count, heading_rad)
    way = speed_mps * DT_S * np.arange(1, STEPS + 1)
    ahead = rotate(np.stack([way, 0.3 * np.ones(STEPS)], axis=-1)[None], heading[:, None])
    velocity = np.tile([speed_mps, 0.0], (count, 1))
    given = {"heading_rad": heading, "velocity": velocity, "dt_s": DT_S}
    return windows_with(np.zeros((count, 2)), ahead, {"lstm": factor * ahead}, **given)


def rows_of(**places):
    return [
        [cell.markdown() for cell in row.cells]
        for section in displacement_section(places, METHODS)
        for row in section.blocks[1].rows
    ]


@pytest.mark.parametrize("heading_rad", [0.0, 1.0, -2.5])
def test_the_way_along_the_heading_is_shown_by_speed(heading_rad):
    scenes = [walkers(speed, 1.0, heading_rad) for speed in (0.1, 0.3, 0.7, 1.4)]
    assert rows_of(street=scenes) == [
        ["street", "0 - 0.2", "30", "0.30", "0.30"],
        ["street", "0.2 - 0.5", "30", "0.90", "0.90"],
        ["street", "0.5 - 1", "30", "2.10", "2.10"],
        ["street", "above 1", "30", "4.20", "4.20"],
    ]


@pytest.mark.parametrize(
    ("speed_mps", "factor", "strong"),
    [(1.0, 1.09, False), (1.0, 1.11, True), (0.1, 1.3, False), (0.1, 1.4, True), (1.0, 0.8, True)],
)
def test_a_forecast_is_bold_if_it_is_off_by_a_tenth_and_by_10_cm(speed_mps, factor, strong):
    ((*_, found),) = rows_of(street=[walkers(speed_mps, factor, 0.5)])
    assert found.startswith("**") == strong


def test_scenes_are_pooled_and_few_people_left_out():
    few = walkers(1.2, 1.0, 0.0, FEWEST // 2)
    assert rows_of(street=[few]) == []
    assert [row[2] for row in rows_of(street=[few, few])] == [str(FEWEST)]
