"""Variants of a scene are consistent: people, obstacles and features change together."""

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pedpred.models.lstm.features.grids import unpack_crops
from pedpred.scenes import VARIANTS
from pedpred.tracking import follow
from tests.exported import LSTM_ROWS
from tests.worlds import extract, walled_scene


def features(scene):
    """Features from the true states, so that nothing but the world differs."""
    return extract(
        scene, follow(scene.trajectories, "truth", None, 0.2), LSTM_ROWS.protocol, LSTM_ROWS.features
    )


@given(st.sampled_from(sorted(VARIANTS)), st.integers(0, 9))
def test_a_variant_of_a_variant_is_the_scene(name, seed):
    scene = walled_scene(np.random.default_rng(seed), truth=True)
    twice = VARIANTS[name](VARIANTS[name](scene))
    np.testing.assert_allclose(twice.trajectories.time_s, scene.trajectories.time_s, atol=1e-9)
    np.testing.assert_array_equal(twice.trajectories.position, scene.trajectories.position)
    np.testing.assert_array_equal(twice.trajectories.velocity, scene.trajectories.velocity)
    np.testing.assert_array_equal(twice.occupancy.occupied, scene.occupancy.occupied)
    np.testing.assert_allclose(twice.occupancy.origin, scene.occupancy.origin, atol=1e-9)


def test_a_mirrored_person_sees_the_mirror_image():
    scene = walled_scene(np.random.default_rng(3), truth=True)
    here, there = features(scene), features(VARIANTS["mirrored"](scene))
    np.testing.assert_array_equal(here.track_id, there.track_id)
    np.testing.assert_allclose(there.future, here.future * [1, -1], atol=1e-5)
    np.testing.assert_allclose(there.inputs["angular_grid"], here.inputs["angular_grid"][:, ::-1], atol=1e-4)
    crops, mirrored = (unpack_crops(t.inputs["occupancy"], 60) for t in (here, there))
    assert (mirrored == crops[:, :, ::-1]).mean() > 0.999  # a cell's edge may fall to either side
    assert (mirrored == crops).mean() < 0.99


def test_who_walks_backwards_goes_where_they_came_from():
    scene = walled_scene(np.random.default_rng(3), truth=True)
    people, back = scene.trajectories, VARIANTS["backwards"](scene).trajectories
    one = people.track_id == people.track_id[0]
    same = back.track_id == people.track_id[0]
    np.testing.assert_array_equal(back.position[same], people.position[one][::-1])
    np.testing.assert_array_equal(back.velocity[same], -people.velocity[one][::-1])
    assert (np.diff(back.time_s) >= 0).all()


def test_an_empty_scene_has_variants():
    scene = walled_scene(np.random.default_rng(3), truth=True)
    nobody = {k: None if v is None else v[:0] for k, v in vars(scene.trajectories).items()}
    for variant in VARIANTS.values():
        assert len(variant(replace(scene, trajectories=type(scene.trajectories)(**nobody))).trajectories) == 0
