"""rows@features-kind: what networks read and are trained on, of simulated or real people, as Parquet.

Networks with a memory read all steps of all tracks, others single instants: `ModelFeatures.has_memory`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from omegaconf import DictConfig

from pedpred.config import SETS, configured, one_of, plain, row, stage, stage_key
from pedpred.evaluation.observed import WindowSettings, find_observed_windows
from pedpred.evaluation.windows import WindowSet
from pedpred.features import ModelFeatures, extract_blocks
from pedpred.features.perception import Perception, perceived
from pedpred.models.features import RowFormat
from pedpred.rows.files import scene_digest, step_columns, write_manifest, write_shard
from pedpred.rows.recorded import ViewingSettings, rows_of_viewing
from pedpred.rows.sampling import Rows, RowSampling, RowSettings
from pedpred.rows.simulated import SequenceSets, SimulatedSet, rows_of_scene, rows_of_world, steps_of_world
from pedpred.scenes import VARIANTS
from pedpred.settings import load
from pedpred.simulation.sensor import SensorSettings
from pedpred.storage.scenes import read_scene, scene_folders
from pedpred.workers import in_parallel
from stages.perception import features_of, perception_of, protocol_of, windows_of
from stages.sets import tables_of
from stages.worlds import worlds_of

_STRETCHES = 5
"""Of equal time, of a recording whose rows are those of windows."""
Blocks = Iterable[Mapping[str, np.ndarray]]
"""Rows of a file, block by block."""


class RowSet(NamedTuple):
    """A folder of rows.

    Attributes:
        out: the folder.
        row_format: of the rows.
        files: name -> function that makes its blocks, and arguments; a job of one worker.
        scenes: name of a file -> what identifies its scene.
    """

    out: Path
    row_format: RowFormat
    files: Mapping[str, tuple[Any, ...]]
    scenes: Mapping[str, str]


def write_sets(sets: Sequence[RowSet], title: str) -> None:
    """Write all files of some sets beside each other, then the manifests."""
    tasks = [(it.out, it.row_format, name, *made) for it in sets for name, made in it.files.items()]
    in_parallel(write_file, tasks, title, "file")
    for it in sets:
        write_manifest(it.out, it.row_format, it.scenes)


def write_file(
    out: Path, row_format: RowFormat, name: str, make: Callable[..., Blocks], *arguments: Any
) -> None:
    """Write the rows of a scene, world, viewing or recording. A job of one worker."""
    write_shard(make(*arguments), out, name, row_format)


def scenes_of(cfg: DictConfig) -> Path:
    """Folder of all sets of scenes; a study has its own."""
    return Path(cfg.get("folder", "data/scenes"))


def sampling_of(cfg: DictConfig, model: str) -> RowSampling:
    """Read how tracked people and their future become rows of a model's inputs."""
    protocol, how = protocol_of(cfg)
    causal = replace(protocol, noncausal=False)  # true states need no differences
    with configured("situations.rows"):
        settings = load(RowSettings, plain(cfg.situations.rows))
    return RowSampling(settings, RowFormat(causal, model, features_of(cfg, model)), how.standstill_mps)


def steps_of_scenes(cfg: DictConfig, model: str, kind: str, key: str, out: Path) -> RowSet:
    """All steps of the scenes of a set and of their variants, as its sensor and tracker perceive them.

    Nobody is trained on stand-ins.
    """
    source = cfg[SETS[kind]][key]
    for variant in source.variants:
        one_of(f"{SETS[kind]}.{key}.variants", variant, VARIANTS)
    how, protocol = perception_of(cfg, source)
    row_format, phase_offsets = RowFormat(protocol, model, features_of(cfg, model)), 1
    if not protocol.noncausal:  # resampled tracks have one phase
        phase_offsets = source.phase_offsets
    files, scenes = {}, {}
    for folder in scene_folders(scenes_of(cfg) / kind / key):
        if read_scene(folder).stand_in is None:
            digest = scene_digest(folder)
            for variant in ("", *source.variants):
                name = f"{folder.name}_{variant}" if variant else folder.name
                files[name] = (scene_steps, folder, variant, name, how, row_format, phase_offsets)
                scenes[name] = digest
    return RowSet(out, row_format, files, dict(sorted(scenes.items())))


def scene_steps(
    folder: Path, variant: str, name: str, how: Perception, row_format: RowFormat, phase_offsets: int
) -> Blocks:
    """Steps of a scene or of a variant of it."""
    real = read_scene(folder)
    if variant:
        real = replace(VARIANTS[variant](real), name=name)
    protocol, features = row_format.protocol, row_format.features
    scene, tracks = perceived(real, how, protocol)
    blocks = extract_blocks(
        scene, tracks, protocol, features, truth=real.trajectories, phase_offsets=phase_offsets
    )
    return map(step_columns, blocks)


def steps_of_worlds(cfg: DictConfig, model: str, out: Path) -> RowSet:
    """All steps of simulated worlds through random sensors."""
    with configured("sequences"):
        sets = load(SequenceSets, plain(cfg.sequences))
    worlds, sampling = worlds_of(cfg), sampling_of(cfg, model)
    files = {
        f"{kind}_{number:03}": (world_steps, kind, number, *worlds, sampling)
        for kind, count in sets.worlds.items()
        for number in range(count)
    }
    return RowSet(out, sampling.row_format, files, {name: name for name in sorted(files)})


def world_steps(*arguments: Any) -> Blocks:
    """Steps of a world; arguments of `steps_of_world`."""
    return map(step_columns, steps_of_world(*arguments))


def instants_of_worlds(cfg: DictConfig, model: str, key: str, out: Path) -> RowSet:
    """Instants of worlds, or of simulated scenes."""
    with configured(f"situations.simulated.{key}"):
        chosen = load(SimulatedSet, plain(cfg.situations.simulated[key]))
    (worlds, sensing), sampling = worlds_of(cfg), sampling_of(cfg, model)
    files: dict[str, tuple[Any, ...]]
    if chosen.kind == "arrangement":
        folders = scene_folders(Path(chosen.input))[: chosen.worlds]
        files = {it.name: (instants_of_scene, it, chosen, sensing, sampling) for it in folders}
    else:
        given = (chosen, worlds, sensing, sampling)
        files = {f"{key}_{n:03}": (instants, rows_of_world, n, *given) for n in range(chosen.worlds)}
    return RowSet(out, sampling.row_format, files, {name: name for name in files})


def instants(make: Callable[..., Rows], *arguments: Any) -> Blocks:
    """Rows as a single block."""
    return [make(*arguments)]


def instants_of_scene(folder: Path, *arguments: Any) -> Blocks:
    """Read a simulated scene and make its rows."""
    return [rows_of_scene(read_scene(folder), *arguments)]


def instants_of_place(cfg: DictConfig, model: str, key: str, out: Path) -> RowSet:
    """Instants of the viewings of a place; none where no real people were recorded, nor of stand-ins."""
    sensor, sampling = cfg.places[key].sensor, sampling_of(cfg, model)
    with configured(f"sensors.{sensor}"):
        rate_hz = load(SensorSettings, row(cfg, "sensors", sensor)).rate_hz
    with configured("situations.real"):
        settings = load(ViewingSettings, plain(cfg.situations.real))
    folder = scenes_of(cfg) / "real" / key
    scene = read_scene(folder)
    numbers = range(0 if scene.unavailable or scene.stand_in else settings.viewings)
    files = {f"{key}_{n}": (instants_of_viewing, folder, n, rate_hz, settings, sampling) for n in numbers}
    return RowSet(out, sampling.row_format, files, {name: name for name in files})


def instants_of_windows(cfg: DictConfig, model: str, key: str, out: Path) -> RowSet:
    """An instant for each window of a place whose protocol observes some annotations; none without it."""
    (how, protocol), windows = perception_of(cfg, cfg.places[key]), windows_of(cfg)
    row_format, folder = RowFormat(protocol, model, features_of(cfg, model)), scenes_of(cfg) / "real" / key
    files = {}
    if read_scene(folder).unavailable is None:
        files = {key: (window_instants, folder, how, windows, row_format.features)}
    return RowSet(out, row_format, files, {name: name for name in files})


def window_instants(
    folder: Path, how: Perception, windows: WindowSettings, features: ModelFeatures
) -> Blocks:
    """Rows of the windows of a recording, in stretches of time of which some are kept for validation."""
    found = find_observed_windows(read_scene(folder), how, windows, memory=False)
    return training_rows(found, features, _STRETCHES)


def training_rows(windows: WindowSet, features: ModelFeatures, parts: int) -> Iterator[dict[str, np.ndarray]]:
    """Inputs and targets in all windows of a recording, in stretches of equal time.

    Args:
        windows: of the recording.
        features: of the model.
        parts: number of stretches.

    Yields:
        The inputs, and `future`, m/s, agent frame, [M, P, 2] float32.
    """
    request, time_s = windows.request, windows.time_s
    order = np.argsort(time_s, kind="stable")
    edges = np.linspace(time_s.min(), time_s.max(), parts + 1)[1:-1]
    for which in np.split(order, np.searchsorted(time_s[order], edges)):
        row = request.rows[which]
        inputs = request.inputs(features, row, request.table.time_s[row])
        yield inputs | {"future": request.table.future[row]}


def instants_of_viewing(folder: Path, number: int, *arguments: Any) -> Blocks:
    """Read a recording and make the rows of one viewing."""
    return [rows_of_viewing(number, read_scene(folder), *arguments)]


def sets_of(cfg: DictConfig, model: str, kind: str, out: Path) -> Iterator[RowSet]:
    """All sets of a kind."""
    if features_of(cfg, model).has_memory:
        for key in cfg.sequences.scenes if kind == "simulated" else cfg.places:
            yield steps_of_scenes(cfg, model, kind, key, out / key)
        if kind == "simulated":
            yield steps_of_worlds(cfg, model, out / "worlds")
    elif kind == "simulated":
        for key in cfg.situations.simulated:
            yield instants_of_worlds(cfg, model, key, out / key)
    else:
        make = instants_of_windows if windows_of(cfg) else instants_of_place
        for key in cfg.places:
            yield make(cfg, model, key, out / key)


@stage("name", "kind", "study", "folder")
def main(cfg: DictConfig) -> None:
    """Write data/rows/<name>/<kind>, a folder per set; `name` is a row of conf/features.

    `folder` is that of the scenes; `study` has its own places and protocol.
    """
    cfg = tables_of(cfg)
    model, kind = stage_key(cfg), one_of("kind", cfg.kind, {kind: kind for kind in SETS})
    one_of("name", model, cfg.features)
    out = Path(cfg.get("out") or f"data/rows/{model}/{kind}")
    sets = list(sets_of(cfg, model, kind, out))
    out.mkdir(parents=True, exist_ok=True)  # though there may be no set
    write_sets(sets, f"rows of {model}, {kind}")


if __name__ == "__main__":
    main()
