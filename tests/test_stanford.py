"""Pixels of the Stanford Drone Dataset on the ground: by their size, or by a homography."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pedpred.command import main
from pedpred.errors import SourceError, ValueRuleError
from pedpred.geometry import Homography
from pedpred.sources.single_file import read_file
from pedpred.tables.options import TableOptions
from pedpred.tables.pictures import read_homography
from tests.field_formats import PEOPLE, PIXEL_M, ROWS, lines, write_stanford, write_sumo

INCLINED = np.array([[0.05, 0.01, -3.0], [0.002, -0.06, 20.0], [1e-4, 8e-4, 1.0]])


def annotated(folder, to_pixels):
    """The usual people, in a picture that shows the ground (x, y) at some pixels (x, y)."""
    boxes = []
    for k, who, *place in ROWS:
        x, y = to_pixels(np.array(place))
        boxes.append(f'{who} {x - 8:.6f} {y - 9:.6f} {x + 8:.6f} {y + 9:.6f} {6 * k} 0 0 0 "Pedestrian"')
    return lines(folder / "annotations.txt", *boxes)


def shown(place):
    seen = np.linalg.inv(INCLINED) @ [*place, 1.0]
    return seen[:2] / seen[2]


@pytest.mark.parametrize("text", ["{}", "# H\n{}", "{} {} {}, 1", "1\n2\n3", "nan " * 9, "1 2 3\n" * 3])
def test_a_file_without_an_invertible_matrix_is_refused(tmp_path, text):
    (tmp_path / "H.txt").write_text(text)
    with pytest.raises(SourceError, match=r"H\.txt.*"):
        read_homography(tmp_path / "H.txt")


@given(
    st.sampled_from(["{} {} {}\n" * 3, "{},{},{}\n" * 3, "[[{}, {}, {}],\n" + " [{}, {}, {}],\n" * 2 + "]"])
)
def test_a_matrix_may_be_written_in_every_usual_way(tmp_path_factory, form):
    path = tmp_path_factory.getbasetemp() / "H.txt"
    path.write_text(form.format(*INCLINED.ravel().tolist()))
    np.testing.assert_array_equal(read_homography(path).matrix[:, [1, 0, 2]], INCLINED)


def test_comments_of_a_matrix_are_passed_over_and_other_texts_are_told_what_it_is(tmp_path):
    np.savetxt(tmp_path / "H.txt", INCLINED, fmt="%.17g", header="pixels to metres 1 2 3")
    np.testing.assert_array_equal(read_homography(tmp_path / "H.txt").matrix[:, [1, 0, 2]], INCLINED)
    (tmp_path / "H.txt").write_text("%YAML:1.0\nH: !!opencv-matrix\n")
    with pytest.raises(SourceError, match=r"'%YAML:1\.0' is not a number\. A homography has 3 x 3 numbers"):
        read_homography(tmp_path / "H.txt")


@pytest.mark.parametrize("separator", ["\t", ",", ", "])
def test_boxes_may_have_other_separators(tmp_path, separator):
    path = write_stanford(tmp_path)
    plain = read_file(path, TableOptions(pixel_m=PIXEL_M)).trajectories
    path.write_text(path.read_text().replace(" ", separator))
    found = read_file(path, TableOptions(pixel_m=PIXEL_M)).trajectories
    np.testing.assert_array_equal(found.position, plain.position)


def test_an_inclined_camera_is_undone(tmp_path, capsys):
    path = annotated(tmp_path, shown)
    np.savetxt(tmp_path / "H.txt", INCLINED, fmt="%.17g")
    options = TableOptions(homography=read_homography(tmp_path / "H.txt"))
    np.testing.assert_allclose(read_file(path, options).trajectories.position, PEOPLE.position, atol=1e-4)
    main(["info", str(path), "--homography", str(tmp_path / "H.txt")])
    assert "Stanford Drone Dataset" in capsys.readouterr().out


def test_a_scale_is_a_homography_of_a_camera_that_looks_down(tmp_path):
    path = write_stanford(tmp_path)
    np.savetxt(tmp_path / "H.txt", np.diag([PIXEL_M, -PIXEL_M, 1.0]))
    by_size = read_file(path, TableOptions(pixel_m=PIXEL_M)).trajectories
    found = read_file(path, TableOptions(homography=read_homography(tmp_path / "H.txt"))).trajectories
    np.testing.assert_allclose(found.position, by_size.position)


def test_people_beyond_the_horizon_are_refused(tmp_path):
    path = annotated(tmp_path, lambda place: 100 * place)
    flat = Homography(np.array([[1.0, 0, 0], [0, 1.0, 0], [0, -1.0 / 500, 1.0]])[:, [1, 0, 2]])
    with pytest.raises(SourceError, match=r"annotations\.txt, line \d+: the pixel x = .*horizon"):
        read_file(path, TableOptions(homography=flat))


def test_only_pixels_have_a_homography_and_not_with_a_size(tmp_path):
    np.savetxt(tmp_path / "H.txt", INCLINED)
    own = ["--homography", str(tmp_path / "H.txt")]
    with pytest.raises(SystemExit, match=r"--homography.*are not pixels"):
        main(["info", str(write_sumo(tmp_path)), *own])
    with pytest.raises(SystemExit, match=r"--scale.*omit one"):
        main(["info", str(write_stanford(tmp_path)), *own, "--scale", "0.03"])
    with pytest.raises(ValueRuleError, match="omit one"):
        TableOptions(pixel_m=0.1, homography=Homography(np.eye(3)))


def test_labels_need_no_quotes(tmp_path):
    path = write_stanford(tmp_path)
    path.write_text(path.read_text().replace('"', ""))
    found = read_file(path, TableOptions(pixel_m=PIXEL_M)).trajectories
    np.testing.assert_allclose(found.position, PEOPLE.position, atol=1e-4)


@pytest.mark.parametrize("name", ["scale", "homography"])
def test_pixels_that_are_too_large_are_not_told_to_have_a_unit(tmp_path, name):
    path = tmp_path / "walk.csv"
    rows = [f"{6 * k},{who},{100 * x},{100 * y}" for k, who, x, y in ROWS]
    path.write_text("\n".join(["frame,id,x_px,y_px", *rows]))
    np.savetxt(tmp_path / "H.txt", np.diag([10.0, 10.0, 1.0]))
    given = TableOptions(rate_hz=30.0, pixel_m=10.0)
    if name == "homography":
        given = TableOptions(rate_hz=30.0, homography=read_homography(tmp_path / "H.txt"))
    with pytest.raises(SourceError, match=r"metres here.*Or correct --scale, --homography") as error:
        read_file(path, given)
    assert "Say --unit" not in str(error.value)
