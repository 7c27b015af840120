"""Print the places that rows were fitted to, one per line: `python -m tools.places tuned_on`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from pedpred.config import config_errors, read_params
from pedpred.errors import ConfigError
from pedpred.scenes import Scene
from pedpred.storage.scenes import read_scene


def recording(place: str) -> Scene:
    """Read data/scenes/real/<place>.

    Raises:
        ConfigError: no real people were recorded there, or the recording is missing; it says how to get it.
    """
    scene = read_scene(Path("data/scenes/real", place))
    if instead := scene.unavailable or scene.stand_in:
        raise ConfigError(f"places.{place}", place, instead)
    return scene


@config_errors()
def main(arguments: list[str] | None = None) -> None:
    """Read params.yaml, write to standard output the names of places that some place's settings refer to."""
    parser = argparse.ArgumentParser(prog="python -m tools.places", description=__doc__)
    told = "of the rows: tuned_on (trackers) or fitted_on (social_forces)"
    parser.add_argument("prefix", choices=("tuned_on", "fitted_on"), help=told)
    options = parser.parse_args(arguments)
    places = read_params(Path()).places
    used = {place[kind] for place in places.values() for kind in ("tracker", "social_force")}
    sys.stdout.writelines(f"{name}\n" for name in places if f"{options.prefix}_{name}" in used)


if __name__ == "__main__":
    main()
