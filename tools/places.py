"""Print the names of the configured places, one per line: `python -m tools.places`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from pedpred.config import read_params


def main(arguments: list[str] | None = None) -> None:
    """Read params.yaml, write the names to standard output."""
    argparse.ArgumentParser(prog="python -m tools.places", description=__doc__).parse_args(arguments)
    sys.stdout.writelines(f"{name}\n" for name in read_params(Path()).places)


if __name__ == "__main__":
    main()
