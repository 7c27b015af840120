"""Formats of the field: written after their specifications, read to the value, refused by name."""

import sqlite3

import h5py
import numpy as np
import pedpy
import pytest

from pedpred.reading import format_of, read_recording
from pedpred.reading.options import ReadOptions
from tests.field_formats import (
    OPTIONS,
    PEOPLE,
    PIXEL_M,
    RATE_HZ,
    ROWS,
    UNIX_S,
    WRITERS,
    lines,
    trajnet_scene,
    write_archive,
    write_atc,
    write_drone,
    write_jupedsim,
    write_kitti,
    write_qtm,
    write_schema,
    write_stanford,
    write_sumo,
    write_trajnet,
    write_vadere,
    write_viswalk,
    write_vsp,
)
from tests.refused import unread


def people_in(path, options=None):
    return read_recording(path, options).scene.trajectories


@pytest.mark.parametrize("name", [name for name in WRITERS if name != "UCY splines"])
def test_a_format_is_read_to_the_value(tmp_path, name):
    people = people_in(WRITERS[name](tmp_path), OPTIONS.get(name))
    start_s = UNIX_S if name == "ATC shopping centre" else 0.0
    np.testing.assert_allclose(people.time_s - start_s, PEOPLE.time_s, atol=1e-6)
    np.testing.assert_array_equal(np.unique(people.track_id, return_inverse=True)[1] + 1, PEOPLE.track_id)
    np.testing.assert_allclose(people.position, PEOPLE.position, atol=1e-3 if start_s else 1e-4)


@pytest.mark.parametrize("name", WRITERS)
def test_a_format_is_recognised_by_its_content(tmp_path, name):
    path = WRITERS[name](tmp_path)
    for suffix in ("", ".csv", ".SQLITE"):
        other = tmp_path / f"renamed{suffix}"
        other.write_bytes(path.read_bytes())
        assert format_of(other, ReadOptions()) is format_of(path, ReadOptions())


@pytest.mark.parametrize("name", [name for name in WRITERS if "Archive" not in name])  # another process
def test_every_format_bounds_what_it_reads(tmp_path, monkeypatch, name):
    path = WRITERS[name](tmp_path)
    monkeypatch.setattr("pedpred.reading.text.MOST_NUMBERS", 20)
    with unread(path, remedy="Divide the file"):
        people_in(path, OPTIONS.get(name))


# Errors name file and line


@pytest.mark.parametrize(
    ("write", "old", "new", "line"),
    [
        (write_sumo, "<fcd-export>", '<!DOCTYPE a [<!ENTITY b "c">]><fcd-export>', 3),
        (write_sumo, 'x="1.2000"', 'x="left"', 4),
        (write_stanford, " 0 0 1 ", " 0 1 ", 1),
        (write_drone, "0,1,1,0,1.2", "0,1,1,0,far1.2", 2),
        (write_qtm, "1200.000", "near", 12),
        (write_vadere, "1 0.2 0.6", "1 0.9 0.6", 10),
        (write_viswalk, "1.2000", "1,2000", 6),
        (write_kitti, "1.200000", "far", 1),
        (write_vsp, " - Num", " and a half - Num", 2),
        (write_trajnet, '"f": 6, "p": 1', '"f": 6.5, "p": 1', None),
    ],
)
def test_a_damaged_text_is_refused_by_its_line(tmp_path, write, old, new, line):
    path = write(tmp_path)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    pixels = write in (write_stanford, write_vsp)
    with unread(path, line):
        people_in(path, ReadOptions(pixel_m=PIXEL_M) if pixels else None)


def test_a_database_of_another_form_is_refused(tmp_path):
    view = "DROP TABLE trajectory_data; CREATE VIEW trajectory_data AS SELECT 1 AS frame"
    for statement in ("UPDATE metadata SET value = '4' WHERE key = 'version'", view):
        path = write_jupedsim(tmp_path)
        database = sqlite3.connect(path)
        database.executescript(statement)
        database.close()
        with unread(path):
            people_in(path)


def test_a_database_that_is_still_written_is_refused(tmp_path):
    path = write_jupedsim(tmp_path)
    (tmp_path / "simulation.sqlite-wal").write_bytes(b"pages")
    with unread(path):
        people_in(path)


def test_an_archive_whose_table_lies_elsewhere_is_refused(tmp_path):
    path = write_archive(tmp_path)
    path.rename(tmp_path / "other.h5")
    with h5py.File(path, "w") as file:
        file["trajectory"] = h5py.ExternalLink("other.h5", "/trajectory")
    with unread(path, remedy="HDF5"):
        people_in(path)


@pytest.mark.parametrize(
    ("raw", "remedy"),
    [
        (b"PK\x03\x04", "CSV"),
        (b"\x80\x04\x95", "pickles are not opened"),
        (b"<geometry unit='m'><rooms/></geometry>", "--map"),
        (b"Trajectories\r\n100\r\n,,Ped1:Head,,,Ped2:Head,,\r\nFrame,Sub Frame\r\n", "time,id,x,y"),
    ],
)
def test_a_file_of_another_kind_is_refused_with_a_remedy(tmp_path, raw, remedy):
    (tmp_path / "walk.csv").write_bytes(raw)
    with unread(tmp_path / "walk.csv", remedy=remedy):
        people_in(tmp_path / "walk.csv")


# Rates, units, what one format alone has


@pytest.mark.parametrize("write", [write_jupedsim, write_drone])
def test_another_rate_than_that_of_the_file_is_refused(tmp_path, write):
    path = write(tmp_path)
    assert len(people_in(path, ReadOptions(rate_hz=4.99999))) == len(PEOPLE), "fewer digits"
    with unread(path, remedy="--rate"):
        people_in(path, ReadOptions(rate_hz=4.0))


@pytest.mark.parametrize("write", [write_jupedsim, write_archive, write_kitti])
def test_a_rate_that_no_file_has_must_be_given(tmp_path, write):
    path = write(tmp_path) if write is write_kitti else write(tmp_path, fps=None)
    with unread(path, remedy="--rate"):
        people_in(path)
    assert read_recording(path, ReadOptions(rate_hz=5.0)).scene.detection_dt_s == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("write", "options", "remedy"),
    [
        (write_atc, {"rate_hz": 4.0}, "--rate"),
        (write_stanford, {}, "--scale"),
        (write_sumo, {"pixel_m": 0.1}, "--scale"),
    ],
)
def test_options_must_suit_the_format(tmp_path, write, options, remedy):
    path = write(tmp_path)
    with unread(path, remedy=remedy):
        people_in(path, ReadOptions(**options))


@pytest.mark.parametrize("write", [write_jupedsim, write_archive])
def test_the_geometry_inside_a_file_is_the_map(tmp_path, write):
    ground = read_recording(write(tmp_path)).scene.occupancy
    x, y = np.meshgrid(np.arange(0.25, 12, 0.5), np.arange(0.25, 8, 0.5))
    points = np.stack([x, y], axis=-1).reshape(-1, 2)
    pillar = ((points > [4, 5]) & (points < [5, 6])).all(axis=-1)
    np.testing.assert_array_equal(ground.is_occupied(points), pillar)
    assert ground.is_occupied(np.array([[-1.0, 4.0], [13.0, 4.0], [6.0, 9.0]])).all()


def test_a_geometry_inside_a_file_is_read_only_for_a_map(tmp_path):
    path = write_jupedsim(tmp_path, wkt=("nonsense",))
    with unread(path):
        read_recording(path)
    assert len(read_recording(path, with_walls=False).scene.trajectories) == len(PEOPLE)


def test_hdf5_of_jupedsim_has_its_time_step_and_its_regions(tmp_path):
    halves = ("POLYGON ((0 0, 6 0, 6 8, 0 8, 0 0))", "POLYGON ((6 0, 12 0, 12 8, 6 8, 6 0))")
    files = write_schema(tmp_path, regions=halves), write_jupedsim(tmp_path, wkt=halves)
    scene, whole = (read_recording(path).scene for path in files)
    np.testing.assert_allclose(scene.trajectories.position, whole.trajectories.position, atol=1e-6)
    np.testing.assert_allclose(scene.trajectories.time_s, whole.trajectories.time_s)
    np.testing.assert_array_equal(scene.occupancy.occupied, whole.occupancy.occupied)
    path = write_schema(tmp_path, version=3)
    with unread(path):
        people_in(path)


def test_pedpy_reads_the_archive_that_we_read(tmp_path):
    path = write_archive(tmp_path)
    theirs = pedpy.load_trajectory_from_ped_data_archive_hdf5(trajectory_file=path)
    ours = people_in(path)
    assert theirs.frame_rate == RATE_HZ
    order = np.lexsort((ours.track_id, ours.time_s))
    rows = theirs.data.sort_values(["frame", "id"])
    np.testing.assert_allclose(ours.position[order], rows[["x", "y"]].to_numpy())


def test_longitude_and_latitude_of_sumo_are_not_metres(tmp_path):
    degrees = [(k, who, 11.5 + x * 1e-5, 48.1 + y * 1e-5) for k, who, x, y in ROWS]
    path = write_sumo(tmp_path, degrees)
    path.write_text(path.read_text().replace('.00" angle', '.00001" angle'))
    with unread(path, remedy="--fcd-output.geo"):
        people_in(path)


def test_the_files_of_a_drone_recording_lie_together(tmp_path):
    path = write_drone(tmp_path)
    (tmp_path / "00_recordingMeta.csv").unlink()
    with unread(path, remedy="--rate"):
        people_in(path)
    assert len(people_in(path, ReadOptions(rate_hz=5.0))) == len(PEOPLE)
    (tmp_path / "00_tracksMeta.csv").unlink()
    with unread(tmp_path / "00_tracksMeta.csv"):
        people_in(path)


def test_footsteps_are_sampled_and_gaps_stay_gaps(tmp_path):
    people = people_in(write_vadere(tmp_path), ReadOptions(rate_hz=20.0))
    one = people.select(people.track_id == 1)
    np.testing.assert_allclose(one.position[:, 0], 1.0 + one.time_s, atol=1e-9)
    head = "pedestrianId simTime endTime-PID1 startX-PID1 startY-PID1 endX-PID1 endY-PID1"
    elsewhere = ["2 0 1 0 5 1 5", "2 1 2 1 5 2 5", "2 9 10 30 5 31 5"]
    people = people_in(lines(tmp_path / "postvis.traj", head, *elsewhere), ReadOptions(rate_hz=4.0))
    np.testing.assert_allclose(people.time_s, np.concatenate([np.arange(9) / 4, 9 + np.arange(5) / 4]))


def test_trajnet_may_miss_positions_and_scenes(tmp_path, caplog):
    path = write_trajnet(tmp_path)
    whole = people_in(path)
    lost = '{"track": {"f": 900, "p": 3, "x": NaN, "y": null}}'
    path.write_text(f"{path.read_text()}{lost}\n")
    np.testing.assert_array_equal(people_in(path).position, whole.position)
    assert [record.levelname for record in caplog.records] == ["WARNING"]
    path.write_text(path.read_text().replace(trajnet_scene(RATE_HZ), ""))
    np.testing.assert_allclose(people_in(path, ReadOptions(rate_hz=30.0)).time_s, whole.time_s)


def test_splines_of_ucy_pass_through_their_control_points(tmp_path):
    """Two people; y is upwards, the first is seen in frames 0 to 100, the second in one of every 10th."""
    points = [(-45, 203, 0), (-5, 190, 50), (100, 150, 100)]
    rows = [f"{x} {y} {k} -90.0 - (2D point, m_id)" for x, y, k in points]
    head = "2 - the number of splines"
    more = ["1 - Num of control points", "7 8 40 0.0 - (2D point, m_id)"]
    path = lines(tmp_path / "zara.vsp", head, "3 - Num of control points", *rows, *more)
    people = people_in(path, ReadOptions(pixel_m=0.02, any_speed=True))
    one = people.select(people.track_id == 0)
    np.testing.assert_allclose(one.time_s, np.arange(11) * 0.4)
    np.testing.assert_allclose(one.position[[0, 5, 10]], 0.02 * np.array(points)[:, :2])
    assert people.position[people.track_id == 1].tolist() == [[0.14, 0.16]]
