"""Tables and texts that could be read in two ways: what is taken, refused or warned about."""

import logging
import math
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pedpred.errors import SourceError
from pedpred.tables.titles import titles_of_tracks
from tests.scenes import assert_same
from tests.test_table_traits import COUNT, FIXTURE, TITLES, WALK, tracks, write


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    return tracks(write(tmp_path_factory.mktemp("plain"), WALK))


# Places


@given(
    st.sampled_from(["ped", "human", "person", "pedestrian", "agent", "Fußgänger"]),
    st.sampled_from(["{}_x,{}_y", "{}_x_m,{}_y_m", "x_{},y_{}", "{} pos x,{} pos y"]),
    st.sampled_from(["x,y", "pos_x,pos_y", "x_m,y_m"]),
    st.permutations(range(6)),
)
@settings(deadline=None, suppress_health_check=FIXTURE)
def test_people_are_where_the_titles_with_a_word_for_them_say(tmp_path, plain, word, theirs, other, order):
    """Not where the robot is that has seen them."""
    titles = [*other.split(","), "time", f"{word}_id", *theirs.format(word, word).split(",")]
    rows = [[(0.6 * t, 2 + math.sin(t), t, who, x, y)[k] for k in order] for t, who, x, y in WALK]
    assert_same(tracks(write(tmp_path, rows, [titles[k] for k in order])), plain)


def test_words_for_things_do_not_say_that_a_place_is_that_of_people():
    wanted = titles_of_tracks(("time", "person_id", "x", "y", "object_x", "object_y"))
    assert set(wanted) == {"time", "person_id", "x", "y"}
    assert "ped_x" not in titles_of_tracks(("time", "id", "x", "y", "ped_x")), "without its y"


@pytest.mark.parametrize(
    ("titles", "named"),
    [
        ("time,id,x,y,x_world_m,y_world_m", "x and y .*, and x_world_m and y_world_m are not"),
        ("time,id,X,Y,easting,northing", "X and Y .*, and easting and northing are not"),
        ("time,id,x,y,object_x,object_y", "x and y .*, and object_x and object_y are not"),
        ("time,ped,x,y,ped_x,ped_y", "ped_x and ped_y .*, and x and y are not"),
        ("time,id,x,y,x_filtered,y_filtered", None),
        ("time,id,x_px,y_px,x,y", None),
        ("time,id,x,y,image_x,image_y", None),
    ],
)
def test_other_columns_that_may_hold_the_places_are_named(tmp_path, caplog, titles, named):
    rows = [(*row, 9 + row[2], 9 + row[3]) for row in WALK]
    with caplog.at_level(logging.WARNING):
        tracks(write(tmp_path, rows, titles.split(",")))
    if named:
        assert "--columns if these are meant" in caplog.text
        assert [record for record in caplog.records if re.search(named, record.getMessage())]
    else:
        assert not caplog.text


@pytest.mark.parametrize("header", [TITLES, None])
@pytest.mark.parametrize("apart", [0, 3])
def test_people_are_not_all_at_one_place(tmp_path, header, apart):
    """Here x and y are those of what has seen them; a few instants may be so."""
    rows = [
        (t, who, 0.6 * t, round(math.sin(t), 3) + (who if k < 2 * apart else 0))
        for k, (t, who, *_) in enumerate(WALK)
    ]
    with pytest.raises(SourceError, match=rf"in {COUNT - apart} of {COUNT} instants .*exactly one place"):
        tracks(write(tmp_path, rows, header))
    few = [(t, who, x, y if k > 8 else 5.0) for k, (t, who, x, y) in enumerate(WALK)]
    few = [(t, who, x - 3 * who if k <= 8 else x, y) for k, (t, who, x, y) in enumerate(few)]
    assert len(tracks(write(tmp_path, few, header), unit="m")) == len(WALK)
