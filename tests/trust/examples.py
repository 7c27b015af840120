"""Small intact examples of what pedpred reads, and how each is read."""

import hashlib
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch
import zstandard
from mcap.writer import CompressionType
from PIL import Image

from pedpred.command.forecast_tables import COLUMNS
from pedpred.command.foreign import read_forecasts
from pedpred.features import ForecastProtocol
from pedpred.forecasting.postprocessing import Postprocessing
from pedpred.geometry import Homography
from pedpred.models.features import RowFormat
from pedpred.models.lstm.features import LstmFeatures
from pedpred.online.network import ExportedNetwork, read_description
from pedpred.online.places import read_place, write_place
from pedpred.reading import read_recording
from pedpred.reading.geometry import read_ground, read_walls
from pedpred.reading.options import ReadOptions
from pedpred.reading.pixels import read_homography
from pedpred.ros import write_recording
from pedpred.rows.files import columns_of, read_manifest, read_shard, write_manifest, write_shard
from pedpred.scenes import Camera, OccupancyMap, Scene, Trajectories
from pedpred.sources import mirrors
from pedpred.storage.scenes import read_map, write_scene
from tests.bags import PEOPLE, Store, moving_bag, repacked, write_mcap
from tests.exported import NETWORK, WIDTHS, write_network
from tests.field_formats import BINARY, PIXEL_M, RATE_HZ, WKT, WRITERS
from tests.field_formats import ROWS as DETECTIONS
from tests.raw_files import write_archive, write_sequence
from tests.robots import from_camera
from tests.scenes import write_as_table

STEPS = 4
ROWS = RowFormat(ForecastProtocol(horizon_steps=STEPS), "lstm", LstmFeatures(grid_cells=8, angular_cells=6))
ARCHIVED = dict.fromkeys(("seq_eth/H.txt", "seq_eth/obsmat.txt"), b"7 1.5\n" * 100)
TRACKER = "kind: kalman\nacceleration_noise: 0.05\nposition_noise_m: 0.05\n"
CONF = "defaults: [_self_, scale: default, scenes@scenes.eth: eth]\nscenes: {}\nseed: 1\nrates: [0.1, 1e-3]\n"


def scene_in(path: Path, options: ReadOptions | None = None) -> Scene:
    return read_recording(path, options).scene


def place() -> Scene:
    """Two people in a room with a block, with a camera, and all that simulation knows."""
    rng = np.random.default_rng(0)
    position = rng.normal(size=(20, 2))
    time_s, track_id = np.repeat(np.arange(10) * 0.4, 2), np.tile([1, 2], 10)
    wishes = {"goal": position + 5, "desired_speed_mps": np.ones(20), "group_id": np.tile([-1, 3], 10)}
    trajectories = Trajectories(time_s, track_id, position, 0.1 * position, **wishes)
    occupied = np.zeros((12, 9), bool)
    occupied[3:6, 2:4] = True
    camera = Camera(Homography(np.diag([0.1, 0.2, 1.0])), rng.integers(0, 255, (6, 8, 3), dtype=np.uint8))
    return Scene("place", trajectories, OccupancyMap(occupied, np.array([-1.0, -2.0]), 0.5), 0.4, camera)


def make_scene(folder: Path) -> None:
    write_scene(place(), folder)


def make_picture_maps(folder: Path) -> None:
    """Sixteen bits, transparent in places, in mode scale; and a compressed picture of eight bits."""
    about = "resolution: 0.1\norigin: [-1, -2.0, 0]\nnegate: no\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
    grey = np.random.default_rng(0).integers(0, 2**16, (12, 9), dtype=np.uint16)
    pictures = {"deep.png": (grey, {"transparency": int(grey[0, 0])})}
    pictures["room.tif"] = ((grey // 256).astype(np.uint8), {"compression": "tiff_lzw"})
    for name, (cells, options) in pictures.items():
        (folder / name[:4] / "sub").mkdir(parents=True)
        Image.fromarray(cells).save(folder / name[:4] / "sub" / name, **options)
        (folder / name[:4] / "map.yaml").write_text(f"image: ./sub/{name}\nmode: scale\n{about}")


def read_picture_maps(folder: Path) -> object:
    return [read_map(folder / name) for name in ("deep", "room")]


GEOMETRIES = ("lines.xml", "room.wkt")


def make_geometries(folder: Path) -> None:
    """A room with a door and a table drawn by its edges, and ground with a hole beside a wall."""
    vertex = '<vertex px="{}" py="{}"/>'.format
    table = [((1, 1), (2, 1)), ((2, 1), (2, 2)), ((2, 2), (1, 1))]
    walls = "".join(vertex(*point) for point in [(0, 0), (6, 0), (6, 4), (0, 4), (0, 0)])
    edges = "".join(f"<polygon>{vertex(*a)}{vertex(*b)}</polygon>" for a, b in table)
    rooms = f"<room><subroom><polygon>{walls}</polygon><obstacle>{edges}</obstacle></subroom></room>"
    doors = f"<transitions><transition>{vertex(6, 1)}{vertex(6, 2)}</transition></transitions>"
    (folder / GEOMETRIES[0]).write_text(f'<geometry unit="m"><rooms>{rooms}</rooms>{doors}</geometry>')
    (folder / GEOMETRIES[1]).write_text(f"GEOMETRYCOLLECTION ({WKT}, LINESTRING (1 1, 2 3, 3 3))")


def read_geometries(folder: Path) -> object:
    return [read_ground(folder / name, read_walls(folder / name)) for name in GEOMETRIES]


def make_table(folder: Path) -> None:
    write_as_table(place(), folder, float_format="%.3f")


TABLES = ("walk.csv", "walk.tsv", "walk.txt", "dates.csv")


def make_tables(folder: Path) -> None:
    """The same people in every kind of table."""
    rows = [(0.4 * k, who, 0.5 * k, who) for k in range(10) for who in (1, 2)]
    for name, separator in {"walk.csv": ";", "walk.tsv": "\t", "walk.txt": " "}.items():
        lines = [("time", "id", "x", "y"), *rows]
        (folder / name).write_text("\n".join(separator.join(map(str, row)) for row in lines))
    dated = [f"2026-12-24T10:00:{t:04.1f};{who};{x};{y}" for t, who, x, y in rows]
    (folder / "dates.csv").write_text("\n".join(["time;id;x;y", *dated]))


def read_tables(folder: Path) -> object:
    return [scene_in(folder / name) for name in TABLES]


FIELD_TEXTS = (
    *("fcd.xml", "annotations.txt", "00_tracks.csv", "00_tracksMeta.csv", "00_recordingMeta.csv"),
    *("Exp_1_run_1.tsv", "THOR-Magni_120522_SC1A_R1.csv", "postvis.traj", "hall_001.pp", "atc-20121031.csv"),
    *("0013.txt", "walk.ndjson", "zara.vsp"),
)


def make_field_texts(folder: Path) -> None:
    """The same people in every format of the field that is text."""
    for name, write in WRITERS.items():
        if name not in BINARY:
            write(folder)


def make_inclined(folder: Path) -> None:
    """Annotations in a picture, and its homography."""
    WRITERS["Stanford Drone Dataset"](folder)
    (folder / "H.txt").write_text("0.025 0.001 -3\n0.002 -0.025 20\n0.0001 0.0002 1\n")


def read_inclined(folder: Path) -> object:
    return scene_in(folder / "annotations.txt", ReadOptions(homography=read_homography(folder / "H.txt")))


def read_field_texts(folder: Path) -> object:
    names = [name for name in FIELD_TEXTS if "Meta" not in name]
    options = {"annotations.txt": ReadOptions(pixel_m=PIXEL_M), "0013.txt": ReadOptions(rate_hz=RATE_HZ)}
    options["zara.vsp"] = ReadOptions(pixel_m=PIXEL_M)
    return [scene_in(folder / name, options.get(name)) for name in names]


def make_columnar(folder: Path) -> None:
    """People as tables of pandas."""
    table = pd.DataFrame(DETECTIONS, columns=["time", "ped_id", "x", "y"]).astype({"ped_id": str})
    table.to_parquet(folder / "walk.parquet")
    table.to_feather(folder / "walk.feather")


def read_columnar(folder: Path) -> object:
    return [scene_in(folder / name) for name in ("walk.parquet", "walk.feather")]


FORECASTS = ("theirs.csv", "theirs.ndjson", "theirs.parquet")


def make_foreign(folder: Path) -> None:
    """Forecasts of two people by somebody else, in two modes of three steps, as a table and as TrajNet++."""
    rows = [
        (who, 0.4 * 5, mode, 0.5, k, 0.5 * k, mode) for who in (1, 2) for mode in (0, 1) for k in (1, 2, 3)
    ]
    (folder / FORECASTS[0]).write_text("\n".join(",".join(map(str, row)) for row in [COLUMNS, *rows]))
    pd.DataFrame(rows, columns=list(COLUMNS)).to_parquet(folder / FORECASTS[2])
    lines: list[Any] = [{"scene": {"id": who, "p": who, "s": 0, "e": 200, "fps": 2.5}} for who in (1, 2)]
    for who, _, mode, _, k, x, y in rows:
        own = {"prediction_number": mode, "scene_id": who}
        lines.append({"track": {"f": 50 + 10 * k, "p": who, "x": x, "y": y, **own}})
    (folder / FORECASTS[1]).write_text("\n".join(map(json.dumps, lines)))


def read_foreign(folder: Path) -> object:
    return [read_forecasts(folder / name) for name in FORECASTS]


def make_ewap(folder: Path) -> None:
    """An inclined camera, and its picture."""
    write_sequence(folder)
    (folder / "H.txt").write_text(" 1 0 -1\n 0 2 -2\n 0.01 0 1\n")
    with Image.open(folder / "map.png") as picture:
        picture.convert("RGB").save(folder / "reference.png")


def make_rows(folder: Path) -> None:
    """Two row groups of a track each, and the manifest."""
    rng, blocks = np.random.default_rng(0), []
    for track in range(2):
        random = {
            n: rng.integers(0, 255, (6, *it.shape)).astype(it.dtype) for n, it in columns_of(ROWS).items()
        }
        steps = {"track_id": np.full(6, track), "step": np.arange(6), "future_steps": np.full(6, STEPS)}
        blocks.append(random | steps)
    write_shard(blocks, folder, "place", ROWS)
    write_manifest(folder, ROWS, {"place": "a scene"})


def read_rows(folder: Path) -> object:
    """Manifest, then every file that it names."""
    row_format, names = read_manifest(folder)
    return [list(read_shard(folder, name, row_format)) for name in names]


def make_checkpoint(folder: Path) -> None:
    """An untrained motion network."""
    torch.manual_seed(0)
    write_network(folder, NETWORK.build(WIDTHS, 10))


def read_model(folder: Path) -> object:
    """Description and network, and one step of two people."""
    about = read_description(folder)
    network = ExportedNetwork(folder, about)
    memory = {name: np.zeros((2, *shape), np.float32) for name, shape in about.memory.items()}
    shapes = about.features.shapes()
    return network.step({n: np.zeros((2, *shapes[n]), np.float32) for n in about.inputs}, memory)


def make_recording(folder: Path) -> None:
    """Neither compressed nor in chunks nor with checksums, so that damage reaches the messages."""
    write_recording(place(), folder / "closed.mcap")
    how: dict[str, Any] = {"use_chunking": False, "enable_crcs": False, "compression": CompressionType.NONE}
    repacked(folder / "closed.mcap", folder / "place.mcap", **how)


def make_compressed(path: Path) -> None:
    """An MCAP file that is compressed as a whole."""
    write_recording(place(), path.with_name("plain.mcap"))
    path.write_bytes(zstandard.compress(path.with_name("plain.mcap").read_bytes()))


def make_moving(folder: Path) -> None:
    """People in the frame of a robot that moves."""
    moving_bag(Store(), folder, "camera", from_camera)


def make_ros1(path: Path) -> None:
    """Messages of ROS 1, with definitions, neither in chunks nor with checksums."""
    write_mcap(Store(ros1=True), path, PEOPLE, "ros1", "ros1msg", True)


def make_archive(folder: Path) -> None:
    for kind in ("tar", "tgz"):
        write_archive(folder / f"mirror.{kind}", content=ARCHIVED)


def read_archive(folder: Path) -> None:
    """Fetch from the archives, one of which is damaged; nothing but the right files may come of it."""
    target = folder / "raw" / "ewap"
    shutil.rmtree(target.parent, ignore_errors=True)
    sums = tuple(f"{hashlib.sha256(content).hexdigest()}  {name}" for name, content in ARCHIVED.items())
    archives = tuple(str(folder / f"mirror.{kind}") for kind in ("tar", "tgz"))
    mirrors.fetch(mirrors.Mirrors("ewap", (), archives, 1.0, sums), target)


def make_conf(folder: Path) -> None:
    """conf/ of a tiny project."""
    for name, text in {
        "config.yaml": CONF,
        "scale/default.yaml": "# @package _global_\nseed: 2\n",
        "scenes/eth.yaml": "hz: 15.0\nfile: obsmat.txt\nagain: ${seed}\n",
    }.items():
        (folder / "conf" / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / "conf" / name).write_text(text)


def make_learned_place(path: Path) -> None:
    untaught = Postprocessing(trust=True).initial(STEPS).plain()
    untaught["trust"]["compared"] = [3.0, 0.0, 40.0]
    write_place(path, Postprocessing(trust=True).initial(STEPS).restored(untaught), {}, "network")


def read_learned_place(path: Path) -> dict[str, Any]:
    return read_place(path, Postprocessing(trust=True).initial(STEPS), "network")[0].plain()
