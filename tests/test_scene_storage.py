"""A disk round trip changes nothing, and foreign or damaged scene folders are understood or refused."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings

from pedpred.errors import ValueRuleError
from pedpred.scenes import OccupancyMap, Scene, Trajectories
from pedpred.sources.scene_folder import read_own
from pedpred.storage.scenes import (
    read_map,
    read_scene,
    read_scenes,
    scene_folders,
    write_map,
    write_scene,
)
from tests.refused import unread
from tests.scenes import assert_same, scenes, write_as_table


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(scenes())
def test_disk_round_trip_changes_nothing(tmp_path, scene):
    write_scene(scene, tmp_path / "place")
    assert_same(read_scene(tmp_path / "place"), scene)


def test_a_scene_says_on_disk_why_it_is_none(tmp_path):
    scene = Scene.without_people("place", "the archive is down")
    write_scene(scene, tmp_path / "place")
    assert_same(read_scene(tmp_path / "place"), scene)
    assert not scene.occupancy.occupied.any()
    with pytest.raises(ValueRuleError):
        replace(scene, trajectories=Trajectories([0.0], [1], [[0.0, 0.0]]))


@pytest.fixture
def folder(tmp_path):
    trajectories = Trajectories([0.0, 0.4], [1, 1], [[0.0, 0.0], [0.5, 0.0]])
    write_scene(Scene("place", trajectories, OccupancyMap(np.eye(2), [0, 0], 0.1), 0.4), tmp_path / "place")
    return tmp_path / "place"


def test_same_scene_same_bytes(folder, tmp_path):
    write_scene(read_scene(folder), tmp_path / "again")
    for path in folder.iterdir():
        assert path.read_bytes() == (tmp_path / "again" / path.name).read_bytes()


def test_map_server_pair_has_its_first_row_at_the_largest_y(tmp_path):
    """Written by hand: 3 columns along x, 2 rows; black at the picture's upper left."""
    (tmp_path / "map.pgm").write_bytes(b"P5\n3 2\n255\n" + bytes([0, 254, 254, 254, 254, 205]))
    about = "image: map.pgm\nresolution: 0.5\norigin: [1.0, -2.0, 0.0]\nnegate: 0\n"
    (tmp_path / "map.yaml").write_text(about + "occupied_thresh: 0.65\nfree_thresh: 0.196\n")
    occupancy = read_map(tmp_path)
    assert occupancy.occupied.tolist() == [[False, True], [False, False], [False, False]]
    assert occupancy.is_occupied(np.array([1.25, -1.25]))
    assert occupancy.origin.tolist() == [1.0, -2.0]
    assert occupancy.resolution_m == 0.5
    write_map(occupancy, tmp_path)
    assert (tmp_path / "map.pgm").read_bytes().endswith(bytes([0, 254, 254, 254, 254, 254]))


def test_a_folder_of_scenes_is_a_set(folder):
    assert scene_folders(folder) == scene_folders(folder.parent) == [folder]
    assert [scene.name for scene in read_scenes(folder.parent)] == ["place"]


def test_no_scene_is_an_error(tmp_path):
    with unread(tmp_path):
        scene_folders(tmp_path)


def change_json(folder, **changed):
    about = json.loads((folder / "scene.json").read_text()) | changed
    (folder / "scene.json").write_text(json.dumps(about))


def change_tracks(folder, **changed):
    pd.read_parquet(folder / "tracks.parquet").assign(**changed).to_parquet(folder / "tracks.parquet")


@pytest.mark.parametrize(
    ("change", "file", "field"),
    [
        (lambda folder: change_json(folder, schema=99), "scene.json", "schema"),
        (lambda folder: change_json(folder, detection_dt_s=-1.0), "scene.json", "detection_dt_s"),
        (lambda folder: (folder / "tracks.parquet").unlink(), "tracks.parquet", ""),
        (lambda folder: change_tracks(folder, track_id="a"), "tracks.parquet", "track_id"),
        (lambda folder: (folder / "map.pgm").write_bytes(b"P5\n9 9\n255\n"), "map.pgm", ""),
    ],
)
def test_damage_is_named_by_file_and_field(folder, change, file, field):
    change(folder)
    with unread(folder / file, remedy=field):
        read_scene(folder)


@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(scenes())
def test_tracks_may_be_a_csv_table_and_the_map_missing(tmp_path, scene):
    """Then the same people walk on free ground that holds them all."""
    write_as_table(scene, tmp_path / "place")
    own = read_own(tmp_path / "place")
    assert_same(own.trajectories, scene.trajectories)
    assert not own.occupancy.occupied.any()
    inside = own.occupancy.cell_of(own.trajectories.position)
    assert ((inside >= 0) & (inside < own.occupancy.occupied.shape)).all()


def test_a_folder_holds_its_tracks_once(folder):
    """Otherwise a corrected table would lose against the Parquet file of an earlier conversion."""
    scene = read_own(folder)
    write_as_table(scene, folder)
    with unread(folder / "tracks.csv"):
        write_scene(scene, folder)
    assert_same(read_own(folder).trajectories, scene.trajectories)
    write_scene(scene, folder.parent / "again")
    (folder.parent / "again" / "tracks.parquet").rename(folder / "tracks.parquet")
    with unread(folder / "tracks.csv"):
        read_own(folder)
