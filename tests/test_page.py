"""The page stands alone, its figures are the metrics' and its player shows what was forecast."""

import dataclasses
import json
import os
import re
import shutil
import zlib
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import sync_playwright

from pedpred.errors import ValueRuleError
from pedpred.networks.autoencoder import GridAutoencoder
from pedpred.report.charts import Line, LinePlot, box_plot, whiskers
from pedpred.report.gallery import Evaluated
from pedpred.report.measures import results_of
from pedpred.report.page.build import Contents, page
from pedpred.report.page.player import path_codes, point_order, replay
from pedpred.report.places import places_section
from pedpred.report.snapshots import grid_image
from tests.forecasts import METHODS, PAPER
from tests.simulated import read
from tests.test_report import IN_SIMULATION, MEETING, curve_tables, metrics_of, planned, wall_scene

REPORTS = Path(__file__).resolve().parents[1] / "reports"
LATENCY = [{"pedestrians": n, "median_ms": 0.5 * n, "p99_ms": 0.7 * n} for n in (1, 20, 200)]


@pytest.fixture(scope="module")
def hall():
    """A scene of walkers beside a block, and forecasts in it."""
    return wall_scene(), planned(wall_scene(), planted_s=0.6)


PUBLISHED = read("literature/eth_ucy")["published"]
SIMULATED = {"sim_test": metrics_of(IN_SIMULATION), "sim_test_hall": metrics_of(IN_SIMULATION)}
REAL = {"eth": metrics_of(MEETING | {"lstm": 0.65, "ca": 9.0}), "hotel": metrics_of(MEETING)}
FOLDS = [
    {"train": ["real/hotel"], "test": ["real/eth"]},
    {"train": ["real/eth"], "test": ["real/hotel"]},
]


def contents_of(scene, windows):
    network, curves = GridAutoencoder(60, 8), curve_tables()
    simulated = results_of(SIMULATED, [{"test": ["simulated/sim_test"]}], "sim", 0.3)
    real = results_of(REAL, FOLDS, "real", 0.3)
    places = {name: [dataclasses.replace(scene, name=name)] for name in REAL}
    evaluated = [
        Evaluated("sim", "simulated", simulated, {"sim_test": [scene]}, {"hall": windows}, curves, network),
        Evaluated("real", "real", real, places, dict.fromkeys(REAL, windows), {}, network),
    ]
    few = {name: REAL["eth"][name] | {"fde_m_ci95": [0.1, 0.2]} for name in ("cv", "kalman_cv")}
    shown = [replay(scene, windows, 2.1, METHODS), replay(wall_scene("attic"), windows, 1.2, METHODS)]
    literature = dict.fromkeys(REAL, few)
    side = places_section(evaluated, METHODS).blocks
    return Contents(evaluated, shown, METHODS, PAPER, [], literature, PUBLISHED, LATENCY, side)


@pytest.fixture(scope="module")
def contents(hall):
    return contents_of(*hall)


@pytest.fixture(scope="module")
def text(contents):
    return page(contents)


# What the player gets


def unpacked(found):
    """The columns as they are packed, read as documented: zigzag, seven bits per byte."""
    values, value, shift = [], 0, 0
    for byte in zlib.decompress(found.data, -15):
        value, shift = value | (byte & 127) << shift, shift + 7
        if byte < 128:
            values.append(-(value + 1) // 2 if value & 1 else value // 2)
            value = shift = 0
    columns = {}
    for name, shape in found.header["columns"]:
        columns[name] = np.array(values[: np.prod(shape)]).reshape(shape)
        del values[: np.prod(shape)]
    assert values == []
    return columns


def test_a_replay_keeps_its_stretch_and_the_seconds_that_forecasts_are_about(hall):
    scene, windows = hall
    found = replay(scene, windows, 0.9, METHODS)
    columns = unpacked(found)
    assert np.unique(np.cumsum(columns["time"])).tolist() == [0, 30, 60, 90]
    assert np.cumsum(columns["seen_time"]).max() == 390
    assert replay(scene, windows, 60.0, METHODS).header["duration_s"] == pytest.approx(np.ptp(windows.time_s))
    assert found.data == replay(scene, windows, 0.9, METHODS).data
    obstacles = np.unpackbits(columns["obstacles"].astype(np.uint8), axis=1, bitorder="little")[:, :200]
    np.testing.assert_array_equal(obstacles, scene.occupancy.occupied.T)


def test_straight_and_steadily_curved_paths_are_coded_by_two_points():
    along = np.arange(1, 11)[:, None]
    path = np.array([along * [30, -20], along * [30, 0] + along**2 * [0, 2]])
    codes = path_codes(path, np.array([1, 2]))
    assert point_order(10) == [10, 5, 2, 7, 3, 8, 1, 4, 6, 9]
    assert codes[:, 0].tolist() == path[:, -1].tolist()
    assert (codes[:, 2:] == 0).all()
    assert path_codes(path[[0, 0]], np.array([1, 1]))[1, 0].tolist() == [0, 0]


def test_what_does_not_fit_a_replay_is_refused(hall):
    scene, windows = hall
    slow = dataclasses.replace(windows, time_s=windows.time_s * 400.0)
    with pytest.raises(ValueRuleError, match="time_s"):
        replay(scene, slow, 1e6, METHODS)


# Where the marks lie


def test_boxes_and_whiskers_lie_at_their_values():
    methods = metrics_of(MEETING | {"ca": 9.0})
    plot = box_plot(methods, "here", 0.3, METHODS)
    zero, tick = plot.frame.y_ticks[0], plot.frame.y_ticks[1]
    height = {value: zero[0] + (tick[0] - zero[0]) * value / float(tick[1]) for value in (0.0, 1.0)}
    box, found = plot.boxes["lstm"][6], methods["lstm"]
    for where, field in (("mean", "per_step_m"), ("bottom", "per_step_q25_m"), ("median", "per_step_q50_m")):
        expected = height[0.0] + (height[1.0] - height[0.0]) * found[field][6]
        assert getattr(box, where) == pytest.approx(expected, abs=0.06)
    assert plot.beyond == "CA"
    marks = whiskers(methods)
    assert marks["ca"].beyond
    assert marks["lstm"].middle / marks["cv"].middle == pytest.approx(0.4 / 0.7)
    assert not any(mark.beyond for name, mark in marks.items() if name != "ca")


def test_a_line_ends_where_its_series_ends():
    line = Line("lstm", "LSTM", np.array([0.0, 4.0]), np.array([2.0, 1.0]))
    plot = LinePlot("x", "step", "m", [line])
    x, y = map(float, plot.points(line).split()[-1].split(","))
    assert line.tip == "LSTM, at the end 1.000"
    assert x == plot.frame.width
    assert y == pytest.approx(plot.frame.height * (1 - 1 / 2.1), abs=0.05)


@pytest.mark.parametrize(("value", "place"), [(0.0, 1.0), (-2.0, 1 / 1.05)])
def test_zeros_and_negative_values_have_a_place(value, place):
    line = Line("lstm", "", np.zeros(1), np.array([value]))
    plot = LinePlot("x", "step", "loss", [line])
    assert float(plot.points(line).split(",")[1]) == pytest.approx(plot.frame.height * place, abs=0.06)


# What stands on the page


class Figures(HTMLParser):
    """Collects the text of every element that names its place in the metrics, and all addresses."""

    def __init__(self, text):
        super().__init__()
        self.found, self.addresses, self._place = [], [], None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        self._place = attrs.get("data-metric")
        self.addresses += [attrs[name] for name in ("src", "href", "srcset", "action") if name in attrs]

    def handle_data(self, data):
        if self._place:
            self.found.append((self._place, data.strip()))
            self._place = None


def measured(metrics, place):
    for part in place.split("."):
        metrics = metrics[int(part) if isinstance(metrics, list) else part]
    return metrics


def assert_figures_are_metrics(text, metrics):
    figures = Figures(text).found
    for place, shown in figures:
        value, number = measured(metrics, place), float(shown.removesuffix("%"))
        digits = len(shown.removesuffix("%").strip().partition(".")[2])
        scale = 100 if shown.endswith("%") else 1
        assert number == pytest.approx(scale * value, abs=0.5001 * 10**-digits), place
    return figures


def test_every_figure_of_the_page_is_in_the_metrics(contents, text):
    metrics = {**SIMULATED, **REAL, "real": REAL, "literature": contents.literature}
    metrics["latency"] = {"updates": LATENCY}
    figures = assert_figures_are_metrics(text, metrics)
    some = {"sim_test.lstm.ade_m", "eth.cv.fde_m", "literature.eth.cv.fde_m", "latency.updates.1.median_ms"}
    assert some | {"real.hotel.lstm.ade_m", "real.eth.cv.obstacle_share"} <= {p for p, _ in figures}


def test_every_figure_of_the_committed_page_is_in_the_committed_metrics():
    metrics = {}
    for path in sorted((REPORTS / "metrics").glob("*.json")):
        found = json.loads(path.read_text())
        metrics |= {path.stem: found} | (found if path.stem in ("sim", "real") else {})
    text = (REPORTS / "index.html").read_text()
    assert len(assert_figures_are_metrics(text, metrics)) > 100


def test_the_committed_page_is_light():
    assert (REPORTS / "index.html").stat().st_size < 1.5e6


def test_a_page_is_the_same_twice_and_needs_nothing_else(hall, text):
    assert text == page(contents_of(*hall))
    assert text.startswith("<!doctype html>")
    assert [a for a in Figures(text).addresses if not a.startswith(("data:", "#"))] == []
    assert not re.search(r"url\(|@import|\bfetch\(|XMLHttpRequest", text)


def test_the_page_says_what_was_missed(text):
    assert "<strong>1 of 11 expectations is missed</strong>" in text
    assert "could not be reproduced" in text


# In a browser


@pytest.fixture(scope="module")
def browser():
    """A headless Chromium of this machine."""
    path = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if path is None and os.environ.get("PEDPRED_REQUIRE_CHROMIUM"):
        pytest.fail("Chromium is required here, but it is not installed")
    if path is None:
        pytest.skip("the page is tried out in Chromium, which is not installed")
    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield opened
        opened.close()


@pytest.fixture(scope="module")
def file(text, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "index.html"
    path.write_text(text)
    return path


class Visit:
    """The page in a window without network; whatever goes wrong is collected."""

    def __init__(self, browser, file, width, scheme):
        size = {"width": width, "height": 900}
        self.context = browser.new_context(viewport=size, color_scheme=scheme, offline=True)
        self.page, self.problems = self.context.new_page(), []
        self.page.on("console", lambda said: self.problems.append(said.text))
        self.page.on("pageerror", lambda error: self.problems.append(str(error)))
        self.page.on("request", self.requested)
        self.page.goto(file.as_uri())
        self.page.wait_for_selector("#player[data-time]")

    def requested(self, asked):
        if not asked.url.startswith(("file:", "data:", "blob:")):
            self.problems.append(asked.url)

    def state(self, name):
        return self.page.locator("#player").get_attribute(f"data-{name}")

    def scrub(self, time_s):
        move = "(bar, t) => { bar.value = t; bar.dispatchEvent(new Event('input')); }"
        self.page.locator(".scrub").evaluate(move, time_s)

    def place_of(self, position):
        """Where a point (m) of the hall of 20 m x 20 m lies in the plan, px."""
        box = self.page.locator(".plan").bounding_box()
        scale = min(box["width"], box["height"]) / 20
        left, bottom = (box["width"] - 20 * scale) / 2, (box["height"] + 20 * scale) / 2
        return {"x": left + scale * position[0], "y": bottom - scale * position[1]}


@pytest.fixture
def visit_at(browser, file):
    """Opens the page at a width and in a colour scheme."""
    opened = []

    def visit(width=1280, scheme="light"):
        opened.append(Visit(browser, file, width, scheme))
        return opened[-1]

    yield visit
    for visited in opened:
        visited.context.close()


@pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (390, "dark")])
def test_the_page_loads_alone_and_fits(visit_at, width, scheme):
    visit = visit_at(width, scheme)
    over = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
    assert visit.page.evaluate(over) <= 0
    assert visit.problems == []
    assert visit.state("scene") == "hall"
    colours = "[getComputedStyle(document.body).backgroundColor, getComputedStyle(document.body).color]"
    paper, ink = (sum(map(int, re.findall(r"\d+", c)[:3])) for c in visit.page.evaluate(colours))
    assert (paper > ink) == (scheme == "light")


def test_the_player_plays_scrubs_and_changes_scene(visit_at):
    visit = visit_at()
    visit.scrub(0.3)
    assert visit.state("time") == "0.30"
    visit.page.click(".play")
    visit.page.wait_for_function("Number(document.getElementById('player').dataset.time) > 0.5")
    visit.page.click(".play")
    stopped = visit.state("time")
    assert visit.state("playing") == "false"
    visit.page.locator(".plan").focus()
    visit.page.keyboard.press("ArrowLeft")
    assert float(visit.state("time")) < float(stopped)
    visit.page.keyboard.press("Space")
    assert visit.state("playing") == "true"
    visit.page.click("text=attic")
    visit.page.wait_for_selector("#player[data-scene=attic][data-playing=false]")
    assert visit.problems == []


def test_the_player_shows_what_was_forecast_and_seen(visit_at, hall):
    _, windows = hall
    visit = visit_at()
    read = """({name, rows}) => { const { replay } = document.getElementById("player").player;
        return rows.map((row) => name === "cones" ? replay.cones(row) : replay.path(name, row)); }"""
    rows = np.flatnonzero(windows.time_s < 2.05)
    order = rows[np.lexsort((windows.track_id[rows], windows.time_s[rows].round(3)))]
    lstm = windows.predictions["lstm"].point
    for name, path, off_m in (("truth", windows.truth, 0.00501), ("lstm", lstm, 0.0151)):
        points = np.array(visit.page.evaluate(read, {"name": name, "rows": list(range(len(rows)))}))
        np.testing.assert_allclose(points[:, 0], windows.position[order], atol=0.00501)
        np.testing.assert_allclose(points[:, 1:], path[order], atol=off_m)
    cones = np.array(visit.page.evaluate(read, {"name": "cones", "rows": [0]}))[0]
    assert cones[17] == pytest.approx(np.hypot(0.1, 2.0), abs=0.01)  # the next one: to the left, just ahead
    assert (cones == 6.0).sum() == 71  # all others are further away in the same cone
    cells = """() => { const { replay } = document.getElementById("player").player;
        const brush = replay.gridPicture(2, "#000").getContext("2d"), found = [];
        const { data, width } = brush.getImageData(0, 0, 60, 60);
        for (let k = 3; k < data.length; k += 4) found.push(data[k] ? 1 : 0);
        return found; }"""
    shown = np.array(visit.page.evaluate(cells), bool).reshape(60, 60)
    assert (shown != grid_image(windows.grid(order[2]))).mean() < 0.01


def test_a_click_picks_the_person_there_and_tells_its_errors(visit_at, hall):
    _, windows = hall
    row = int(np.flatnonzero((windows.track_id == 3) & np.isclose(windows.time_s, 0.9))[0])
    visit = visit_at()
    visit.scrub(0.9)
    visit.page.locator(".plan").focus()
    visit.page.keyboard.press("Escape")
    assert visit.state("picked") == ""
    visit.page.click(".plan", position=visit.place_of(windows.position[row]))
    assert visit.state("picked") == "3"
    assert "Person 3" in visit.page.inner_text(".panel")
    told = dict(re.findall(r"(Kalman CV|LSTM)\t([\d.]+)", visit.page.inner_text(".errors")))
    for name, method in (("Kalman CV", "kalman_cv"), ("LSTM", "lstm")):
        assert float(told[name]) == pytest.approx(windows.ade_m(method)[row], abs=0.011)
    visit.page.click(".plan", position=visit.place_of((19.0, 1.0)))
    assert visit.state("picked") == ""
    assert visit.problems == []


def test_a_figure_tells_its_interval_and_a_method_can_be_taken_out(visit_at):
    visit = visit_at(390)
    visit.page.locator('[data-metric="real.eth.lstm.ade_m"]').first.click()
    assert "0.630 to 0.680 m" in visit.page.inner_text("#tip")
    shown = visit.page.locator('.boxes [data-method="ca"]').first
    assert shown.is_visible()
    visit.page.locator('.legend input[value="ca"]').evaluate("box => box.click()")
    assert not shown.is_visible()
