"""The page stands alone, its figures are the metrics' and its player shows what was forecast."""

import dataclasses
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from pedpred.errors import ValueRuleError
from pedpred.models.lstm.autoencoder import GridAutoencoder
from pedpred.models.lstm.features.grids import occupancy_crops
from pedpred.report.charts import box_plot, whiskers
from pedpred.report.gallery import Evaluated, draw_gallery
from pedpred.report.literature import SCENES
from pedpred.report.measures import results_of
from pedpred.report.page.build import Contents, render_page
from pedpred.report.page.player import LEVELS, ReplaySettings, replay
from pedpred.report.places import places_section
from pedpred.report.snapshots import grid_image
from pedpred.scenes import OccupancyMap, Predictions
from tests.forecasts import METHODS, PAPER
from tests.simulated import read
from tests.test_report import MEETING, curve_tables, metrics_of, planned, wall_scene

REPORTS = Path(__file__).resolve().parents[1] / "reports"
LATENCY = [{"pedestrians": n, "median_ms": 0.5 * n, "p99_ms": 0.7 * n} for n in (1, 20, 200)]


@pytest.fixture(scope="module")
def hall():
    """Boxes, people among them, forecasts (one method's have two modes), and angular grids at random."""
    rng = np.random.default_rng(5)
    boxes = np.kron(rng.random((40, 40)) < 0.1, np.ones((5, 5), bool))
    scene = dataclasses.replace(wall_scene(), occupancy=OccupancyMap(boxes, np.zeros(2), 0.1))
    windows = planned(scene, planted_s=0.6)
    position = windows.position + rng.normal(0, 0.03, windows.position.shape)
    heading_rad, rows = rng.uniform(-np.pi, np.pi, len(windows)), len(windows)
    near = np.where(rng.random((rows, 72)) < 0.1, rng.uniform(0.1, 6.0, (rows, 72)), 6.0)
    point = windows.predictions["kalman_cv"].point
    modes = np.stack([point + np.array([0.0, 0.5]), point - np.array([0.3, 0.5])], axis=1)
    several = Predictions(point, modes, np.tile([0.7, 0.3], (rows, 1)), windows.dt_s)
    own = {"position": position, "heading_rad": heading_rad, "angular_grid_m": near.astype(np.float32)}
    own["packed_grid"] = occupancy_crops(scene.occupancy, position, heading_rad, 60, 0.1)
    own["predictions"] = windows.predictions | {"kalman_cv": several}
    return scene, dataclasses.replace(windows, **own)


KEPT = ReplaySettings(("kalman_cv", "lstm"), 2.1, 2, 0.05)


def stretch(duration_s, **given):
    return dataclasses.replace(KEPT, duration_s=duration_s, **given)


PUBLISHED = read("report/published")["published"]
SIMULATED = {"sim_test": metrics_of(MEETING), "sim_test_hall": metrics_of(MEETING)}
REAL = {"eth": metrics_of(MEETING | {"lstm": 0.65, "ca": 9.0}), "hotel": metrics_of(MEETING)}
FOLDS = [
    {"train": ["real/hotel"], "test": ["real/eth"]},
    {"train": ["real/eth"], "test": ["real/hotel"]},
]


def evaluated_of(scene, windows):
    network, curves = GridAutoencoder(60, 8), curve_tables()
    simulated = results_of(SIMULATED, [{"test": ["simulated/sim_test"]}], "sim", 0.3)
    real = results_of(REAL, FOLDS, "real", 0.3)
    places = {name: [dataclasses.replace(scene, name=name)] for name in REAL}
    return [
        Evaluated("sim", "simulated", simulated, {"sim_test": [scene]}, {"hall": windows}, curves, network),
        Evaluated("real", "real", real, places, dict.fromkeys(REAL, windows), {}, network),
    ]


def contents_of(scene, windows, galleries):
    evaluated = evaluated_of(scene, windows)
    few = {name: REAL["eth"][name] | {"ade_m_ci95": [0.1, 0.2]} for name in ("cv", "kalman_cv")}
    shown = [
        replay(scene, windows, KEPT, METHODS),
        replay(wall_scene("attic"), windows, stretch(1.2), METHODS),
    ]
    literature = dict.fromkeys(SCENES, few)
    side = places_section(evaluated, METHODS).blocks
    return Contents(evaluated, galleries, shown, METHODS, PAPER, 10, [], literature, PUBLISHED, LATENCY, side)


@pytest.fixture(scope="module")
def galleries(hall):
    return [draw_gallery(own, METHODS) for own in evaluated_of(*hall)]


@pytest.fixture(scope="module")
def contents(hall, galleries):
    return contents_of(*hall, galleries)


@pytest.fixture(scope="module")
def text(contents):
    return render_page(contents)


class Controls(HTMLParser):
    """Attributes of what people can move or switch, in the order of the page."""

    def __init__(self, text):
        super().__init__()
        self.found = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        if tag in ("input", "select"):
            self.found.append(dict(attrs))


def test_controls_begin_as_written_and_the_time_reaches_every_instant(text):
    """A browser that loads the page again keeps what was set, unless told not to; the player begins anew."""
    controls = Controls(text).found
    assert {one.get("type") for one in controls} == {"checkbox", "radio", "range", None}
    assert {one.get("autocomplete") for one in controls} == {"off"}
    assert [one["step"] for one in controls if one.get("type") == "range"] == ["any"]


# What the player gets


def test_the_same_replay_has_the_same_data(hall):
    assert replay(*hall, stretch(0.9), METHODS).data == replay(*hall, stretch(0.9), METHODS).data
    assert replay(*hall, stretch(60.0), METHODS).header["duration_s"] == pytest.approx(np.ptp(hall[1].time_s))


def test_what_does_not_fit_a_replay_is_refused(hall):
    scene, windows = hall
    slow = dataclasses.replace(windows, time_s=windows.time_s * 1e6)
    with pytest.raises(ValueRuleError, match=r"duration_s = 1000000000.0.*\(0, 36000\]"):
        replay(scene, slow, stretch(1e9), METHODS)


# Where the marks lie


def test_boxes_and_whiskers_lie_at_their_values():
    methods = metrics_of(MEETING | {"ca": 9.0})
    plot = box_plot(methods, "here", 0.3, METHODS)
    zero, tick = plot.y_ticks[0], plot.y_ticks[1]
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


# What stands on the page


def test_no_two_columns_of_a_table_have_one_title(text):
    for table in re.findall(r"<thead>.*?</thead>", text, re.DOTALL):
        titles = re.findall(r"<th[ >][^<]*", table)
        assert len(titles) == len(set(titles)), titles


def test_a_data_set_of_one_room_is_not_a_row_of_rooms(hall):
    scene, windows = hall
    simulated = evaluated_of(scene, windows)[0]
    still = dataclasses.replace(windows, velocity=0.0 * windows.velocity, packed_grid=0 * windows.packed_grid)
    scenes = dict(simulated.scenes) | {"corridor": [scene]}
    simulated = dataclasses.replace(simulated, scenes=scenes, windows={"hall": still}, curves={})
    captions = [p.caption for section in draw_gallery(simulated, METHODS) for p in section.pictures]
    assert "corridor; tracks of the first 30 s." in captions


def test_figures_of_box_plots_can_be_read_without_pointing_at_boxes(contents, text):
    for result in (result for own in contents.evaluated for result in own.results):
        for metrics in result.figures.values():
            quartiles = zip(*(metrics[f"per_step_q{q}_m"] for q in (25, 50, 75)), strict=True)
            for mean, ends in zip(metrics["per_step_m"], quartiles, strict=True):
                assert f">{mean:.3f} ({', '.join(f'{end:.3f}' for end in ends)})</td>" in text


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
    some = {"sim_test.lstm.ade_m", "eth.cv.fde_m", "literature.eth.cv.ade_m", "latency.updates.1.median_ms"}
    assert some | {"real.hotel.lstm.ade_m", "real.eth.cv.obstacle_share"} <= {p for p, _ in figures}


def test_every_figure_of_the_committed_page_is_in_the_committed_metrics():
    metrics = {}
    for path in sorted((REPORTS / "metrics").glob("*.json")):
        found = json.loads(path.read_text())
        metrics |= {path.stem: found} | (found if path.stem in ("sim", "real") else {})
    text = (REPORTS / "index.html").read_text()
    assert len(assert_figures_are_metrics(text, metrics)) > 100


def test_the_committed_page_is_light():
    assert (REPORTS / "index.html").stat().st_size < 4e6


def test_a_page_is_the_same_twice_and_needs_nothing_else(hall, galleries, text):
    """With the same pictures; those come out the same, too: see test_report.py."""
    assert text == render_page(contents_of(*hall, galleries))
    assert text.startswith("<!doctype html>")
    assert [a for a in Figures(text).addresses if not a.startswith(("data:", "#"))] == []
    assert not re.search(r"url\(|@import|\bfetch\(|XMLHttpRequest", text)


def test_the_page_says_what_was_missed(text):
    assert "<strong>4 of 12 expectations are missed</strong>" in text
    assert "could not be reproduced" in text


# In a browser


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


@pytest.fixture(scope="module")
def visit(browser, file):
    """A page that is only read."""
    visited = Visit(browser, file, 1280, "light")
    yield visited
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


def test_without_scripts_no_dead_control_is_shown(browser, file):
    context = browser.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto(file.as_uri())
    assert page.is_visible("#replay noscript p")
    assert not any(control.is_visible() for control in page.locator("input, select, button").all())
    context.close()


def test_on_a_phone_every_table_says_what_its_figures_are(visit_at):
    page = visit_at(390).page
    page.evaluate("for (const folded of document.querySelectorAll('details')) folded.open = true")
    hidden = "[...document.querySelectorAll('thead th:first-child')].filter((one) => !one.offsetHeight)"
    assert page.evaluate(f"{hidden}.map((one) => one.textContent)") == []


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_paper_is_white_and_holds_every_column(visit_at, scheme):
    page = visit_at(700, scheme).page  # px; a sheet of A4 between its margins has 718
    page.emulate_media(media="print")
    page.evaluate("for (const folded of document.querySelectorAll('details')) folded.open = true")
    cut = "[...document.querySelectorAll('.wide')].filter((one) => one.scrollWidth > one.clientWidth)"
    assert page.evaluate(f"{cut}.map((one) => one.textContent)") == []
    colours = "[getComputedStyle(document.body).backgroundColor, getComputedStyle(document.body).color]"
    paper, ink = (sum(map(int, re.findall(r"\d+", c)[:3])) for c in page.evaluate(colours))
    assert paper > 3 * 240 > 3 * 80 > ink
    assert not page.is_visible("#player")


def test_a_page_without_plots_over_the_horizon_plays(browser, text, tmp_path):
    bare = re.sub(r'<div class="bar legend".*?</div>', "", text, flags=re.DOTALL)
    assert bare != text
    (tmp_path / "index.html").write_text(bare)
    visit = Visit(browser, tmp_path / "index.html", 1280, "light")
    assert visit.problems == []
    visit.context.close()


def test_the_player_plays_scrubs_and_changes_scene(visit_at):
    visit = visit_at()
    visit.scrub(0.3)
    assert visit.state("time") == "0.30"
    visit.page.click(".play")
    late = "Number(document.getElementById('player').dataset.time) > 0.5"
    ended = "document.getElementById('player').dataset.playing === 'false'"  # a slow browser plays to the end
    visit.page.wait_for_function(f"{late} && ({ended} || (document.querySelector('.play').click(), true))")
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


def decoded(visit, found, expression):
    """What an expression about `replay` gives in the browser, for a replay or the one that is shown."""
    script = """async ([data, header]) => { const shown = document.getElementById("player").player.replay;
        const replay = data ? await shown.constructor.read({ data, header }) : shown; return EXPRESSION; }"""
    payload = [found.data, found.header] if found else [None, None]
    return visit.page.evaluate(script.replace("EXPRESSION", expression), payload)


def test_a_replay_keeps_its_stretch_and_the_seconds_that_its_forecasts_are_about(visit, hall):
    scene, windows = hall
    found = replay(scene, windows, stretch(0.9), METHODS)
    assert found.header["duration_s"] == 0.9
    assert decoded(visit, found, "replay.frames.map((frame) => frame.value)") == [0, 30, 60, 90]
    times = np.array(decoded(visit, found, "replay.seen.clock"))
    assert (times.min(), times.max()) == (0, 390)
    shown = np.array(decoded(visit, found, "replay.map")).reshape(200, 200)
    np.testing.assert_array_equal(shown, scene.occupancy.occupied.T)


def test_a_forecast_is_shown_until_the_next_one_where_they_are_rarer_than_detections(visit, hall):
    scene, windows = hall
    kept = np.isclose(windows.time_s % 0.6, 0.0) | np.isclose(windows.time_s % 0.6, 0.6)
    rare = dataclasses.replace(
        windows,
        predictions={name: p.select(np.flatnonzero(kept)) for name, p in windows.predictions.items()},
        **{
            each.name: getattr(windows, each.name)[kept]
            for each in dataclasses.fields(windows)
            if isinstance(getattr(windows, each.name), np.ndarray)
        },
    )
    begin, end = np.unique(rare.time_s)[:2]
    assert end - begin > 1.5 * scene.detection_dt_s
    shown = decoded(
        visit, replay(scene, rare, KEPT, METHODS), "[0.01, 0.3, 0.59].map((t) => replay.rowsAt(t).size)"
    )
    assert shown == [int((rare.time_s == begin).sum())] * 3


def test_the_player_holds_the_forecasts_to_half_a_centimetre(visit, hall):
    _, windows = hall
    order = np.lexsort((windows.time_s, windows.track_id))
    assert decoded(visit, None, "replay.rows.track") == windows.track_id[order].tolist()
    for name, path in {
        "truth": windows.truth,
        **{m: p.point for m, p in windows.predictions.items()},
    }.items():
        points = np.array(
            decoded(visit, None, f"replay.rows.track.map((_, row) => replay.path('{name}', row))")
        )
        np.testing.assert_allclose(points[:, 0], windows.position[order], atol=0.00051)
        np.testing.assert_allclose(points[:, 1:], path[order], atol=0.00501)


def test_the_player_draws_likely_modes_by_their_weight(visit_at, hall):
    _, windows = hall
    visit, order = visit_at(), np.lexsort((windows.time_s, windows.track_id))
    found = decoded(visit, None, "replay.rows.track.map((_, row) => replay.modesOf('kalman_cv', row))")
    points = np.array([[m["points"] for m in row] for row in found])
    modes = windows.predictions["kalman_cv"].path[order]
    np.testing.assert_allclose(points[:, :, 1:], modes, atol=0.0251)
    assert decoded(visit, None, "replay.modesOf('lstm', 0)") == []
    visit.page.check('.methods input[value="kalman_cv"]', force=True)
    drawn = """() => { const found = [], { player } = document.getElementById("player");
        const brush = CanvasRenderingContext2D.prototype, { stroke } = brush;
        brush.stroke = function () { found.push(this.lineWidth); stroke.call(this); };
        player.draw();
        brush.stroke = stroke;
        return found; }"""
    widths = np.round(visit.page.evaluate(drawn), 3).tolist()
    assert [widths.count(round(1 + 7 * weight, 3)) for weight in (0.7, 0.3)] == [5, 5]


def test_modes_that_are_left_out_take_no_space_and_are_not_drawn(visit, hall):
    scene, windows = hall
    all_modes = replay(scene, windows, KEPT, METHODS)
    path = "replay.path('lstm', 3)"
    for given in ({"modes": 1}, {"least_weight": 0.5}):
        fewer = replay(scene, windows, dataclasses.replace(KEPT, **given), METHODS)
        assert len(fewer.data) < len(all_modes.data)
        (one,) = decoded(visit, fewer, "replay.modesOf('kalman_cv', 3)")
        assert one["weight"] == pytest.approx(0.7)
        assert decoded(visit, fewer, path) == decoded(visit, None, path)


def test_of_the_others_only_methods_that_are_kept_are_offered(hall):
    header = replay(*hall, dataclasses.replace(KEPT, methods=("cv",)), METHODS).header
    assert (header["methods"], header["modes"]) == (["lstm"], [])


def test_the_player_shows_the_network_s_inputs_themselves(visit, hall):
    _, windows = hall
    order = np.lexsort((windows.time_s, windows.track_id))
    grids = np.array(decoded(visit, None, "replay.rows.track.map((_, row) => replay.grid(row))"))
    assert windows.packed_grid.any(axis=1).all()
    np.testing.assert_array_equal(grids, [windows.grid(row).ravel() for row in order])
    cones = np.array(decoded(visit, None, "replay.rows.track.map((_, row) => replay.cones(row))"))
    np.testing.assert_allclose(cones, windows.angular_grid_m[order], atol=1.001 * 6.0 / LEVELS / 2)
    cells = """replay.gridPicture(2, "#000").getContext("2d").getImageData(0, 0, 60, 60).data"""
    alpha = np.array(list(decoded(visit, None, f"Array.from({cells})")))[3::4].reshape(60, 60)
    np.testing.assert_array_equal(alpha > 0, grid_image(windows.grid(order[2])))


def test_the_pose_that_is_kept_gives_nearly_all_of_the_grid(visit, hall):
    changed = np.array(decoded(visit, None, "[...replay.missed.keys()]"))
    assert (changed % (3600 + 72) < 3600).sum() < 1e-3 * 3600 * len(hall[1])


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
    visit.page.locator('[data-metric="real.eth.kalman_cv.ade_m"]:visible').first.click()
    assert "0.580 to 0.630 m" in visit.page.inner_text("#tip")
    shown = visit.page.locator('.boxes [data-method="ca"]').first
    assert shown.is_visible()
    visit.page.locator('.legend input[value="ca"]').evaluate("box => box.click()")
    assert not shown.is_visible()
