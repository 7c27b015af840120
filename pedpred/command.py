"""The command `pedpred`: look at scenes and recordings, convert them, predict in them."""

from __future__ import annotations

import argparse
import logging
import sys
from pathlib import Path

import numpy as np
from tqdm import tqdm

from pedpred.errors import PedpredError
from pedpred.online import OnlinePredictor, OnlineSettings
from pedpred.online.replay import as_windows, replayed
from pedpred.recording import read_recording, write_recording
from pedpred.recording.foxglove import write_layout
from pedpred.scenes import Scene
from pedpred.storage.scenes import read_scene, write_scene

_METHOD = "pedpred"
_COLOUR = (0.84, 0.37, 0.0)


def read_any(path: Path) -> Scene:
    """A scene folder or an MCAP recording."""
    return read_scene(path) if path.is_dir() else read_recording(path)


def info(given: argparse.Namespace) -> None:
    """Say what a scene holds."""
    scene = read_any(given.scene)
    recording, occupancy = scene.recording, scene.occupancy
    tracks, instants = (len(np.unique(values)) for values in (recording.track_id, recording.time_s))
    span_s = float(np.ptp(recording.time_s)) if len(recording) else 0.0
    known = [
        n for n in ("velocity", "goal", "desired_speed_mps", "group_id") if getattr(recording, n) is not None
    ]
    width, height = occupancy.extent_m
    lines = {
        "name": scene.name,
        "detections": f"{len(recording)} of {tracks} tracks, {instants} instants",
        "duration": f"{span_s:.1f} s, usually {scene.detection_dt_s:g} s between two detections",
        "map": f"{width:.1f} m x {height:.1f} m, cells of {occupancy.resolution_m:g} m, "
        f"{100 * occupancy.occupied.mean():.1f} % occupied",
        "also known": ", ".join(known) or "nothing",
        "camera": "yes" if scene.camera else "no",
    }
    sys.stdout.writelines(f"{key:>12}  {value}\n" for key, value in lines.items())


def convert(given: argparse.Namespace) -> None:
    """Write a scene as MCAP (a name that ends in .mcap) or as a scene folder."""
    _refuse_overwriting(given.output, given.force)
    scene = read_any(given.scene)
    if given.output.suffix == ".mcap":
        write_recording(scene, given.output)
        write_layout(scene.occupancy, set(), given.output.with_suffix(".foxglove.json"))
    else:
        write_scene(scene, given.output)


def predict(given: argparse.Namespace) -> None:
    """Replay a scene through the online predictor and write it with the forecasts as MCAP."""
    _refuse_overwriting(given.output, given.force)
    scene = read_any(given.scene)
    options = OnlineSettings(max_age_s=max(0.5, 1.25 * scene.detection_dt_s))
    predictor = OnlinePredictor.load(given.model, options)
    frames = len(np.unique(scene.recording.time_s))
    forecasts = tqdm(replayed(scene, predictor), total=frames, desc=f"predict {scene.name}", unit="frame")
    windows = as_windows(scene, forecasts, _METHOD, predictor.features.lost_after_s)
    write_recording(scene, given.output, windows, {_METHOD: _COLOUR})
    write_layout(scene.occupancy, set(), given.output.with_suffix(".foxglove.json"))


def _refuse_overwriting(path: Path, force: bool) -> None:
    if path.exists() and not force:
        sys.exit(f"{path} is there already; --force replaces it")


def parser() -> argparse.ArgumentParser:
    """Arguments of all subcommands."""
    top = argparse.ArgumentParser(prog="pedpred", description=__doc__)
    commands = top.add_subparsers(required=True, metavar="COMMAND")
    for action in (info, convert, predict):
        command = commands.add_parser(action.__name__, help=action.__doc__, description=action.__doc__)
        command.set_defaults(action=action)
        command.add_argument("scene", type=Path, help="a scene folder or an MCAP recording")
        if action is not info:
            what = "an MCAP file" if action is predict else "an MCAP file (.mcap) or a new scene folder"
            command.add_argument("-o", "--output", type=Path, required=True, help=what)
            command.add_argument("--force", action="store_true", help="replace what is there")
        if action is predict:
            command.add_argument(
                "--model", type=Path, required=True, help="a model folder, e.g. models/online/main"
            )
    return top


def main(arguments: list[str] | None = None) -> None:
    """Run a command; an error that a user can repair ends it with its message alone."""
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    given = parser().parse_args(arguments)
    try:
        given.action(given)
    except PedpredError as error:
        sys.exit(f"{type(error).__name__}: {error}")


if __name__ == "__main__":
    main()
