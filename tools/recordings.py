"""Fetch the recordings of real places: `python -m tools.recordings`.

`make reproduce` and `make smoke` start with it. Each data set of conf/mirrors goes to data/raw, as the stage
`fetch` does it; one that is not to be had leaves a note there. With --stand-in nothing is fetched:
conf/config.yaml then names a simulated place if, by these notes, no place of conf/places has a recording.
Run `python -m pedpred.config` afterwards.
"""

from __future__ import annotations

import argparse
import logging
import re
import shutil
import sys
from pathlib import Path

from omegaconf import DictConfig

from pedpred.config import config_errors, read_params
from pedpred.files import write_text
from pedpred.sources.mirrors import NOTE, provide
from stages.fetch import mirrors_of

RAW = Path("data/raw")
CONFIG = Path("conf/config.yaml")
STAND_IN = "simulated_corner"
"""The option of conf/stand_in that is chosen."""
_CHOICE = re.compile(r"(?<=- stand_in: )\w+")


def fetch(params: DictConfig) -> list[str]:
    """Look for all data sets, also those that were not found earlier; return how to get missing ones."""
    advice = []
    RAW.mkdir(parents=True, exist_ok=True)
    for name in params.mirrors:
        target = RAW / str(name)
        if (target / NOTE).exists():
            shutil.rmtree(target)
        provide(mirrors := mirrors_of(params, str(name)), target)
        if (target / NOTE).exists():
            advice.append(f"{mirrors.advice}. Details: {target / NOTE}")
    return advice


def choose_stand_in(params: DictConfig) -> None:
    """Make conf/config.yaml name the simulated place where no other one has a recording."""
    if all(Path(place.folder, NOTE).exists() for place in params.places.values()):
        write_text(CONFIG, _CHOICE.sub(STAND_IN, CONFIG.read_text()))


@config_errors()
def main(arguments: list[str] | None = None) -> None:
    """Fetch, and print how to get what is missing; or choose the simulated place."""
    parser = argparse.ArgumentParser(prog="python -m tools.recordings", description=__doc__)
    parser.add_argument("--stand-in", action="store_true", help="choose a simulated place if there is none")
    options, params = parser.parse_args(arguments), read_params(Path())
    logging.basicConfig(level=logging.ERROR, format="%(message)s")
    if options.stand_in:
        choose_stand_in(params)
    else:
        sys.stdout.writelines(f"{line}\n" for line in fetch(params))


if __name__ == "__main__":
    main()
