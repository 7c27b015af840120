"""config: params.yaml is what conf/ composes to, and all of it is understood and within its ranges.

Parts that many stages read are written as files, see `pedpred.config.SHARED`.
"""

from __future__ import annotations

import argparse
import functools
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from omegaconf import DictConfig, OmegaConf

from pedpred import config
from pedpred.baselines.registry import baseline
from pedpred.config import config_errors, configured, one_of, part, plain, read_params, row
from pedpred.datasets.crops import CropSplit
from pedpred.driving.study import NO_WORLD
from pedpred.errors import ConfigError, PedpredError
from pedpred.evaluation import MetricSettings, Resampling
from pedpred.features.perception import Following, parse_tracker
from pedpred.files import write_text
from pedpred.forecasting import MethodRow
from pedpred.models import ARCHITECTURES
from pedpred.models.features import FEATURES
from pedpred.models.forecaster import ForecasterChoices
from pedpred.models.lstm.encoding import EMBEDDED
from pedpred.models.registry import parse_settings
from pedpred.report.literature import read_published
from pedpred.report.methods import Methods
from pedpred.rows.recorded import ViewingSettings
from pedpred.rows.sampling import RowSettings
from pedpred.rows.simulated import SequenceSets, SimulatedSet
from pedpred.settings import load, load_each, load_together
from pedpred.simulation.clutter import ClutterSettings
from pedpred.simulation.layouts import layout_from
from pedpred.simulation.sensor import SensorSettings
from pedpred.simulation.settings import SimulationSettings, social_force_settings
from pedpred.sources import SETTINGS
from pedpred.training import AutoencoderSettings
from pedpred.training.distributed import DeviceSettings, ThreadSettings
from stages.code import write_code
from stages.drive import study_of
from stages.fetch import mirrors_of
from stages.folds import trained_sets
from stages.perception import features_of, kalman_of, windows_of
from stages.references import WHERE, Params, check_references, layout_names, method_names
from stages.report import read_page, read_paper
from stages.row_types import (
    ComparisonRows,
    ExportRow,
    FoldRow,
    OnlineRows,
    PlaceRow,
    RecordingRows,
    Reference,
)
from stages.sets import SetTracking
from stages.simulate import read_layouts
from stages.train import NONE, networks_of, phase_of, seeds_of, training_of
from stages.validate_simulation import flow_of
from stages.worlds import worlds_of

WITHOUT_VELOCITIES = ("eth_ucy", "ewap", "jupedsim")
"""Those of `SOURCES` whose recordings are positions alone."""
STUDIES = {"sim": False, "transfer": False, "real": True}
"""Groups of conf/folds, and whether their folds are trained."""
FOLDS = STUDIES | {"eth_ucy": True}
"""Those of studies beside the main pipeline, too, which may test a set several times."""
METHODS = ("baselines", "networks")
"""Groups of conf/methods."""
STAMP = "data/config.checked"
"""What rows have as their input that need no scenes."""
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


def _simulation(cfg: Params, name: str) -> None:
    load_together([SimulationSettings, SetTracking], part(cfg, "simulations", name))


def _place(cfg: Params, name: str) -> None:
    place, use = load_together([PlaceRow, SetTracking], part(cfg, "places", name))
    if place.source in SETTINGS:
        load(SETTINGS[place.source], place.settings, "settings")
    if place.source in WITHOUT_VELOCITIES and row(cfg, "trackers", use.tracker).get("kind") == "truth":
        rule = "true states need velocities, which these recordings do not have; choose a Kalman filter"
        raise ConfigError(f"places.{name}.tracker", use.tracker, rule)


def _fold(cfg: Params, study: str) -> None:
    trained = one_of("folds", study, FOLDS)
    by_others: dict[str, str] = {}
    for name, fold in load_each(FoldRow, folds := part(cfg, "folds", study)).items():
        key, trains = f"folds.{study}.{name}", trained_sets(vars(fold), part(cfg, "places"))
        if ("train" in folds[name]) != trained:
            rule = "a fold of this study needs it" if trained else f"folds of {study} are not trained"
            raise ConfigError(f"{key}.train", folds[name].get("train"), rule)
        if both := sorted(set(trains) & set(fold.test)):
            raise ConfigError(f"{key}.train", both, "the same fold tests it")
        for at in fold.test if study in STUDIES else ():
            if at in by_others:
                raise ConfigError(f"{key}.test", at, f"fold {by_others[at]} tests it too; name it once")
            by_others[at] = name


def _methods(cfg: Params) -> None:
    for group in part(cfg, "methods"):
        one_of("methods", group, dict.fromkeys(METHODS))
        for key, method in load_each(MethodRow, part(cfg, "methods", group), f"methods.{group}").items():
            with configured(f"methods.{group}"):
                if group == "baselines":
                    baseline(key, method.settings)
                    continue
                with configured(f"methods.{group}.{key}.settings"):
                    network = parse_settings(method.settings)
                _inputs(cfg, key, network.channels_read)
    keys = method_names(cfg)
    if twice := sorted({key for key in keys if keys.count(key) > 1}):
        raise ConfigError("methods", twice, "a name must be that of one row")


def _inputs(cfg: Params, key: str, read: Iterable[str]) -> None:
    """Check that training rows hold what a network reads."""
    architecture = cfg["methods"]["networks"][key]["settings"]["architecture"]
    features = features_of(cfg, ARCHITECTURES[architecture].features)
    columns = {name: np.zeros((0, *column.shape)) for name, column in features.columns().items()}
    held = {*features.channels(columns), EMBEDDED}
    if missing := sorted(set(read) - held):
        rule = f"it reads {', '.join(missing)}, but its training rows hold {', '.join(sorted(held))}"
        raise ConfigError(f"methods.networks.{key}.settings.architecture", architecture, rule)


def _trainings(cfg: Params) -> None:
    """Check that each training starts from what another one of its architecture writes."""
    rows = {name: training_of(cfg, name) for name in part(cfg, "trainings")}
    written = {f"models/{name}": it.architecture for name, it in rows.items()}
    for name, it in rows.items():
        if it.previous not in (NONE, it.encoder) and written.get(it.previous) != it.architecture:
            rule = f"no row of trainings writes networks of architecture {it.architecture} there"
            raise ConfigError(f"trainings.{name}.previous", it.previous, rule)


def weights_of(cfg: Params, network: str) -> list[str]:
    """Checkpoints of a network that trainings write."""
    weights = []
    for name, it in ((name, training_of(cfg, name)) for name in cfg["trainings"]):
        if network in networks_of(cfg, it.architecture):
            ends = product(cfg["folds"][it.folds] if it.folds else [""], seeds_of(cfg, it))
            weights += [Path("models", name, network, *end).as_posix() for end in ends]
    return weights


def _exports(cfg: Params, group: str) -> None:
    """Check the rows `exports` of a part."""
    with configured(f"{group}.exports"):
        rows = load_each(ExportRow, part(cfg, group).get("exports", {}))
    for name, export in rows.items():
        kalman_of(cfg, export.tracker)
        weights = dict.fromkeys(weights_of(cfg, export.network))
        one_of(f"{group}.exports.{name}.weights", export.weights, weights)


def _online(cfg: Params) -> None:
    with configured("online"):
        load_together([Following, OnlineRows], part(cfg, "online"))
    _exports(cfg, "online")


def check_layouts(layouts: Params) -> None:
    """Make drawn rooms of what is written of them.

    Raises:
        ConfigError: a name is unknown, or a value breaks its rule; it names the key.
    """
    with configured("layouts"):
        for name, layout in layouts.items():
            layout_from(layout, name)


def _situations(cfg: Params) -> None:
    kinds = {"rows": RowSettings, "real": ViewingSettings, "simulated": None}
    for name in part(cfg, "situations"):
        if kind := one_of("situations", name, kinds):
            with configured(f"situations.{name}"):
                load(kind, part(cfg, "situations", name))
            continue
        with configured("situations.simulated"):
            sets = load_each(SimulatedSet, part(cfg, "situations", name))
        for key, chosen in sets.items():
            if chosen.kind == "arrangement":
                _scenes(f"situations.simulated.{key}.input", chosen.input)


def _training(cfg: Params) -> None:
    training = part(cfg, "training")
    with configured("training"):
        load(DeviceSettings, {name: value for name, value in training.items() if name in WHERE})
    for phase in training.keys() - WHERE:
        phase_of(cfg, phase)


def _features(cfg: Params) -> None:
    for model in part(cfg, "features"):
        one_of("features", model, FEATURES)
        features_of(cfg, model)


def _recording(cfg: Params) -> None:
    with configured("recording"):
        rows = load(RecordingRows, part(cfg, "recording"))
    for name, scene in rows.scenes.items():
        if scene.scene.rpartition("/")[2] != name:
            rule = "the row must have the name of the scene, as its files have"
            raise ConfigError(f"recording.scenes.{name}.scene", scene.scene, rule)


def _scenes(key: str, folder: str) -> None:
    """Check that an input can be a folder of scenes."""
    if folder == STAMP:
        raise ConfigError(key, folder, "it must be a folder of scenes, such as data/scenes/simulated/main")


def _driving(cfg: Params) -> None:
    _exports(cfg, "driving")
    for name, place in study_of(cfg).places.items():
        if place.world == NO_WORLD:
            _scenes(f"driving.places.{name}.input", place.input)


def _report(cfg: Params) -> None:
    Methods.read(Path(), cfg["comparison"]["reference"])
    read_published(Path())
    read_paper()
    for study in read_page()[0].replays:
        one_of("conf/report/page.yaml, replays", study, STUDIES)


def _literature(cfg: Params) -> None:
    """Check the tables of this study as those for which they stand in, see `tables_of`."""
    study = part(cfg, "literature")
    own = {**cfg, **study}
    with configured("literature"):
        load(ComparisonRows, {name: study[name] for name in study.keys() - PARTS.keys() - {"exports"}})
    try:
        check_references(own, study)
        for name in filter(PARTS.get, study):
            PARTS[name](own)
    except ConfigError as error:
        raise ConfigError(f"literature.{error.field}", error.value, error.remedy) from error
    _exports(own, "literature")


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
    "sequences": _whole("sequences", SequenceSets),
    "protocol": windows_of,
    "features": _features,
    "autoencoder": _whole("autoencoder", ThreadSettings, CropSplit, AutoencoderSettings),
    "training": _training,
    "trainings": _trainings,
    "validation": flow_of,
    "evaluation": _whole("evaluation", MetricSettings, ForecasterChoices),
    "comparison": _whole("comparison", Reference, Resampling),
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
    check_references(cfg)
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
    *("driving.places", "literature.places", "literature.trainings", "literature.folds.eth_ucy"),
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
        try:
            check_parts(plain(params))
            for check in TABLES:
                check(plain(params))
        except PedpredError:
            if "DVC_EXP_NAME" in os.environ:  # `dvc exp run -S` has written a wrong value into params.yaml
                config.main([])
            raise
        config.main(["--check", "--stamp", STAMP])
        write_shared(params, Path())
        write_code()


if __name__ == "__main__":
    main()
