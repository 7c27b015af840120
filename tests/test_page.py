"""The page stands alone, its figures are the metrics' and its player shows what was forecast."""

import dataclasses
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from pedpred.models.lstm.autoencoder import GridAutoencoder
from pedpred.report.gallery import draw_gallery
from pedpred.report.gather import Evaluated
from pedpred.report.page.build import Contents, render_page
from pedpred.report.page.player import ReplaySettings, replay
from pedpred.report.places import places_section
from pedpred.report.results import results_of
from pedpred.scenes import OccupancyMap, Predictions
from tests.forecasts import METHODS, PAPER
from tests.reports import MEETING, curves, metrics_of, planned, room

REPORTS = Path(__file__).resolve().parents[1] / "reports"
LATENCY = [{"pedestrians": n, "median_ms": 0.5 * n, "p99_ms": 0.7 * n} for n in (1, 20, 200)]
KEPT = ReplaySettings(("kalman_cv", "lstm"), 2.1, 2, 0.05)
SIMULATED = {"sim_test": metrics_of(MEETING), "sim_test_hall": metrics_of(MEETING)}
REAL = {"eth": metrics_of(MEETING | {"lstm": 0.65, "ca": 9.0}), "hotel": metrics_of(MEETING)}
FOLDS = [
    {"train": ["real/hotel"], "test": ["real/eth"]},
    {"train": ["real/eth"], "test": ["real/hotel"]},
]


@pytest.fixture(scope="module")
def hall():
    """Boxes and people among them, and forecasts; one method's have two modes."""
    boxes = np.kron(np.random.default_rng(5).random((40, 40)) < 0.1, np.ones((5, 5), bool))
    scene = dataclasses.replace(room(), occupancy=OccupancyMap(boxes, np.zeros(2), 0.1))
    windows = planned(scene, planted_s=0.6)
    point = windows.predictions["kalman_cv"].point
    modes = np.stack([point + np.array([0.0, 0.5]), point - np.array([0.3, 0.5])], axis=1)
    several = Predictions(point, modes, np.tile([0.7, 0.3], (len(windows), 1)), windows.dt_s)
    return scene, dataclasses.replace(windows, predictions=windows.predictions | {"kalman_cv": several})


@pytest.fixture(scope="module")
def contents(hall):
    (scene, windows), network = hall, GridAutoencoder(60, 8)
    attic, shorter = dataclasses.replace(scene, name="attic"), dataclasses.replace(KEPT, duration_s=1.2)
    simulated = results_of(SIMULATED, [{"test": ["simulated/sim_test"]}], "sim", 0.3)
    real = results_of(REAL, FOLDS, "real", 0.3)
    places = {name: [dataclasses.replace(scene, name=name)] for name in REAL}
    evaluated = [
        Evaluated("sim", "simulated", simulated, {"sim_test": [scene]}, {"hall": windows}, curves(), network),
        Evaluated("real", "real", real, places, dict.fromkeys(REAL, windows), {}, network),
    ]
    return Contents(
        evaluated=evaluated,
        galleries=[draw_gallery(own, METHODS) for own in evaluated],
        replays=[replay(scene, windows, KEPT, METHODS), replay(attic, windows, shorter, METHODS)],
        methods=METHODS,
        paper=PAPER,
        avif_speed=10,
        latency=LATENCY,
        places=places_section(evaluated, METHODS).blocks,
    )


@pytest.fixture(scope="module")
def text(contents):
    return render_page(contents)


# What stands on the page


class Elements(HTMLParser):
    """Attributes of all elements, and the text behind each that names its place in the metrics."""

    def __init__(self, text):
        super().__init__()
        self.elements, self.figures, self._place = [], [], None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        self._place = dict(attrs).get("data-metric")

    def handle_data(self, data):
        if self._place:
            self.figures.append((self._place, data.strip()))
            self._place = None


def places_of_figures(text, metrics):
    """Places of all figures, which are those of the metrics."""
    figures = Elements(text).figures
    for place, shown in figures:
        value = metrics
        for part in place.split("."):
            value = value[int(part) if isinstance(value, list) else part]
        number, scale = shown.removesuffix("%").strip(), 100 if shown.endswith("%") else 1
        digits = len(number.partition(".")[2])
        assert float(number) == pytest.approx(scale * value, abs=0.5001 * 10**-digits), place
    return {place for place, _ in figures}


def test_every_figure_of_a_page_is_in_the_metrics(text):
    metrics = {**SIMULATED, **REAL, "real": REAL, "latency": {"updates": LATENCY}}
    some = {"sim_test.lstm.ade_m", "eth.cv.fde_m", "latency.updates.1.median_ms"}
    some |= {"real.hotel.lstm.ade_m", "real.eth.cv.obstacle_share"}
    assert some <= places_of_figures(text, metrics)


def test_every_figure_of_the_report_is_in_the_metrics():
    metrics = {}
    for path in sorted((REPORTS / "metrics").glob("*.json")):
        found = json.loads(path.read_text())
        metrics |= {path.stem: found} | (found if path.stem in ("sim", "real") else {})
    page = REPORTS / "index.html"
    assert len(places_of_figures(page.read_text(), metrics)) > 100
    assert page.stat().st_size < 4e6


def test_page_is_the_same_twice_and_needs_nothing_else(contents, text):
    assert text == render_page(contents)
    asked = [own[a] for _, own in Elements(text).elements for a in ("src", "href", "srcset") if a in own]
    assert {a for a in asked if not a.startswith(("data:", "#"))} == {"eth_ucy.md", "drives.md"}, "links"
    assert not re.search(r"url\(|@import|\bfetch\(|XMLHttpRequest", text)


# In a browser


class Visit:
    """The page in a window without network; whatever goes wrong is collected."""

    def __init__(self, browser, file):
        self.context = browser.new_context(viewport={"width": 1280, "height": 900}, offline=True)
        self.page, self.problems = self.context.new_page(), []
        self.page.on("console", lambda said: self.problems.append(said.text))
        self.page.on("pageerror", lambda error: self.problems.append(str(error)))
        self.page.goto(file.as_uri())
        self.page.wait_for_selector("#player[data-time]")

    def state(self, name):
        return self.page.locator("#player").get_attribute(f"data-{name}")

    def scrub(self, time_s):
        move = "(bar, t) => { bar.value = t; bar.dispatchEvent(new Event('input')); }"
        self.page.locator(".scrub").evaluate(move, time_s)

    def decoded(self, expression):
        """What an expression about the replay that is shown gives."""
        script = """() => { const { replay } = document.getElementById("player").player;
            const rows = replay.rows.track.map((_, row) => row); return EXPRESSION; }"""
        return self.page.evaluate(script.replace("EXPRESSION", expression))


@pytest.fixture
def visit(browser, text, tmp_path):
    (tmp_path / "index.html").write_text(text)
    visited = Visit(browser, tmp_path / "index.html")
    yield visited
    assert visited.problems == []
    visited.context.close()


def test_player_plays_scrubs_and_changes_scene(visit):
    visit.scrub(0.3)
    assert (visit.state("scene"), visit.state("time")) == ("hall", "0.30")
    visit.page.click(".play")
    late = "Number(document.getElementById('player').dataset.time) > 0.5"
    ended = "document.getElementById('player').dataset.playing === 'false'"  # a slow browser plays to the end
    visit.page.wait_for_function(f"{late} && ({ended} || (document.querySelector('.play').click(), true))")
    stopped = visit.state("time")
    visit.page.locator(".plan").focus()
    visit.page.keyboard.press("ArrowLeft")
    assert float(visit.state("time")) < float(stopped)
    visit.page.keyboard.press("Space")
    assert visit.state("playing") == "true"
    visit.page.click("text=attic")
    visit.page.wait_for_selector("#player[data-scene=attic][data-playing=false]")


def test_player_holds_forecasts_to_half_a_centimetre(visit, hall):
    _, windows = hall
    order = np.lexsort((windows.time_s, windows.track_id))
    assert visit.decoded("replay.rows.track") == windows.track_id[order].tolist()
    paths = {"truth": windows.truth} | {name: own.point for name, own in windows.predictions.items()}
    for name, path in paths.items():
        points = np.array(visit.decoded(f"rows.map((row) => replay.path('{name}', row))"))
        np.testing.assert_allclose(points[:, 0], windows.position[order], atol=0.00051)
        np.testing.assert_allclose(points[:, 1:], path[order], atol=0.00501)
    found = visit.decoded("rows.map((row) => replay.modesOf('kalman_cv', row).map((mode) => mode.points))")
    modes = windows.predictions["kalman_cv"].path[order]
    np.testing.assert_allclose(np.array(found)[:, :, 1:], modes, atol=0.0251)


def test_click_picks_the_person_there_with_its_errors(visit, hall):
    _, windows = hall
    row = int(np.flatnonzero((windows.track_id == 3) & np.isclose(windows.time_s, 0.9))[0])
    box = visit.page.locator(".plan").bounding_box()
    scale = min(box["width"], box["height"]) / 20  # of a hall of 20 m x 20 m
    x, y = scale * windows.position[row]
    visit.scrub(0.9)
    visit.page.locator(".plan").focus()
    visit.page.keyboard.press("Escape")
    assert visit.state("picked") == ""
    at = {"x": box["width"] / 2 - 10 * scale + x, "y": box["height"] / 2 + 10 * scale - y}
    visit.page.click(".plan", position=at)
    assert visit.state("picked") == "3"
    errors = dict(re.findall(r"(Kalman CV|LSTM)\t([\d.]+)", visit.page.inner_text(".errors")))
    for label, method in (("Kalman CV", "kalman_cv"), ("LSTM", "lstm")):
        assert float(errors[label]) == pytest.approx(windows.ade_m(method)[row], abs=0.011)
