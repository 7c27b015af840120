"""From `conf/` to `params.yaml`, and from there to a stage: only the keys that it declares.

`python -m pedpred.config` writes params.yaml; `--check` fails with a diff when conf/ has moved on.
Under DVC (which sets DVC_STAGE) a stage reads params.yaml; run by hand it composes conf/ with the
overrides on its command line.
"""

from __future__ import annotations

import argparse
import difflib
import errno
import functools
import inspect
import itertools
import logging
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, cast

import hydra
import yaml
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import ConfigAttributeError, ConfigKeyError, OmegaConfBaseException

from pedpred.errors import ConfigError, PedpredError
from pedpred.files import read_yaml, translate_errors, write_text

_DISK = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EACCES, errno.EPERM)
_DISK_REMEDY = "make room on the disk or the folder writable, then run dvc repro again"

LOCK, KEPT = Path("dvc.lock"), Path("build/dvc.lock")
"""Checksums of all results as DVC writes them, in place, and as they stood when a stage last began."""


def stage(main: Callable[[DictConfig], None]) -> Callable[[], None]:
    """Turn `main(cfg)` into a stage's entry point.

    `cfg` is read-only and complete. Under DVC it holds just the keys that dvc.yaml declares for the
    running stage, so the dependency tracking cannot lie; by hand it is what conf/ composes to with
    the Hydra overrides given. A `PedpredError` ends the process with its message alone: it is meant
    for people.
    """
    root = Path(inspect.getfile(main)).resolve().parents[1]  # not DVC_ROOT: a queued run is a copy

    @functools.wraps(main)
    def entry() -> None:
        address = os.environ.get("DVC_STAGE")

        def run(cfg: DictConfig) -> None:
            logging.basicConfig(level=logging.INFO, format="%(name)s: %(message)s")
            with _explained(address):
                main(_frozen(declared(cfg, root, address, sys.argv[1:]) if address else cfg))

        if address:
            with _explained(address):
                keep_lock(root)
                params = read_params(root)
            run(params)
        else:
            hydra.main(version_base="1.3", config_path=str(root / "conf"), config_name="config")(run)()

    return entry


@contextmanager
def _explained(address: str | None) -> Iterator[None]:
    """End the process with the message alone where a person can repair what is wrong."""
    try:
        yield
    except (ConfigAttributeError, ConfigKeyError) as error:
        raise SystemExit(f"\n{_undeclared(error, address)}\n") from error
    except (PedpredError, OmegaConfBaseException) as error:
        raise SystemExit(f"\n{type(error).__name__}: {error}\n") from error
    except OSError as error:
        if error.errno not in _DISK:
            raise
        raise SystemExit(f"\n{error}. Nothing half-written was kept; {_DISK_REMEDY}\n") from error


def read_params(root: Path) -> DictConfig:
    """The configuration that a project's params.yaml holds.

    Raises:
        ConfigError: the file is missing or damaged.
    """
    params = _read_yaml(root / "params.yaml")
    with translate_errors(partial(ConfigError, "params", str(root / "params.yaml"))):
        return OmegaConf.create(params)


def _read_yaml(path: Path) -> dict[str, Any]:
    return read_yaml(path, partial(ConfigError, path.stem, str(path)))


def _frozen(cfg: DictConfig) -> DictConfig:
    OmegaConf.resolve(cfg)
    OmegaConf.set_struct(cfg, True)
    OmegaConf.set_readonly(cfg, True)
    return cfg


def _undeclared(error: OmegaConfBaseException, address: str | None) -> ConfigError:
    remedy = (
        f"stage '{address}' reads it, but dvc.yaml does not declare it under its params"
        if address
        else "conf/ has no such key"
    )
    return ConfigError(str(error.full_key), None, remedy)


def stage_key(cfg: DictConfig) -> str:
    """What the command's `+name=` says: which scene, model or half of the report the stage is about.

    Raises:
        ConfigError: it is not there.
    """
    if not cfg.get("name"):
        raise ConfigError("name", None, "say which one, e.g. `python -m stages.features +name=eth`")
    return str(cfg.name)


def plain(node: DictConfig) -> dict[str, Any]:
    """A part of the configuration as an ordinary dictionary, for those who know nothing of stages."""
    return cast(dict[str, Any], OmegaConf.to_container(node, resolve=True))


def keep_lock(root: Path) -> None:
    """Copy dvc.lock, which DVC leaves alone while a stage runs, for `tools.mend_lock`."""
    if (root / LOCK).exists():
        write_text(root / KEPT, (root / LOCK).read_text())


def declared(cfg: DictConfig, root: Path, address: str, arguments: list[str]) -> DictConfig:
    """What a stage may see of params.yaml: its declared keys and its command's own `key=value` pairs."""
    given = [a.lstrip("+") for a in arguments if "=" in a and not a.startswith("-")]
    seen = only(cfg, declared_params(root, address))
    seen.merge_with_dotlist(given)
    return seen


def only(cfg: DictConfig, keys: Iterable[str]) -> DictConfig:
    """A configuration with the named (dotted) keys of `cfg` and nothing else.

    Raises:
        ConfigError: a key is not in the configuration.
    """
    kept = OmegaConf.create()
    missing = object()
    for key in keys:
        with translate_errors(partial(ConfigError, key, "params.yaml")):
            value = OmegaConf.select(cfg, key, default=missing)
        if value is missing:
            raise ConfigError(key, None, "dvc.yaml declares it, but params.yaml does not have it")
        OmegaConf.update(kept, key, value, force_add=True)
    return kept


def declared_params(root: Path, address: str) -> list[str]:
    """The parameter keys that dvc.yaml declares for a stage address such as `features@eth`.

    Raises:
        ConfigError: dvc.yaml has no such stage, or its template asks for a value that is not there.
    """
    name, _, key = address.rpartition("/")[2].rpartition(":")[2].partition("@")
    pipeline, known_values = _read_yaml(root / "dvc.yaml"), _read_yaml(root / "params.yaml")
    with translate_errors(partial(ConfigError, address, str(root / "dvc.yaml"))):
        entry = pipeline["stages"].get(name, {"foreach": []})
        for variables in pipeline.get("vars", []):
            known_values |= variables
        for known, values in _instances(entry, known_values):
            if known == key:
                return [_filled(text, values) for text in entry.get("do", entry).get("params", [])]
    raise ConfigError("DVC_STAGE", address, "dvc.yaml has no such stage")


def _instances(entry: dict[str, Any], params: dict[str, Any]) -> Iterator[tuple[str, dict[str, str]]]:
    """Each instance of a (foreach, matrix or plain) stage: its key and its template values."""
    if "foreach" in entry:
        for item in _listed(entry["foreach"], params):
            yield item, {"item": item, "key": item}
    elif "matrix" in entry:
        names = list(entry["matrix"])
        for values in itertools.product(*(_listed(entry["matrix"][n], params) for n in names)):
            yield "-".join(values), {f"item.{n}": v for n, v in zip(names, values, strict=True)}
    else:
        yield "", {}


def _listed(values: Any, params: dict[str, Any]) -> list[str]:
    """The keys of a list, a dictionary or a reference `${path.in.params}` to one."""
    if isinstance(values, str):
        values = functools.reduce(lambda node, part: node[part], values.strip("${}").split("."), params)
    return [str(value) for value in values]


def _filled(template: str, values: dict[str, str]) -> str:
    def value(found: re.Match[str]) -> str:
        if found[1] not in values:
            raise ConfigError(template, found[0], f"under `params:` only {sorted(values)} can be filled in")
        return values[found[1]]

    return re.sub(r"\$\{([\w.]+)\}", value, template)


def composed(conf: Path, overrides: list[str]) -> str:
    """What `conf/` composes to, as YAML text with all references resolved.

    It is byte for byte what `dvc exp run` writes, so that experiments leave params.yaml clean.

    Raises:
        ConfigError: conf/ or an override names a key or an option that does not exist.
    """
    with (
        translate_errors(partial(ConfigError, " ".join(overrides) or "config", str(conf))),
        hydra.initialize_config_dir(str(conf.resolve()), version_base="1.3"),
    ):
        return OmegaConf.to_yaml(hydra.compose("config", overrides=overrides), resolve=True)


def difference(written: str, text: str) -> str:
    """A unified diff from params.yaml to what conf/ composes to; empty when they mean the same."""
    if yaml.safe_load(written) == yaml.safe_load(text):
        return ""
    lines = difflib.unified_diff(
        written.splitlines(True), text.splitlines(True), "params.yaml", "conf/ composed"
    )
    return "".join(lines)


def main(arguments: list[str] | None = None) -> None:
    """Command line: write params.yaml, or check that it is what conf/ composes to."""
    parser = argparse.ArgumentParser(prog="python -m pedpred.config", description=__doc__)
    parser.add_argument("--check", action="store_true", help="fail with a diff instead of writing")
    parser.add_argument("--stamp", type=Path, help="with --check: write this file when all is well")
    parser.add_argument("overrides", nargs="*", help="Hydra overrides, e.g. scale=smoke")
    given = parser.parse_args(arguments)
    params = Path("params.yaml")
    try:
        text = composed(Path("conf"), given.overrides)
    except ConfigError as error:
        sys.exit(f"\n{type(error).__name__}: {error}\n")
    if not given.check:
        write_text(params, text)
        return
    changes = difference(params.read_text() if params.exists() else "", text)
    if changes and "DVC_EXP_NAME" not in os.environ:  # `dvc exp run` has just composed params.yaml itself
        sys.exit(f"{changes}\nparams.yaml is not what conf/ composes to: run `make params`")
    if given.stamp:
        write_text(given.stamp, "params.yaml is what conf/ composes to\n")


if __name__ == "__main__":
    main()
