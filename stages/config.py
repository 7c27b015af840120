"""config: params.yaml is what conf/ composes to, and all of it is understood and within its ranges.

Parts that many stages read are written as files, see `pedpred.config.SHARED`.
"""

from __future__ import annotations

import argparse
import functools
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from omegaconf import DictConfig, OmegaConf

from pedpred import config
from pedpred.baselines.registry import baseline
from pedpred.config import SETS, config_errors, configured, one_of, part, plain, read_params, row
from pedpred.datasets.crops import CropSplit
from pedpred.datasets.rows import EMBEDDED
from pedpred.driving.trials import NO_WORLD
from pedpred.driving.worlds import KINDS
from pedpred.errors import ConfigError
from pedpred.evaluation import MetricSettings, Resampling
from pedpred.features.perception import Following, parse_tracker
from pedpred.files import write_text
from pedpred.forecasting import MethodRow
from pedpred.models import ARCHITECTURES
from pedpred.models.features import FEATURES
from pedpred.models.registry import parse_settings
from pedpred.report.literature import read_published
from pedpred.report.methods import Methods
from pedpred.scenes import VARIANTS
from pedpred.sequences import SequenceSets
from pedpred.settings import check_names, load, load_each, load_together
from pedpred.simulation.clutter import ClutterSettings
from pedpred.simulation.layouts import layout_from
from pedpred.simulation.sensor import SensorSettings
from pedpred.simulation.settings import SetUse, SimulationSettings, social_force_settings
from pedpred.situations import RowSettings, SimulatedSet, ViewingSettings
from pedpred.sources import SETTINGS, SOURCES
from pedpred.sources.eth_ucy import EthUcySettings
from pedpred.training import AutoencoderSettings
from pedpred.training.distributed import DeviceSettings, ThreadSettings
from stages import eth_ucy
from stages.code import write_code
from stages.drive import trials_of
from stages.eth_ucy import MODELS, PHASES, ComparisonSettings, comparison_of
from stages.export import GROUPS as EXPORTING
from stages.fetch import mirrors_of
from stages.folds import SENSED, trained_sets
from stages.perception import features_of, kalman_of, protocol_of
from stages.report import read_page, read_paper
from stages.row_types import (
    ExportRow,
    FoldRow,
    OnlineRows,
    PlaceRow,
    RecordingRows,
    Reference,
)
from stages.simulate import LAYOUTS, read_layouts
from stages.train import NONE, networks_of, phase_of, training_of
from stages.validate_simulation import flow_of
from stages.worlds import worlds_of

WITHOUT_VELOCITIES = ("eth_ucy", "ewap", "jupedsim")
"""Those of `SOURCES` whose recordings are positions alone."""
WHERE = {field.name for field in fields(DeviceSettings)}
"""Keys of `training` that are no phases."""
STUDIES = {"sim": False, "transfer": False, "real": True}
"""Groups of conf/folds, and whether their folds are trained."""
METHODS = ("baselines", "networks")
"""Groups of conf/methods."""
STAMP = "data/config.checked"
"""What rows have as their input that need no scenes."""
Params = Mapping[str, Any]
"""A whole configuration."""
Check = Callable[[Params], object]
"""Makes the settings of a part."""


def _each(group: str, check: Callable[[Mapping[str, Any], str], object]) -> Check:
    """Check every row of a group."""

    def check_rows(cfg: Params) -> None:
        for name in part(cfg, group):
            with configured(f"{group}.{name}"):
                check(cfg, name)

    return check_rows


def _whole(group: str, *kinds: type) -> Check:
    """Check a part that holds the fields of some dataclasses."""

    def check_fields(cfg: Params) -> None:
        with configured(group):
            load_together(kinds, part(cfg, group))

    return check_fields


def _names(key: str, names: Iterable[str], known: Iterable[str]) -> None:
    """Check that names exist."""
    for name in names:
        one_of(key, name, dict.fromkeys(known))


def _use(cfg: Params, key: str, use: SetUse) -> None:
    """Check that a row of simulations or places refers to rows and variants that exist."""
    for name, group in {"tracker": "trackers", "sensor": "sensors", "social_force": "social_forces"}.items():
        one_of(f"{key}.{name}", getattr(use, name), cfg[group])
    _names(f"{key}.variants", use.variants, VARIANTS)


def _simulation(cfg: Params, name: str) -> None:
    simulation = part(cfg, "simulations", name)
    _names(f"simulations.{name}.drawn", SimulationSettings.parse(simulation).drawn, layout_names())
    _use(cfg, f"simulations.{name}", load_together([SimulationSettings, SetUse], simulation)[1])


def _place(cfg: Params, name: str) -> None:
    place, use = load_together([PlaceRow, SetUse], part(cfg, "places", name))
    one_of(f"places.{name}.source", place.source, SOURCES)
    if place.source in SETTINGS:
        load(SETTINGS[place.source], place.settings, "settings")
    _use(cfg, f"places.{name}", use)
    if place.source in WITHOUT_VELOCITIES and row(cfg, "trackers", use.tracker).get("kind") == "truth":
        rule = "true states need velocities, which these recordings do not have; choose a Kalman filter"
        raise ConfigError(f"places.{name}.tracker", use.tracker, rule)


def _fold(cfg: Params, study: str) -> None:
    one_of("folds", study, dict.fromkeys(STUDIES))
    tested = [f"{kind}/{name}" for kind, rows in SETS.items() for name in part(cfg, rows)]
    by_others: dict[str, str] = {}
    for name, fold in load_each(FoldRow, folds := part(cfg, "folds", study)).items():
        key = f"folds.{study}.{name}"
        _names(f"{key}.test", fold.test, tested)
        trains = trained_sets(vars(fold), part(cfg, "places"))
        _names(f"{key}.train", trains, [*tested, SENSED])
        if ("train" in folds[name]) != STUDIES[study]:
            rule = "a fold of this study needs it" if STUDIES[study] else f"folds of {study} are not trained"
            raise ConfigError(f"{key}.train", folds[name].get("train"), rule)
        if both := sorted(set(trains) & set(fold.test)):
            raise ConfigError(f"{key}.train", both, "the same fold tests it")
        for at in fold.test:
            if at in by_others:
                raise ConfigError(f"{key}.test", at, f"fold {by_others[at]} tests it too; name it once")
            by_others[at] = name


def _methods(cfg: Params) -> None:
    _names("methods", part(cfg, "methods"), METHODS)
    for group in part(cfg, "methods"):
        for key, method in load_each(MethodRow, part(cfg, "methods", group), f"methods.{group}").items():
            with configured(f"methods.{group}"):
                if group != "baselines":
                    with configured(f"methods.{group}.{key}.settings"):
                        network = parse_settings(method.settings)
                    _inputs(cfg, key, network.channels_read)
                else:
                    baseline(key, method.settings)
    keys = _keys(cfg)
    if twice := sorted({key for key in keys if keys.count(key) > 1}):
        raise ConfigError("methods", twice, "a name must be that of one row")


def _inputs(cfg: Params, key: str, read: Iterable[str]) -> None:
    """Check that training rows hold what a network reads."""
    architecture = cfg["methods"]["networks"][key]["settings"]["architecture"]
    features = features_of(cfg, ARCHITECTURES[architecture].features)
    columns = {name: np.zeros((0, *column.shape)) for name, column in features.columns().items()}
    held = {*features.channels({"state": np.zeros((0, 2)), **columns}), EMBEDDED}
    if missing := sorted(set(read) - held):
        rule = f"it reads {', '.join(missing)}, but its training rows hold {', '.join(sorted(held))}"
        raise ConfigError(f"methods.networks.{key}.settings.architecture", architecture, rule)


def _trainings(cfg: Params) -> None:
    """Check that trainings fit together: each starts from what another one of its architecture writes."""
    rows = {name: training_of(cfg, name) for name in part(cfg, "trainings")}
    written = {f"models/{name}": it.architecture for name, it in rows.items()}
    for name, it in rows.items():
        key = f"trainings.{name}"
        _names(f"{key}.architecture", [it.architecture], ARCHITECTURES)
        _names(f"{key}.phase", [it.phase], [phase for phase in cfg["training"] if phase not in WHERE])
        if it.previous not in (NONE, it.encoder) and written.get(it.previous) != it.architecture:
            rule = f"no row of trainings writes networks of architecture {it.architecture} there"
            raise ConfigError(f"{key}.previous", it.previous, rule)
        if it.folds:
            _names(f"{key}.folds", [it.folds], cfg["folds"])


def _keys(cfg: Params) -> list[str]:
    """Names of all methods."""
    return [key for rows in cfg["methods"].values() for key in rows]


def weights_of(cfg: Params, network: str) -> list[str]:
    """Checkpoints of a network that trainings write."""
    weights = [f"{MODELS}/worlds/{name}" for name in cfg["literature"]["networks"] if name == network]
    for name, it in ((name, training_of(cfg, name)) for name in cfg["trainings"]):
        if network in networks_of(cfg, it.architecture):
            folds = cfg["folds"][it.folds] if it.folds else [""]
            weights += [f"models/{name}/{network}/{fold}".rstrip("/") for fold in folds]
    return weights


def _online(cfg: Params) -> None:
    with configured("online"):
        _, rows = load_together([Following, OnlineRows], part(cfg, "online"))
    for name, promise in rows.promises.items():
        _names(f"online.promises.{name}.method", [promise.method], _keys(cfg))


def _exports(cfg: Params) -> dict[str, ExportRow]:
    """Check the rows `exports` of all parts; all of them, by name."""
    exports: dict[str, ExportRow] = {}
    for group in EXPORTING:
        key = f"{group}.exports"
        with configured(key):
            rows = load_each(ExportRow, part(cfg, group).get("exports", {}))
        for name, export in rows.items():
            kalman_of(cfg, export.tracker)
            _names(f"{key}.{name}.network", [export.network], cfg["methods"]["networks"])
            _names(f"{key}.{name}.weights", [export.weights], weights_of(cfg, export.network))
        exports |= rows
    return exports


def layout_names() -> list[str]:
    """Names of the drawn rooms."""
    return sorted(file.stem for file in LAYOUTS.glob("*.yaml"))


def check_layouts(layouts: Params) -> None:
    """Make drawn rooms of what is written of them.

    Raises:
        ConfigError: a name is unknown, or a value breaks its rule; it names the key.
    """
    with configured("layouts"):
        for name, layout in layouts.items():
            layout_from(layout, name)


def _situations(cfg: Params) -> None:
    kinds = {"rows": RowSettings, "real": ViewingSettings}
    for name in part(cfg, "situations"):
        if name == "simulated":
            with configured("situations.simulated"):
                sets = load_each(SimulatedSet, part(cfg, "situations", name))
            for key, chosen in sets.items():
                if chosen.kind == "arrangement":
                    _scenes(f"situations.simulated.{key}.input", chosen.input)
        else:
            with configured(f"situations.{name}"):
                load(one_of("situations", name, kinds), part(cfg, "situations", name))


def _sequences(cfg: Params) -> None:
    with configured("sequences"):
        sets = load(SequenceSets, part(cfg, "sequences"))
    _names("sequences.scenes", sets.scenes, cfg["simulations"])


def _training(cfg: Params) -> None:
    training = part(cfg, "training")
    with configured("training"):
        load(DeviceSettings, {name: value for name, value in training.items() if name in WHERE})
    for phase in training.keys() - WHERE:
        settings, data = phase_of(cfg, phase)
        shares = getattr(settings, "shares", ())
        _names(f"training.{phase}.shares", shares, cfg["situations"]["simulated"])
        simulated = [f"simulated/{name}" for name in cfg["simulations"]]
        _names(f"training.{phase}.sets", getattr(data, "sets", ()), [*simulated, SENSED])


def _features(cfg: Params) -> None:
    for model in part(cfg, "features"):
        one_of("features", model, FEATURES)
        features_of(cfg, model)


def _recording(cfg: Params) -> None:
    with configured("recording"):
        rows = load(RecordingRows, part(cfg, "recording"))
    _names("recording.methods", [*rows.methods, rows.animation.method], _keys(cfg))
    for name, scene in rows.scenes.items():
        if scene.scene.rpartition("/")[2] != name:
            rule = "the row must have the name of the scene, as its files have"
            raise ConfigError(f"recording.scenes.{name}.scene", scene.scene, rule)
        networks = ["main", *cfg["folds"]["real"]]
        _names(f"recording.scenes.{name}.networks", [scene.networks], networks)


def _scenes(key: str, folder: str) -> None:
    """Check that an input can be a folder of scenes."""
    if folder == STAMP:
        raise ConfigError(key, folder, "it must be a folder of scenes, such as data/scenes/simulated/main")


def _driving(cfg: Params) -> None:
    rows = part(cfg, "driving").get("places")
    for name, place in rows.items() if isinstance(rows, Mapping) else ():
        if isinstance(place, Mapping) and "world" in place:
            one_of(f"driving.places.{name}.world", place["world"], dict.fromkeys((NO_WORLD, *KINDS)))
    exports = _exports(cfg)
    for name, place in trials_of(cfg).places.items():
        models = [folder.removeprefix("models/online/") for folder in (place.model, place.lstm)]
        _names(f"driving.places.{name}", models, [*exports, "default"])
        if place.world == NO_WORLD:
            _scenes(f"driving.places.{name}.input", place.input)


def _comparison(cfg: Params) -> None:
    with configured("comparison"):
        reference, _ = load_together([Reference, Resampling], part(cfg, "comparison"))
    _names("comparison.reference", [reference.reference], cfg["methods"]["baselines"])


def _report(cfg: Params) -> None:
    Methods.read(Path(), cfg["comparison"]["reference"])
    read_published(Path())
    read_paper()
    _names("conf/report/page.yaml, replays", read_page()[0].replays, STUDIES)


def _literature(cfg: Params) -> None:
    literature = part(cfg, "literature")
    with configured("literature"):
        names = [*(setting.name for setting in fields(ComparisonSettings)), "networks", "exports"]
        check_names(names, literature, "", f"there are {', '.join(names)}")
    with configured("literature.reader"):
        load(EthUcySettings, {**part(cfg, "literature", "reader"), "recording": ""})
    for key, fold in part(cfg, "literature", "folds").items():
        for name in ("test", "train"):
            sets = fold.get(name) if isinstance(fold, Mapping) else None
            if not isinstance(sets, list):
                raise ConfigError(f"literature.folds.{key}.{name}", sets, "it must be a list of names")
    comparison_of(cfg)
    with configured("literature"):
        kalman_of(cfg, cfg["literature"]["tracker"])
    for name in part(cfg, "literature", "networks"):
        _names("literature.networks", [name], cfg["methods"]["networks"])
        key, phases = f"literature.networks.{name}", part(cfg, "literature", "networks", name)
        if set(phases) != set(PHASES):
            raise ConfigError(key, ", ".join(phases), f"it must have {' and '.join(PHASES)}, nothing else")
        for phase in phases:
            settings, _ = eth_ucy.phase_of(cfg, name, phase)
            shares = getattr(settings, "shares", ())
            _names(f"{key}.{phase}.shares", shares, cfg["situations"]["simulated"])
    _exports(cfg)


PARTS: dict[str, Check] = {
    "mirrors": lambda cfg: [mirrors_of(cfg, name) for name in part(cfg, "mirrors")],
    "trackers": _each("trackers", lambda cfg, name: parse_tracker(row(cfg, "trackers", name))),
    "sensors": _each("sensors", lambda cfg, name: load(SensorSettings, row(cfg, "sensors", name))),
    "social_forces": _each(
        "social_forces", lambda cfg, name: social_force_settings(row(cfg, "social_forces", name))
    ),
    "simulations": _each("simulations", _simulation),
    "places": _each("places", _place),
    "folds": _each("folds", _fold),
    "methods": _methods,
    "online": _online,
    "clutter": _whole("clutter", ClutterSettings),
    "worlds": worlds_of,
    "situations": _situations,
    "sequences": _sequences,
    "protocol": protocol_of,
    "features": _features,
    "autoencoder": _whole("autoencoder", ThreadSettings, CropSplit, AutoencoderSettings),
    "training": _training,
    "trainings": _trainings,
    "validation": flow_of,
    "evaluation": _whole("evaluation", MetricSettings),
    "comparison": _comparison,
    "recording": _recording,
    "driving": _driving,
    "literature": _literature,
}
"""Key of params.yaml -> what makes its settings, as stages do."""

TABLES: tuple[Check, ...] = (
    lambda cfg: check_layouts(read_layouts(layout_names())),
    _report,
)
"""Checks of files of conf/ that are no part of params.yaml."""


def check_parts(cfg: Params) -> None:
    """Make all settings of a configuration.

    Raises:
        PedpredError: a key is missing or unknown, or a value breaks its rule; it names the key.
    """
    for name in cfg:
        one_of("params", str(name), PARTS)
    for check in PARTS.values():
        check(cfg)
    for key in NAMED:
        for name in functools.reduce(lambda rows, name: rows.get(name) or {}, key.split("."), cfg):
            if not re.fullmatch(r"[\w-]+", str(name)):
                raise ConfigError(key, name, "names of rows may have letters, digits, _ and - only")


NAMED = (
    *(
        "mirrors",
        "simulations",
        "places",
        "trainings",
        "situations.simulated",
        "online.exports",
        "recording.scenes",
    ),
    *("driving.places", "literature.folds"),
    *(f"methods.{group}" for group in METHODS),
    *(f"folds.{study}" for study in STUDIES),
)
"""Rows whose names are part of stages, commands and folders."""

SHARED_PARTS = ("places", "sensors", "trackers")
"""Keys of params.yaml whose values other stages read from files."""


def write_shared(params: DictConfig, root: Path) -> None:
    """Write the parts of a project that other stages read from files."""
    for name in SHARED_PARTS:
        write_text(root / config.SHARED / f"{name}.yaml", OmegaConf.to_yaml(params[name], resolve=True))


def main(arguments: Sequence[str] | None = None) -> None:
    """Check params.yaml and the drawn rooms, and write data/config.checked, data/config and data/code."""
    usage = "python -m stages.config\nChange values in conf/, or for one run: dvc exp run -S KEY=VALUE"
    argparse.ArgumentParser(usage=usage, description=main.__doc__).parse_args(arguments)
    with config_errors():
        params = read_params(Path())
        check_parts(plain(params))
        for check in TABLES:
            check(plain(params))
        config.main(["--check", "--stamp", STAMP])
        write_shared(params, Path())
        write_code()


if __name__ == "__main__":
    main()
