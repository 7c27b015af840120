"""Print the places that rows were fitted to, one per line: `python -m tools.places tuned_on`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from pedpred.command.recordings import OpenOptions, open_scene
from pedpred.config import config_errors, read_params
from pedpred.errors import ConfigError, InputError
from pedpred.reading.options import ReadOptions
from pedpred.scenes import Scene
from pedpred.storage.scenes import read_scene, scene_folders
from tools.arguments import positive

REAL = Path("data/scenes/real")


def recording(place: str) -> Scene:
    """Read data/scenes/real/<place>.

    Raises:
        ConfigError: the place has no recording; the error says how to get one.
    """
    scene = read_scene(REAL / place)
    if instead := scene.unavailable or scene.stand_in:
        raise ConfigError(f"places.{place}", place, instead)
    return scene


def add_recordings(parser: argparse.ArgumentParser) -> None:
    """Add the options that `recordings` takes."""
    parser.add_argument("recording", nargs="*", type=Path, help="any file that `pedpred evaluate` reads")
    parser.add_argument("--rate", type=positive, help="frames per second, where files count frames, Hz")


def recordings(files: Sequence[Path], rate_hz: float | None = None) -> Iterator[Scene]:
    """Read files; without any, all places that have a recording.

    Args:
        files: recordings or scene folders, as `pedpred evaluate` reads them.
        rate_hz: frames per second, where files count frames, Hz.

    Raises:
        InputError: a file is missing or damaged, or no place has a recording.
    """
    for path in files:
        scene = open_scene(path, OpenOptions(ReadOptions(rate_hz=rate_hz)) if path.is_file() else None)
        if scene.unavailable is not None:
            raise InputError(path, "", "its recording is not available", scene.unavailable)
        yield scene
    if files:
        return
    folders = scene_folders(REAL) if REAL.exists() else []
    places = [folder for folder in folders if read_scene(folder).unavailable is None]
    if not places:
        remedy = "`python -m tools.recordings` says how to get recordings; then run `dvc repro ingest`"
        raise InputError(REAL, "", "no recording is here", f"{remedy}. Or name files")
    yield from map(open_scene, places)


@config_errors()
def main(arguments: list[str] | None = None) -> None:
    """Read params.yaml, write to standard output the names of places that some place's settings refer to."""
    parser = argparse.ArgumentParser(prog="python -m tools.places", description=__doc__)
    about = "of the rows: tuned_on (trackers) or fitted_on (social_forces)"
    parser.add_argument("prefix", choices=("tuned_on", "fitted_on"), help=about)
    options = parser.parse_args(arguments)
    places = read_params(Path()).places
    used = {place[kind] for place in places.values() for kind in ("tracker", "social_force")}
    sys.stdout.writelines(f"{name}\n" for name in places if f"{options.prefix}_{name}" in used)


if __name__ == "__main__":
    main()
