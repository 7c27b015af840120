"""Dependencies with reason, licence and size: `python -m benchmarks.dependencies`.

Sizes are those of the packages installed here; `--write` puts the table into docs/dependencies.md.
"""

from __future__ import annotations

import argparse
import functools
import sys
import tomllib
from collections.abc import Iterable
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

from packaging.requirements import Requirement

from pedpred.errors import user_errors
from pedpred.files import write_text
from tools.readme import filled

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "dependencies.md"
EXTRAS = ("files", "hdf5", "pictures", "train", "docs")
REASONS = {
    "h5py": "archives of the Pedestrian Dynamics Data Archive",
    "lz4": "MCAP chunks compressed with lz4",
    "mcap": "MCAP files: recordings and bags",
    "numba": "compiled loops of the simulator, the crop and the angular grid",
    "numpy": "arrays",
    "onnxruntime": "the exported network on a robot, without torch",
    "pandas": "tables of tracks and curves",
    "pillow": "map images, reference pictures, animations",
    "pyarrow": "Parquet: tracks, features, forecasts",
    "pyyaml": "map.yaml, parameters",
    "rosbags": "ROS messages and bags of ROS 1 and ROS 2, without ROS",
    "scipy": "interpolation, optimisation of the tracker and of the forces",
    "shapely": "geometries in WKT, doors in walls",
    "tqdm": "progress bars",
    "zstandard": "MCAP chunks compressed with zstd",
    "dvc": "the pipeline: what is stale, cache, experiments",
    "hydra-core": "composing conf/",
    "jinja2": "the page's template",
    "joblib": "workers on cores or a cluster",
    "matplotlib": "figures",
    "onnx": "writing the exported network",
    "pedpy": "reference measures of crowds (density, flow)",
    "ruamel.yaml.clib": "DVC parses dvc.lock in half the time",
    "safetensors": "weights without pickle",
    "scikit-fmm": "distance to a goal around obstacles",
    "torch": "training",
    "latex2mathml": "equations of the documentation, without JavaScript",
    "mkdocs-material": "the documentation as a site",
    "mkdocstrings": "API reference from docstrings",
}


def declared() -> dict[str, list[Requirement]]:
    """Return the direct dependencies in pyproject.toml that users install: robot, and by extra."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    groups = {"robot": project["dependencies"]} | {name: extras[name] for name in EXTRAS}
    needs = {group: [Requirement(text) for text in texts] for group, texts in groups.items()}
    return {group: [need for need in own if need.name != project["name"]] for group, own in needs.items()}


@functools.cache
def size_bytes(name: str) -> int:
    """Sum the sizes of a package's installed files."""
    package = distribution(name)
    paths = (Path(str(package.locate_file(file))) for file in package.files or [])
    return sum(path.stat().st_size for path in paths if path.is_file())


def licence(package: Distribution) -> str:
    """Return the package's SPDX expression, else its classifier, else the first line of its licence."""
    about = package.metadata
    classified = [
        c.rpartition(" :: ")[2] for c in about.get_all("Classifier") or [] if c.startswith("License ::")
    ]
    text = about.get("License-Expression") or ", ".join(classified) or about.get("License") or "not stated"
    return text.splitlines()[0].strip()[:60]


def closure(wanted: Iterable[Requirement]) -> dict[str, Distribution]:
    """Return every installed package that these need, directly or indirectly, by name."""
    found: dict[str, Distribution] = {}
    waiting = list(wanted)
    seen: set[tuple[str, str]] = set()
    while waiting:
        need = waiting.pop()
        for extra in ["", *need.extras]:
            if (need.name.lower(), extra) in seen:
                continue
            seen.add((need.name.lower(), extra))
            try:
                package = distribution(need.name)
            except PackageNotFoundError:
                continue  # of another platform
            found[package.metadata["Name"]] = package
            for inner in map(Requirement, package.requires or []):
                if inner.marker is None or inner.marker.evaluate({"extra": extra}):
                    waiting.append(inner)
    return found


def table() -> str:
    """Make the table: one row per direct dependency, then the totals with indirect ones."""
    groups = declared()
    lines = ["| package | install | why | licence | MB |", "| --- | --- | --- | --- | --: |"]
    installs: dict[str, list[str]] = {}
    for group, needs in groups.items():
        for name in sorted((need.name for need in needs), key=str.lower):
            installs.setdefault(name, []).append(group)
    for name, own in installs.items():
        megabytes, terms = size_bytes(name) / 1e6, licence(distribution(name))
        lines.append(f"| {name} | {', '.join(own)} | {REASONS[name]} | {terms} | {megabytes:.1f} |")
    lines += ["", "| install | packages, all counted | MB |", "| --- | --: | --: |"]
    for title, parts in {
        "robot": ["robot"],
        "with files": ["robot", "files"],
        "full": ["robot", "files", "train"],
        "full with docs": ["robot", "files", "train", "docs"],
    }.items():
        packages = closure(need for part in parts for need in groups[part])
        total = sum(map(size_bytes, packages)) / 1e6
        lines.append(f"| {title} | {len(packages)} | {total:.0f} |")
    return "\n".join(lines)


@user_errors()
def main() -> None:
    """Print the table, or write it into the page."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.dependencies", description=__doc__)
    parser.add_argument("--write", action="store_true", help="into docs/dependencies.md")
    text = table()
    if parser.parse_args().write:
        write_text(PAGE, filled(PAGE.read_text(), {"dependencies": text}))
    sys.stdout.write(f"{text}\n")


if __name__ == "__main__":
    main()
