"""Formats of the field: written after their specifications, read to the value, refused by name."""

import re
import sqlite3

import h5py
import numpy as np
import pedpy
import pytest

from pedpred.command import main
from pedpred.errors import InputError
from pedpred.reading import FORMATS, format_of, read_recording
from pedpred.reading.options import ReadOptions
from pedpred.storage.scenes import read_scene
from tests.field_formats import (
    BINARY,
    OPTIONS,
    PEOPLE,
    PIXEL_M,
    RATE_HZ,
    ROWS,
    UNIX_S,
    WKT,
    WRITERS,
    lines,
    trajnet_scene,
    write_archive,
    write_atc,
    write_drone,
    write_jupedsim,
    write_kitti,
    write_magni,
    write_qtm,
    write_schema,
    write_stanford,
    write_sumo,
    write_trajnet,
    write_vadere,
    write_viswalk,
    write_vsp,
)


def people_in(path, options=None):
    return read_recording(path, options).scene.trajectories


def named_ids(path, options=None):
    """Numbers of people from 1, whatever their ids are."""
    return np.unique(people_in(path, options).track_id, return_inverse=True)[1] + 1


@pytest.mark.parametrize("name", [name for name in WRITERS if name != "UCY splines"])
def test_a_format_is_read_to_the_value(tmp_path, name):
    path, options = WRITERS[name](tmp_path), OPTIONS.get(name)
    people = people_in(path, options)
    start_s = UNIX_S if name == "ATC shopping centre" else 0.0
    np.testing.assert_allclose(people.time_s - start_s, PEOPLE.time_s, atol=1e-6)
    np.testing.assert_array_equal(named_ids(path, options), PEOPLE.track_id)
    np.testing.assert_allclose(people.position, PEOPLE.position, atol=1e-3 if start_s else 1e-4)


@pytest.mark.parametrize("name", WRITERS)
def test_a_format_is_told_by_its_content_and_said(tmp_path, name, capsys):
    path = WRITERS[name](tmp_path)
    for suffix in ("", ".data", ".csv", ".SQLITE"):
        other = tmp_path / f"renamed{suffix}"
        other.write_bytes(path.read_bytes())
        assert format_of(other, ReadOptions()) is format_of(path, ReadOptions())
    about = OPTIONS.get(name, ReadOptions())
    stated = {"--scale": about.pixel_m, "--rate": about.rate_hz}
    options = [word for option, value in stated.items() if value for word in (option, str(value))]
    main(["info", str(path), *options])
    assert f"read as  {name.split(',')[0].split(' (')[0]}" in capsys.readouterr().out


def test_every_format_is_written_here():
    assert {reader.NAME for reader in FORMATS} <= set(WRITERS)


@pytest.mark.parametrize("name", WRITERS)
def test_every_format_bounds_what_it_reads(tmp_path, monkeypatch, name):
    path = WRITERS[name](tmp_path)
    for module in ("text", "formats.vadere", "formats.trajnet", "formats.sumo", "formats.vsp"):
        monkeypatch.setattr(f"pedpred.reading.{module}.MOST_NUMBERS", 20)
    monkeypatch.setattr("pedpred.reading.formats.jupedsim._MOST_ROWS", 5)
    monkeypatch.setattr("pedpred.reading.formats.jupedsim._BLOCK_ROWS", 5)
    if name != "Pedestrian Dynamics Data Archive":  # another process
        with pytest.raises(InputError, match=r"more than \d+ (rows|detections)"):
            read_recording(path, OPTIONS.get(name))


@pytest.mark.parametrize("name", BINARY)
def test_columns_that_a_file_names_are_not_named_again(tmp_path, name):
    with pytest.raises(InputError, match=f"{name}.*--columns"):
        read_recording(WRITERS[name](tmp_path), ReadOptions(columns=("time", "id", "x", "y")))


# What is wrong is said


@pytest.mark.parametrize(
    ("write", "old", "new", "named"),
    [
        (write_sumo, "<fcd-export>", '<!DOCTYPE a [<!ENTITY b "c">]><fcd-export>', "line 3: a document type"),
        (write_sumo, "<person", f'<person note="{"x" * 2**21}"', "an element of more than"),
        (write_sumo, "<timestep", "<a>" * 50 + "<timestep", "more than 8 deep"),
        (write_sumo, 'x="1.2000"', 'x="left"', r"line 4: x = 'left' is not a number"),
        (write_sumo, "</fcd-export>", "", "no element found"),
        (write_stanford, " 0 0 1 ", " 0 1 ", "line 1: 9 columns, expected 10"),
        (write_stanford, '"Pedestrian"', '"Biker"', "41 of 'Biker'.*--class"),
        (write_drone, "0,1,1,0,1.2", "0,1,1,0,far1.2", "line 2: xCenter = 'far1.2"),
        (write_qtm, "1200.000", "near", r"line 12: Helmet_1 - 1 X = 'near' is not a number"),
        (write_magni, "1,0.2,", "1,,", "time is missing"),
        (write_vadere, "endTime-PID1", "endTime-PID1 endTime-PID7", "2 columns endTime"),
        (write_vadere, "1 0.2 0.6", "1 0.9 0.6", "endTime is before simTime"),
        (write_viswalk, "COORDCENTX", "LENGTH", "the attribute COORDCENTX was not recorded"),
        (write_viswalk, "1.2000", "1,2000", r"line 6: COORDCENTX = '1,2000' is not a number. .*--decimal ,"),
        (write_kitti, "1.200000", "far", "16 columns|no header|is not a number"),
        (write_vsp, " - Num", " and a half - Num", "line 2: could not convert"),
        (write_trajnet, '"f": 6, "p": 1', '"f": 6.5, "p": 1', "line 2: f = 6.5, must be a whole number"),
        (write_trajnet, '"x": 1.2', '"x": "far"', "line 2: x = 'far' is not a number"),
        (write_trajnet, '{"f"', '{"prediction_number": 0, "f"', "line 2: a forecast.*--forecasts"),
        (write_trajnet, '"fps": 5.0', '"fps": 0', "fps of the scenes: 0.*--rate"),
    ],
)
def test_what_is_wrong_with_a_text_is_said(tmp_path, write, old, new, named):
    path = write(tmp_path)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new) if old == '"Pedestrian"' else text.replace(old, new, 1))
    pixels = write in (write_stanford, write_vsp)
    with pytest.raises(InputError, match=rf"{re.escape(str(path))}.*{named}"):
        read_recording(path, ReadOptions(pixel_m=PIXEL_M) if pixels else None)


@pytest.mark.parametrize(
    ("statement", "named"),
    [
        ("DROP TABLE trajectory_data", "without a table trajectory_data; it has metadata"),
        ("ALTER TABLE trajectory_data RENAME pos_x TO x", "no column pos_x; it has frame, id, x"),
        ("UPDATE trajectory_data SET pos_x = 'far' WHERE frame = 2", r"row 3 .*pos_x = 'far' is not a"),
        ("UPDATE trajectory_data SET id = 1", "row 2: id 1 is at another place"),
        ("UPDATE metadata SET value = '0' WHERE key = 'fps'", "0 is not a frame rate"),
        ("UPDATE metadata SET value = '4' WHERE key = 'version'", "version '4' .* only 1, 2, 3"),
        ("DROP TABLE trajectory_data; CREATE VIEW trajectory_data AS SELECT 1 AS frame", "without a table"),
    ],
)
def test_what_is_wrong_with_a_database_is_said(tmp_path, statement, named):
    path = write_jupedsim(tmp_path)
    database = sqlite3.connect(path)
    database.executescript(statement)
    database.close()
    with pytest.raises(InputError, match=rf"simulation\.sqlite: .*{named}"):
        read_recording(path)


def test_a_database_that_is_still_written_is_refused(tmp_path):
    path = write_jupedsim(tmp_path)
    (tmp_path / "simulation.sqlite-wal").write_bytes(b"pages")
    with pytest.raises(InputError, match="still being written"):
        read_recording(path)


def linked(path):
    """The table lies in another file."""
    path.rename(path.with_name("other.h5"))
    with h5py.File(path, "w") as file:
        file["trajectory"] = h5py.ExternalLink("other.h5", "/trajectory")


def without_ids(path):
    with h5py.File(path, "r+") as file:
        rows = file["trajectory"].fields(["frame", "x", "y"])[:]
        del file["trajectory"]
        file.create_dataset("trajectory", data=rows).attrs["fps"] = 5.0


def cut(path):
    path.write_bytes(path.read_bytes()[:-500])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (linked, "no data set 'trajectory'; there is trajectory"),
        (without_ids, "no column id; it has frame, x, y"),
        (cut, "HDF5: .*truncated"),
    ],
)
def test_an_archive_that_is_not_as_it_should_be_is_refused(tmp_path, change, message):
    path = write_archive(tmp_path)
    change(path)
    with pytest.raises(InputError, match=message):
        read_recording(path)


@pytest.mark.parametrize(
    ("raw", "named"),
    [
        (b"PK\x03\x04", "zip archive or a spreadsheet"),
        (b"#ROSBAG V2.0\n", r"bag of ROS 1.*\.bag"),
        (b"PAR1\0\0", "Parquet"),
        (b"\x80\x04\x95", "pickle"),
        (b"<geometry unit='m'><rooms/></geometry>", r"<geometry>.*--map"),
        (b"walk.csv".ljust(257, b"\0") + b"ustar\x0000", "tar archive.*Unpack"),
        (b"Format Version,1.23,Take Name,walk,Export Frame Rate,120.0\n\n,Type\n", "Motive.*a line per body"),
        (b"Trajectories\r\n100\r\n,,Ped1:Head,,,Ped2:Head,,\r\nFrame,Sub Frame\r\n", "Nexus.*a line per"),
        (b'{"time": 0}\n', "JSON of a kind"),
        (b"\0\1\2\3", "neither text nor a known recording.*00 01 02 03"),
        (b"", "the file is empty"),
    ],
)
def test_what_is_not_read_is_named(tmp_path, raw, named):
    (tmp_path / "walk.csv").write_bytes(raw)
    with pytest.raises(InputError, match=rf"walk\.csv: .*{named}"):
        read_recording(tmp_path / "walk.csv")


# Rates, units, what one format alone has


def _qtm_without_times(folder):
    path = write_qtm(folder)
    path.write_text(path.read_text().replace("\tTime\t", "\tOther\t"))
    return path


@pytest.mark.parametrize("write", [write_jupedsim, write_archive, write_drone, _qtm_without_times])
def test_another_rate_than_that_of_the_file_is_refused(tmp_path, write):
    path = write(tmp_path)
    assert len(people_in(path, ReadOptions(rate_hz=4.99999))) == len(PEOPLE), "fewer digits"
    with pytest.raises(InputError, match="--rate"):
        read_recording(path, ReadOptions(rate_hz=4.0))


@pytest.mark.parametrize("write", [write_jupedsim, write_archive, write_kitti])
def test_the_rate_is_asked_for_where_no_file_says_it(tmp_path, write):
    file = write(tmp_path) if write is write_kitti else write(tmp_path, fps=None)
    with pytest.raises(InputError, match="--rate"):
        read_recording(file)
    assert read_recording(file, ReadOptions(rate_hz=5.0)).scene.detection_dt_s == pytest.approx(0.2)


@pytest.mark.parametrize("write", [write_qtm, write_sumo, write_viswalk, write_atc])
def test_a_rate_for_a_file_with_times_is_refused(tmp_path, write):
    with pytest.raises(InputError, match=r"the file has times\. Leave --rate out"):
        read_recording(write(tmp_path), ReadOptions(rate_hz=4.0))


def test_a_unit_or_a_scale_that_differs_from_that_of_the_format_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"pixels.*--scale 0\.03"):
        read_recording(write_stanford(tmp_path))
    with pytest.raises(InputError, match="--scale and --homography"):
        read_recording(write_sumo(tmp_path), ReadOptions(pixel_m=0.1))
    with pytest.raises(InputError, match="--unit"):
        read_recording(write_atc(tmp_path), ReadOptions(unit="cm"))


@pytest.mark.parametrize("write", [write_jupedsim, write_archive])
def test_the_geometry_inside_a_file_is_the_map_and_may_have_an_open_end(tmp_path, write):
    path = write(tmp_path)
    ground = read_recording(path).scene.occupancy
    x, y = np.meshgrid(np.arange(0.25, 12, 0.5), np.arange(0.25, 8, 0.5))
    points = np.stack([x, y], axis=-1).reshape(-1, 2)
    pillar = ((points > [4, 5]) & (points < [5, 6])).all(axis=-1)
    np.testing.assert_array_equal(ground.is_occupied(points), pillar)
    assert ground.is_occupied(np.array([[-1.0, 4.0], [13.0, 4.0], [6.0, 9.0]])).all()
    main(["convert", str(path), "-o", str(tmp_path / "open"), "--open-end", "12", "0", "12", "8"])
    opened = read_scene(tmp_path / "open").occupancy
    assert not opened.is_occupied(np.array([[12.5, 4.0], [17.5, 4.0]])).any()
    assert opened.is_occupied(np.array([[-0.5, 4.0]])).all()


def test_a_geometry_inside_a_file_is_read_where_it_is_needed_alone(tmp_path):
    path = write_jupedsim(tmp_path, wkt=("nonsense",))
    with pytest.raises(SystemExit, match=r"simulation\.sqlite: .*NONSENSE"):
        main(["info", str(path)])
    main(["info", str(path), "--no-map"])


@pytest.mark.parametrize("parts", [1, 2])
def test_hdf5_of_jupedsim_has_its_time_step_and_its_regions(tmp_path, parts):
    halves = ("POLYGON ((0 0, 6 0, 6 8, 0 8, 0 0))", "POLYGON ((6 0, 12 0, 12 8, 6 8, 6 0))")
    wkt = (WKT,) if parts == 1 else halves
    files = write_schema(tmp_path, regions=wkt), write_jupedsim(tmp_path, wkt=wkt)
    scene, whole = (read_recording(path).scene for path in files)
    np.testing.assert_allclose(scene.trajectories.position, whole.trajectories.position, atol=1e-6)
    np.testing.assert_allclose(scene.trajectories.time_s, whole.trajectories.time_s)
    np.testing.assert_array_equal(scene.occupancy.occupied, whole.occupancy.occupied)
    with pytest.raises(InputError, match=r"schema_version 3 .* is not known, only 1, 2"):
        read_recording(write_schema(tmp_path, version=3))


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
    with pytest.raises(InputError, match=r"longitude.*fcd-output\.geo"):
        read_recording(path)


def test_the_files_of_a_drone_recording_lie_together(tmp_path):
    path = write_drone(tmp_path)
    (tmp_path / "00_recordingMeta.csv").unlink()
    with pytest.raises(InputError, match="--rate"):
        read_recording(path)
    assert len(people_in(path, ReadOptions(rate_hz=5.0))) == len(PEOPLE)
    (tmp_path / "00_tracksMeta.csv").unlink()
    with pytest.raises(InputError, match=r"00_tracksMeta\.csv: the file is missing.*lie together"):
        read_recording(path)
    with pytest.raises(InputError, match=r"walk\.csv.*name of this one.*NN_tracks\.csv"):
        read_recording(path.rename(path.with_name("walk.csv")))


@pytest.mark.parametrize("columns_before", [0, 1, 2])
@pytest.mark.parametrize("decimal", [".", ","])
def test_an_export_of_qtm_may_have_no_titles_and_decimal_commas(tmp_path, columns_before, decimal):
    path = write_qtm(tmp_path)
    rows = [row for row in path.read_text().splitlines() if not row.startswith("Frame\t")]
    data = [row.split("\t") if row[0].isdecimal() else [] for row in rows]
    before = {0: [], 1: [0], 2: [0, 1]}[columns_before]
    kept = ["\t".join([*(fields[k] for k in before), *fields[2:]]) for fields in data if fields]
    rows = [row for row in rows if not row[0].isdecimal()] + kept
    path.write_text("\n".join(re.sub(r"(?<=\d)\.(?=\d)", decimal, row) for row in rows))
    np.testing.assert_allclose(people_in(path).position, PEOPLE.position, atol=1e-6)


@pytest.mark.parametrize("rate_hz", [5.0, 20.0])
def test_footsteps_are_sampled_as_often_as_asked_and_nobody_is_invented_between_them(tmp_path, rate_hz):
    people = people_in(write_vadere(tmp_path), ReadOptions(rate_hz=rate_hz))
    one = people.select(people.track_id == 1)
    np.testing.assert_allclose(one.position[:, 0], 1.0 + one.time_s, atol=1e-9)
    head = "pedestrianId simTime endTime-PID1 startX-PID1 startY-PID1 endX-PID1 endY-PID1"
    elsewhere = ["2 0 1 0 5 1 5", "2 1 2 1 5 2 5", "2 9 10 30 5 31 5"]
    people = people_in(lines(tmp_path / "postvis.traj", head, *elsewhere), ReadOptions(rate_hz=4.0))
    np.testing.assert_allclose(people.time_s, np.concatenate([np.arange(9) / 4, 9 + np.arange(5) / 4]))


@pytest.mark.parametrize("nowhere", ["NaN", "null"])
def test_trajnet_may_miss_positions_and_scenes(tmp_path, nowhere, caplog):
    path = write_trajnet(tmp_path)
    whole = people_in(path)
    lost = f'{{"track": {{"f": 900, "p": 3, "x": {nowhere}, "y": {nowhere}}}}}'
    path.write_text(f"{path.read_text()}{lost}\n")
    np.testing.assert_array_equal(people_in(path).position, whole.position)
    assert "dropped 1 rows without a position" in caplog.text
    path.write_text(path.read_text().replace(trajnet_scene(RATE_HZ), ""))
    np.testing.assert_allclose(people_in(path, ReadOptions(rate_hz=30.0)).time_s, whole.time_s)


def test_labels_of_a_camera_that_may_move_are_read_with_a_warning(tmp_path, caplog):
    people_in(write_kitti(tmp_path), ReadOptions(rate_hz=5.0))
    assert "relative to the camera" in caplog.text
    assert "occluded" not in caplog.text


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


def test_formats_that_are_binary_are_two(tmp_path):
    raw = {name: WRITERS[name](tmp_path).read_bytes() for name in WRITERS}
    assert {name for name, content in raw.items() if b"\0" in content} == set(BINARY)
