"""Every reader of pedpred with a small intact example of what it reads (`tests/trust/examples.py`).

A reader is added by one line of `READERS`: `make` writes the files into a folder, `read` reads them.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import StoragePlugin

from pedpred import config
from pedpred.command.prediction import read_tracker
from pedpred.evaluation.forecasts import read_windows
from pedpred.models.registry import load_network
from pedpred.report import results
from pedpred.ros import read_bag
from pedpred.rows.files import read_embeddings, write_embeddings
from pedpred.sources import SOURCES
from pedpred.storage.scenes import read_map, read_scene
from tests import field_formats
from tests.bags import Store, stream
from tests.exported import export
from tests.raw_files import EWAP, LABORATORY, STREET, write_laboratory, write_street
from tests.trust import examples

Step = Callable[[Path], object]


@dataclass(frozen=True)
class Reader:
    """How to write an intact example into a folder, which of its files get damaged, how all is read."""

    make: Step
    files: tuple[str, ...]
    read: Step


def at(name: str, step: Step) -> Step:
    return lambda folder: step(folder / name)


def source(name: str, settings: Mapping[str, Any]) -> Step:
    return lambda folder: SOURCES[name](folder, "place", settings)


def bag(ros1: bool = False, **storage: StoragePlugin) -> Step:
    """Write three instants of two people, and a map."""
    store = Store(ros1=ros1)
    return lambda path: store.write(path, stream(store), **storage)


def embed(folder: Path) -> None:
    write_embeddings([np.ones((9, 32), np.float16)], folder, "place")


READERS = {
    "ewap": Reader(
        examples.make_ewap,
        ("obsmat.txt", "H.txt", "groups.txt", "map.png", "reference.png"),
        source("ewap", EWAP),
    ),
    "eth_ucy": Reader(write_street, ("street.txt",), source("eth_ucy", STREET)),
    "jupedsim": Reader(write_laboratory, ("hall.txt", "hall.xml"), source("jupedsim", LABORATORY)),
    "map": Reader(examples.make_scene, ("map.yaml", "map.pgm"), read_map),
    "deep map": Reader(examples.make_deep_map, ("map.yaml", "sub/deep.png"), read_map),
    "TIFF map": Reader(examples.make_tiff_map, ("map.yaml", "room.tif"), read_map),
    "geometries": Reader(examples.make_geometries, examples.GEOMETRIES, examples.read_geometries),
    "scene": Reader(examples.make_scene, ("scene.json", "tracks.parquet", "reference.png"), read_scene),
    "scene_folder": Reader(examples.make_table, ("tracks.csv", "scene.json"), source("scene_folder", {})),
    "tables": Reader(examples.make_tables, examples.TABLES, examples.read_tables),
    "JuPedSim database": Reader(
        field_formats.write_jupedsim, ("simulation.sqlite",), at("simulation.sqlite", examples.scene_in)
    ),
    "data archive": Reader(field_formats.write_archive, ("archive.h5",), at("archive.h5", examples.scene_in)),
    "field formats": Reader(examples.make_field_texts, examples.FIELD_TEXTS, examples.read_field_texts),
    "columnar tables": Reader(
        examples.make_columnar, ("walk.parquet", "walk.feather"), examples.read_columnar
    ),
    "homography": Reader(examples.make_inclined, ("annotations.txt", "H.txt"), examples.read_inclined),
    "features": Reader(
        lambda folder: examples.make_rows(folder, examples.FEATURES),
        ("manifest.json", "place.parquet"),
        examples.read_rows,
    ),
    "situations": Reader(
        lambda folder: examples.make_rows(folder, examples.SITUATIONS),
        ("manifest.json", "place.parquet"),
        examples.read_rows,
    ),
    "embeddings": Reader(embed, ("place.parquet",), lambda folder: list(read_embeddings(folder, "place"))),
    "forecasts": Reader(examples.make_windows, ("place.parquet",), at("place.parquet", read_windows)),
    "foreign forecasts": Reader(examples.make_foreign, examples.FORECASTS, examples.read_foreign),
    "tracker": Reader(
        at("tracker.yaml", lambda path: path.write_text(examples.TRACKER)),
        ("tracker.yaml",),
        at("tracker.yaml", read_tracker),
    ),
    "learned place": Reader(
        at("hall.json", examples.make_learned_place),
        ("hall.json",),
        at("hall.json", examples.read_learned_place),
    ),
    "metrics": Reader(
        at("sim.json", lambda path: path.write_text(json.dumps(examples.METRICS))),
        ("sim.json",),
        at("sim.json", results.read_metrics),
    ),
    "checkpoint": Reader(examples.make_checkpoint, ("weights.safetensors", "about.json"), load_network),
    "model": Reader(export, ("model.json", "network.onnx"), examples.read_model),
    "ROS 1 bag": Reader(at("hall.bag", bag(ros1=True)), ("hall.bag",), at("hall.bag", read_bag)),
    "ROS 2 bag": Reader(at("hall", bag()), ("hall/hall.db3",), at("hall", read_bag)),
    "ROS 2 bag (MCAP)": Reader(
        at("hall", bag(storage=StoragePlugin.MCAP)),
        ("hall/hall.mcap",),
        at("hall", read_bag),
    ),
    "compressed bag": Reader(
        at("hall.mcap.zstd", examples.make_compressed), ("hall.mcap.zstd",), at("hall.mcap.zstd", read_bag)
    ),
    "bag with transforms": Reader(at("hall", examples.make_moving), ("hall/hall.db3",), at("hall", read_bag)),
    "ROS 1 in MCAP": Reader(at("hall.mcap", examples.make_ros1), ("hall.mcap",), at("hall.mcap", read_bag)),
    "MCAP bag": Reader(examples.make_recording, ("place.mcap",), at("place.mcap", read_bag)),
    "open MCAP bag": Reader(examples.make_open_recording, ("place.mcap",), at("place.mcap", read_bag)),
    "archive": Reader(examples.make_archive, ("mirror.tar", "mirror.tgz"), examples.read_archive),
    "params": Reader(examples.make_project, ("params.yaml", "dvc.yaml"), examples.read_project),
    "conf": Reader(
        examples.make_project,
        ("conf/config.yaml", "conf/scale/default.yaml", "conf/scenes/eth.yaml"),
        lambda folder: config.composed(folder / "conf", []),
    ),
}
