"""Every reader of pedpred with a small intact example of what it reads (`tests/trust/examples.py`).

A reader is added by one line of `READERS`: `make` writes the files into a folder, `read` reads them.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rosbags.rosbag2 import StoragePlugin

from pedpred import config
from pedpred.command.prediction import read_tracker
from pedpred.models.registry import load_network
from pedpred.ros import read_bag
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


READERS = {
    "ewap": Reader(
        examples.make_ewap,
        ("obsmat.txt", "H.txt", "groups.txt", "map.png", "reference.png"),
        source("ewap", EWAP),
    ),
    "eth_ucy": Reader(write_street, ("street.txt",), source("eth_ucy", STREET)),
    "jupedsim": Reader(write_laboratory, ("hall.txt", "hall.xml"), source("jupedsim", LABORATORY)),
    "map": Reader(examples.make_scene, ("map.yaml", "map.pgm"), read_map),
    "pictures of maps": Reader(
        examples.make_picture_maps,
        ("deep/map.yaml", "deep/sub/deep.png", "room/sub/room.tif"),
        examples.read_picture_maps,
    ),
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
    "rows": Reader(examples.make_rows, ("manifest.json", "place.parquet"), examples.read_rows),
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
    "archive": Reader(examples.make_archive, ("mirror.tar", "mirror.tgz"), examples.read_archive),
    "conf": Reader(
        examples.make_conf,
        ("conf/config.yaml", "conf/scale/default.yaml", "conf/scenes/eth.yaml"),
        lambda folder: config.composed(folder / "conf", []),
    ),
}
