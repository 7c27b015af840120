"""Write and read the shard of one long scene; `benchmarks.features` measures the memory of this process.

`python -m benchmarks.feature_memory COPIES {stream,whole} SCENE`: the scene is repeated COPIES times, one
after the other, with new track ids; its shard is written and read block by block or as a whole. With 0
copies the process only imports.
"""

from __future__ import annotations

import dataclasses
import sys
import tempfile
from pathlib import Path

import numpy as np

from pedpred.features import ForecastProtocol, extract, extract_blocks
from pedpred.models.features import RowFormat
from pedpred.models.lstm.features import LstmFeatures
from pedpred.scenes import Scene, Trajectories
from pedpred.storage.scenes import read_scene
from pedpred.storage.shards import read_shard, read_shard_blocks, write_shard
from pedpred.tracking import KalmanSettings, follow

NOISE = KalmanSettings(acceleration_noise=0.03, position_noise_m=0.05)


def repeated(scene: Scene, copies: int) -> Scene:
    """Repeat a scene, one copy after the other; every copy has tracks of its own."""
    one = scene.trajectories
    copy = np.repeat(np.arange(copies), len(one))
    rows = np.tile(np.arange(len(one)), copies)
    values = {field.name: getattr(one, field.name) for field in dataclasses.fields(one)}
    columns = {name: value[rows] for name, value in values.items() if value is not None}
    columns["time_s"] = columns["time_s"] + copy * (np.ptp(one.time_s) + 10.0)
    columns["track_id"] = columns["track_id"] + copy * (np.ptp(one.track_id) + 1)
    return dataclasses.replace(scene, trajectories=Trajectories(**columns))


def main() -> None:
    """Write and read the shard."""
    copies, way, folder = int(sys.argv[1]), sys.argv[2], Path(sys.argv[3])
    if not copies:
        return
    scene, features = repeated(read_scene(folder), copies), LstmFeatures()
    tracks = follow(scene.trajectories, "kalman", NOISE, 0.2)
    protocol = ForecastProtocol()
    made_with = RowFormat(protocol, "lstm", features)
    with tempfile.TemporaryDirectory() as out:
        if way == "stream":
            write_shard(extract_blocks(scene, tracks, protocol, features), Path(out), scene.name)
            rows = sum(len(block) for block in read_shard_blocks(Path(out), scene.name, made_with))
        else:
            write_shard([extract(scene, tracks, protocol, features)], Path(out), scene.name)
            rows = len(read_shard(Path(out), scene.name, made_with))
    print(f"{rows} rows")


if __name__ == "__main__":
    main()
