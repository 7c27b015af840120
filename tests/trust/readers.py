"""Every reader of pedpred with a small intact example of what it reads (`tests/trust/examples.py`).

A reader is added by one line of `READERS`: `make` writes the files into a folder, `read` reads them.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rosbags.rosbag2 import StoragePlugin
from rosbags.typesys import Stores

from pedpred import config
from pedpred.networks import load_network
from pedpred.report import measures
from pedpred.ros import read_bag, read_recording, write_recording
from pedpred.sources import ewap
from pedpred.storage.scenes import read_map, read_scene, write_scene
from pedpred.storage.shards import read_embeddings, write_embeddings
from pedpred.storage.windows import read_windows
from tests.exported import export
from tests.trust.examples import (
    EWAP,
    METRICS,
    make_archive,
    make_bag,
    make_checkpoint,
    make_ewap,
    make_features,
    make_open_recording,
    make_project,
    make_table,
    make_windows,
    place,
    read_archive,
    read_features,
    read_model,
    read_project,
)


@dataclass(frozen=True)
class Reader:
    """How to write an intact example into a folder, which of its files get damaged, how all is read."""

    make: Callable[[Path], object]
    files: tuple[str, ...]
    read: Callable[[Path], object]


READERS = {
    "ewap": Reader(
        make_ewap,
        ("obsmat.txt", "H.txt", "groups.txt", "map.png", "reference.png"),
        lambda folder: ewap.read_sequence(folder, "eth", EWAP),
    ),
    "map": Reader(lambda folder: write_scene(place(), folder), ("map.yaml", "map.pgm"), read_map),
    "scene": Reader(
        lambda folder: write_scene(place(), folder),
        ("scene.json", "tracks.parquet", "reference.png"),
        read_scene,
    ),
    "table": Reader(make_table, ("tracks.csv", "scene.json"), read_scene),
    "features": Reader(make_features, ("manifest.json", "place.parquet"), read_features),
    "embeddings": Reader(
        lambda folder: write_embeddings([np.ones((9, 32), np.float16)], folder, "place"),
        ("place.parquet",),
        lambda folder: list(read_embeddings(folder, "place")),
    ),
    "forecasts": Reader(
        make_windows, ("place.parquet",), lambda folder: read_windows(folder / "place.parquet")
    ),
    "metrics": Reader(
        lambda folder: (folder / "sim.json").write_text(json.dumps(METRICS)),
        ("sim.json",),
        lambda folder: measures.read_metrics(folder / "sim.json"),
    ),
    "checkpoint": Reader(make_checkpoint, ("weights.safetensors", "about.json"), load_network),
    "model": Reader(export, ("model.json", "network.onnx"), read_model),
    "recording": Reader(
        lambda folder: write_recording(place(), folder / "place.mcap"),
        ("place.mcap",),
        lambda folder: read_recording(folder / "place.mcap"),
    ),
    "open recording": Reader(
        make_open_recording,
        ("place.mcap",),
        lambda folder: read_recording(folder / "place.mcap"),
    ),
    "ROS 1 bag": Reader(
        lambda folder: make_bag(folder / "hall.bag", Stores.ROS1_NOETIC),
        ("hall.bag",),
        lambda folder: read_bag(folder / "hall.bag"),
    ),
    "ROS 2 bag": Reader(
        lambda folder: make_bag(folder / "hall", Stores.ROS2_HUMBLE),
        ("hall/metadata.yaml", "hall/hall.db3"),
        lambda folder: read_bag(folder / "hall"),
    ),
    "ROS 2 bag (MCAP)": Reader(
        lambda folder: make_bag(folder / "hall", Stores.ROS2_HUMBLE, storage=StoragePlugin.MCAP),
        ("hall/metadata.yaml", "hall/hall.mcap"),
        lambda folder: read_bag(folder / "hall"),
    ),
    "MCAP bag": Reader(
        lambda folder: write_recording(place(), folder / "place.mcap"),
        ("place.mcap",),
        lambda folder: read_bag(folder / "place.mcap"),
    ),
    "open MCAP bag": Reader(
        make_open_recording, ("place.mcap",), lambda folder: read_bag(folder / "place.mcap")
    ),
    "archive": Reader(make_archive, ("mirror.tar", "mirror.tgz"), read_archive),
    "params": Reader(make_project, ("params.yaml", "dvc.yaml"), read_project),
    "conf": Reader(
        make_project,
        ("conf/config.yaml", "conf/scale/default.yaml", "conf/scenes/eth.yaml"),
        lambda folder: config.composed(folder / "conf", []),
    ),
}
