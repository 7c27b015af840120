"""Every value of the configuration has a type and a range, and every mapping its names."""

import copy
import math
import shutil
from pathlib import Path

import pytest
from omegaconf import OmegaConf

from pedpred.config import part
from pedpred.errors import ConfigError, PedpredError
from pedpred.report.findings import Paper
from pedpred.report.literature import PublishedRows
from pedpred.report.methods import Methods
from pedpred.report.page.player import ReplaySettings
from pedpred.settings import load, load_together
from pedpred.simulation.worlds import SensingSettings, WorldSettings
from pedpred.sources.mirrors import Mirrors
from stages import evaluate, pretrain_autoencoder, train
from stages.config import PARTS, check_layouts, check_parts, main
from stages.references import layout_names
from stages.row_types import PageRows
from stages.simulate import read_layouts
from tests.configuration import read
from tests.conftest import ROOT
from tests.refused import refused as refused_by

LAYOUTS = read_layouts(layout_names())
FILES = {
    "layouts": LAYOUTS,
    "ranges": read("conf/worlds/varied.yaml"),
    "sensing": read("conf/sensing/varied.yaml"),
    "mirror": read("conf/mirrors/juelich.yaml"),
    **{
        f"shown_{name}": read(f"conf/report/{name}.yaml")
        for name in ("methods", "paper", "page", "published")
    },
}
PARAMS = read("params.yaml") | FILES
CHECKS = PARTS | {
    "layouts": lambda cfg: check_layouts(part(cfg, "layouts")),
    "ranges": lambda cfg: load(WorldSettings, cfg["ranges"], "ranges"),
    "sensing": lambda cfg: load(SensingSettings, cfg["sensing"], "sensing"),
    "mirror": lambda cfg: Mirrors.parse("mirror", cfg["mirror"]),
    "shown_methods": lambda cfg: Methods.parse(cfg["shown_methods"], "cv"),
    "shown_paper": lambda cfg: load(Paper, cfg["shown_paper"], "shown_paper"),
    "shown_page": lambda cfg: load_together([PageRows, ReplaySettings], cfg["shown_page"]),
    "shown_published": lambda cfg: load(PublishedRows, cfg["shown_published"], "shown_published"),
}
ROWS = ("trackers", "sensors", "social_forces", "simulations", "places", "folds", "layouts")
BASES = {base for name in ROWS for row in PARAMS[name].values() if (base := row.get("base"))}
FREE = (
    *(name for name in ROWS if name != "folds"),
    *(f"folds.{study}" for study in PARAMS["folds"]),
    *(f"methods.{group}" for group in PARAMS["methods"]),
    *(f"training.{phase}.shares" for phase in ("situations", "adaptation")),
    *(f"literature.{name}" for name in ("scenes", "places", "folds.eth_ucy", "trainings", "exports")),
    *("mirrors", "online.exports", "online.promises", "situations.simulated", "recording.scenes"),
    *("driving.places", "driving.exports", "mirror.inside", "shown_methods", "shown_page.replays"),
    *(
        f"shown_paper.{name}"
        for name in ("ade_m", "ade_m.sim", "ade_m.real", "remarks", "at", "expectations")
    ),
    "shown_published.published.*.errors_m",
)
"""Mappings whose names are chosen freely, or by other parts of the configuration."""
NO_NUMBERS = ("x", True, None, [], [1.0, 2.0, 3.0], {}, math.nan, math.inf, -math.inf)
BEYOND = (-1e30, 1e30, 10**40, -1, 0)
UNBOUNDED = ("open_ends", "center", "corners", "start", "end", "angle_deg", "cut_x_m", "cut_y_m")  # places
FRACTIONS = ("duration_s", "timeout_s", *UNBOUNDED)  # written as whole numbers, but need not be


def nodes(value, path=()):
    """All values of a nested configuration with their paths."""
    yield path, value
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, own in inside:
        yield from nodes(own, (*path, key))


def unlike(name):
    """All values of a part with their paths; of shapes with the same fields in a drawn room, one's."""
    seen = set()
    for path, value in nodes(PARAMS[name]):
        holders, at = [*path[:1]], PARAMS[name]
        for key in path[:-1]:
            at = at[key]
            holders.append(key if name != "layouts" else tuple(at) if isinstance(at, dict) else "list")
        if (like := (*holders, *path[-1:], type(value))) not in seen:
            seen.add(like)
            yield path, value


def replaced(value, path, new):
    """A copy with another value at a path."""
    if not path:
        return new
    part = copy.copy(value)
    part[path[0]] = replaced(value[path[0]], path[1:], new) if path[1:] else new
    return part


def refused(name, path, new):
    """The error that a value at a path of a part meets; None if it is accepted."""
    own = replaced(PARAMS[name], path, new)
    if name in ROWS and path and isinstance(own, dict):
        own = {key: row for key, row in own.items() if key == path[0] or key in BASES}
    try:
        CHECKS[name](PARAMS | {name: own})
    except PedpredError as error:
        return str(error)
    return None


def worded(path):
    """Names in a path."""
    return [key for key in path if isinstance(key, str)]


def wrong_values(value):
    """Values that cannot stand for another one."""
    if value == "auto":
        return (1, "x", None, [], {})  # or true or false
    if isinstance(value, bool):
        return (1, 0, "x", None, [], {})
    if isinstance(value, (int, float)):
        return NO_NUMBERS
    if isinstance(value, str):
        return (1, True, None, ["x"], {})
    if isinstance(value, list):
        return (1, "x", True, None, {"x": 1}, [None], [{}], [math.nan])
    return (1, "x", True, None, [1])


@pytest.mark.parametrize("name", CHECKS)
def test_value_of_another_kind_is_refused_by_its_key(name):
    missed = []
    for path, value in unlike(name):
        for wrong in wrong_values(value):
            said = refused(name, path, wrong)
            if said is None or (worded((name, *path))[-1] not in said and str(wrong) not in said):
                missed.append((path, wrong, said))
    assert missed == []


@pytest.mark.parametrize("name", CHECKS)
def test_a_number_is_in_its_range_or_refused_by_its_key(name):
    missed = []
    for path, value in unlike(name):
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            continue
        keys = worded((name, *path))[-2:]  # a rule about several fields names what holds them
        for wrong in BEYOND:
            said = refused(name, path, wrong)
            huge = abs(wrong) > 1 and not set(UNBOUNDED) & set(path)
            if (said is None and huge) or (said and not any(key in said for key in keys)):
                missed.append((path, wrong, said))
        if isinstance(value, int) and not set(FRACTIONS) & set(path) and not refused(name, path, value + 0.5):
            missed.append((path, value + 0.5, None))
    assert missed == []


@pytest.mark.parametrize("name", ["ranges", "sensing", "situations", "clutter", "training"])
def test_range_that_falls_or_is_empty_is_refused(name):
    for path, value in nodes(PARAMS[name]):
        pair = value if isinstance(value, list) and len(value) == 2 else [0, 0]
        if isinstance(pair[0], float) and pair[0] < pair[1]:
            for wrong in (value[::-1], value[:1]):
                assert worded((name, *path))[-1] in (refused(name, path, wrong) or ""), (path, wrong)


@pytest.mark.parametrize("name", CHECKS)
def test_an_unknown_name_is_refused(name):
    missed = []
    for path, value in nodes(PARAMS[name]):
        place = ".".join("*" if isinstance(key, int) else key for key in (name, *path))
        if isinstance(value, dict) and place not in FREE:
            said = refused(name, path, value | {"magic": 1})
            if said is None or "magic" not in said:
                missed.append((path, said))
    assert missed == []


WRONG_ROWS = [  # path, value, key of the error
    ("folds.real.without_eth.train", ["real/eth"], "folds.real.without_eth.train"),
    ("folds.real.a", {"test": ["real/eth"], "train": []}, "folds.real.a.test"),
    ("methods.networks.cv", PARAMS["methods"]["networks"]["mixture"], "methods"),
    ("recording.scenes.a", {"scene": "real/eth", "networks": "main"}, "recording.scenes.a.scene"),
    ("online.exports.small.weights", "models/mixture_main/none", "online.exports.small.weights"),
    ("trainings.lstm_main.previous", "models/mixture_main", "trainings.lstm_main.previous"),
    ("places.eth.tracker", "truth", "places.eth.tracker"),
    ("situations.simulated.corridor.kind", "arrangement", "situations.simulated.corridor.input"),
    ("driving.places.room.world", "none", "driving.places.room.input"),
]


def test_contradicting_rows_are_refused():
    for path, value, key in WRONG_ROWS:
        params = replaced({name: PARAMS[name] for name in PARTS}, path.split("."), value)
        with refused_by(key):
            check_parts(params)


def test_name_that_no_stage_can_have_is_refused():
    params = {part: PARAMS[part] for part in PARTS}
    check_parts(params)
    with refused_by("places"):
        check_parts(params | {"places": params["places"] | {"my@place": params["places"]["eth"]}})


def test_wrong_value_of_an_experiment_does_not_stay(tmp_path, monkeypatch):
    shutil.copytree(ROOT / "conf", tmp_path / "conf")
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "params.yaml").read_text()
    Path("params.yaml").write_text(wrong := text.replace("lr: 0.003", "lr: -1.0"))
    monkeypatch.setenv("DVC_EXP_NAME", "wrong")
    with pytest.raises(SystemExit, match=r"training\.\w+\.lr"):
        main([])
    assert Path("params.yaml").read_text() == text != wrong


@pytest.mark.parametrize(
    ("stage", "arguments", "wrong"),
    [
        (evaluate, {"name": "lstn", "weights": "main"}, "lstn"),
        (train, {"name": "lstm_main", "network": "mixture"}, "mixture"),
    ],
)
def test_stage_refuses_rows_it_does_not_know(stage, arguments, wrong, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError) as error:
        stage.main.__wrapped__(OmegaConf.create(PARAMS | arguments))
    assert error.value.value == wrong


def test_stage_refuses_a_value_by_its_key_before_it_works(tmp_path):
    cfg = OmegaConf.create(PARAMS | {"out": f"{tmp_path}/out", "curve": f"{tmp_path}/curve.tsv"})
    cfg.autoencoder.clip_norm = 0
    with refused_by("autoencoder.clip_norm"):
        pretrain_autoencoder.main.__wrapped__(cfg)
    assert list(tmp_path.iterdir()) == []
