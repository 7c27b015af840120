"""From `conf/` to `params.yaml`, and from there to a stage: only the keys that it declares.

`python -m pedpred.config` writes params.yaml; `--check` fails with a diff when conf/ composes to something
else. Under DVC (which sets DVC_STAGE) a stage gets the values that DVC itself resolves for it; run by hand it
composes conf/ with the overrides on its command line.
"""

from __future__ import annotations

import argparse
import difflib
import functools
import hashlib
import inspect
import json
import logging
import os
import re
import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any, cast

import hydra
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import ConfigAttributeError, ConfigKeyError, OmegaConfBaseException

from pedpred.errors import ConfigError, InputError, ValueRuleError, user_errors
from pedpred.files import check_output, read_yaml, translate_errors, write_json, write_text
from pedpred.plain import parse_yaml

SETS = {"simulated": "simulations", "real": "places"}
"""Kinds of scene sets and the groups of rows that describe them."""

WRITTEN = (("data",), ("models",), ("reports",))
"""Folders of the project whose files stages write."""

OUTPUTS = ("out", "curve")
"""Arguments of stages that name a file or folder to write."""

SHARED = Path("data/config")
"""Parts of params.yaml that many stages read, a file each, which the stage `config` writes.
dvc.lock, which DVC reads and writes after every stage, would repeat their values in every entry."""

DECLARATIONS = Path("build/declarations.json")
"""What `declarations` found, which takes DVC two seconds, and the checksum of the files that it read."""

_KEEP = ". If `dvc exp` wrote what params.yaml has, and it is to stay, write it into conf/ first"

LOCK, KEPT = Path("dvc.lock"), Path("build/dvc.lock")
"""Checksums of all results: the file that DVC rewrites in place, and the copy that each stage makes first."""


def stage(*arguments: str) -> Callable[[Callable[[DictConfig], None]], Callable[[], None]]:
    """Turn `main(cfg)` into a stage's entry point.

    `cfg` is read-only and complete. Under DVC it holds only the keys that dvc.yaml declares for the running
    stage, so reading an undeclared key fails; by hand it is what conf/ composes to with the given Hydra
    overrides. A `PedpredError` ends the process with its message, without a traceback. A trial whose `out` is
    elsewhere writes its curve beside it unless `curve` says where.

    Args:
        arguments: what the stage reads of its command line beside `out`, which all stages have.
    """
    known = (*arguments, "out")

    def wrap(main: Callable[[DictConfig], None]) -> Callable[[], None]:
        root = Path(inspect.getfile(main)).resolve().parents[1]  # not DVC_ROOT: a queued run is a copy

        def run(cfg: DictConfig) -> None:
            address = os.environ.get("DVC_STAGE")
            logging.basicConfig(level=logging.INFO, format="%(name)s: %(message)s")
            with config_errors(address):
                if "curve" in known and "out" in cfg and "curve" not in cfg:
                    OmegaConf.update(cfg, "curve", f"{cfg.out}.tsv", force_add=True)
                OmegaConf.resolve(cfg)
                OmegaConf.set_struct(cfg, True)
                OmegaConf.set_readonly(cfg, True)
                for key in set(OUTPUTS) & set(cfg):
                    check_output(Path(str(cfg[key])), folder=None)
                main(cfg)

        @functools.wraps(main)
        def entry() -> None:
            address, given = os.environ.get("DVC_STAGE"), sys.argv[1:]
            if address:
                with config_errors(address):
                    keep_lock(root)
                    addressed = declared(root, address, given)
                run(addressed)
                return
            with config_errors():
                if {"-h", "--help"} & set(given):
                    script = Path(inspect.getfile(main)).stem
                    sys.stdout.write(_usage(script, known, inspect.getdoc(main) or ""))
                    return
                check_arguments(root / "conf", given, known)
            hydra.main(version_base="1.3", config_path=str(root / "conf"), config_name="config")(run)()

        return entry

    return wrap


@contextmanager
def config_errors(address: str | None = None) -> Iterator[None]:
    """End the process as `user_errors` does; messages name configuration keys and stages."""
    with user_errors():
        try:
            yield
        except OmegaConfBaseException as error:
            raise _about_key(error, address) from error
        except InputError as error:
            remedy = _remedy(error.path)
            said = f"{error.problem}{remedy}" if remedy else str(error)
            raise SystemExit(f"{type(error).__name__}: {said}") from error
        except FileNotFoundError as error:
            if error.filename is None:
                raise
            there = f"{error.filename}: there is no such file or folder"
            raise SystemExit(there + _remedy(Path(str(error.filename)))) from error


def _remedy(path: Path) -> str:
    """What to do about a file that a stage has written."""
    return ". `dvc repro` writes it again" if path.parts[:1] in WRITTEN else ""


def _usage(script: str, arguments: Iterable[str], purpose: str) -> str:
    """Word the help of a stage that is run by hand."""
    shown = " ".join(f"[+{name}=...]" for name in arguments)
    return (
        f"usage: python -m stages.{script} {shown} [KEY=VALUE ...]\n\n{purpose}\n\n"
        "KEY=VALUE changes the configuration of this run, such as scale=smoke; +out= writes elsewhere.\n"
        "`--cfg job` prints the configuration. `--multirun KEY=A,B` runs the stage once per value; give\n"
        "each run its folder, as in '+out=build/${training.main.lr}'. `--hydra-help` lists further options.\n"
    )


def check_arguments(conf: Path, overrides: list[str], known: Collection[str] = ()) -> None:
    """Refuse a misspelt `+argument=` or `+key.of.conf=`, which Hydra adds where nobody reads it.

    Args:
        conf: folder of the configuration.
        overrides: of the command line.
        known: arguments that are read.

    Raises:
        ConfigError: it is no argument that is read, and nothing in conf/.
    """
    added = r"^\+{1,2}((\w+)[.\w]*)=(.*)"
    for key, group, value in re.findall(added, "\n".join(overrides), re.MULTILINE):
        if key not in known and not (conf / group).exists():
            arguments = f"; arguments are {', '.join(known)}" if known else ""
            raise ConfigError(key, value, f"it is no argument and no key of conf/{arguments}")


def _about_key(error: OmegaConfBaseException, address: str | None) -> ConfigError:
    """Word an error of a configuration key; for one that is missing, name its neighbours or the remedy."""
    key = str(error.full_key)
    if not isinstance(error, ConfigAttributeError | ConfigKeyError):
        remedy = str(error)
    elif address:
        remedy = f"stage '{address}' reads it, but dvc.yaml does not declare it under its params"
    elif "." in key:
        remedy = f"there is no such key; there are {', '.join(map(str, error.parent_node or []))}"
    else:
        remedy = f"conf/ has no such key; if it is an argument of the stage, give it: +{key}=..."
    return ConfigError(key, None, remedy)


def read_params(root: Path) -> DictConfig:
    """Read the configuration in a project's params.yaml.

    Raises:
        ConfigError: the file is missing or damaged.
    """
    wording = partial(ConfigError, "params", str(file := root / "params.yaml"))
    if not file.exists():
        raise wording("there is no such file; run this in the project's folder, after `make params`")
    values = read_yaml(file, wording)
    with translate_errors(wording):
        return OmegaConf.create(values)


def read_table(file: str | Path) -> dict[str, Any]:
    """Read a file of conf/ that stages depend on as it is, since nobody overrides single values of it.

    Raises:
        ConfigError: the file is missing or damaged.
    """
    return read_yaml(Path(file), partial(ConfigError, Path(file).stem, str(file)))


def stage_key(cfg: DictConfig) -> str:
    """Return the set, place or network that the command's `+name=` says; a `ConfigError` without it."""
    if not cfg.get("name"):
        raise ConfigError("name", None, "give one, as in `python -m stages.simulate +name=main`")
    return str(cfg.name)


def one_of(key: str, name: str, known: Mapping[str, Any]) -> Any:
    """Return the entry that a configuration key names; a `ConfigError` if there is none."""
    if not isinstance(name, str) or name not in known:
        raise ConfigError(key, name, f"choose one of {', '.join(known)}")
    return known[name]


def plain(node: Mapping[str, Any]) -> dict[str, Any]:
    """Return a part of the configuration as an ordinary dictionary."""
    if not OmegaConf.is_config(node):
        return dict(node)
    return cast(dict[str, Any], OmegaConf.to_container(cast(DictConfig, node), resolve=True))


def part(cfg: Mapping[str, Any], *keys: str) -> dict[str, Any]:
    """Return a part of the configuration as `plain` does; a `ConfigError` if it is no mapping."""
    node: Any = cfg
    for key in keys:
        node = node[key]
    if not isinstance(node, Mapping):
        raise ConfigError(".".join(keys), node, "it must map names to values")
    return plain(node)


def row(cfg: Mapping[str, Any], group: str, name: str, above: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return a group's row, merged over the row that it names as its `base`; `above` are rows based on it."""
    if not isinstance(name, str) or name not in cfg[group]:
        raise ConfigError(group, name, f"no such row; there are {', '.join(cfg[group])}")
    if name in above:
        raise ConfigError(f"{group}.{name}.base", cfg[group][name]["base"], "a row cannot be its own base")
    changes = part(cfg, group, name)
    base = row(cfg, group, changes.pop("base"), (*above, name)) if "base" in changes else {}
    inside = [k for k, v in changes.items() if isinstance(v, dict) and isinstance(base.get(k), dict)]
    return base | changes | {k: base[k] | changes[k] for k in inside}


@contextmanager
def configured(key: str) -> Iterator[None]:
    """Turn errors of settings that are built inside into a `ConfigError` that names the key."""
    try:
        yield
    except OmegaConfBaseException:  # it names its key
        raise
    except ValueRuleError as error:
        raise ConfigError(f"{key}.{error.field}".rstrip("."), error.value, error.rule) from error
    except (TypeError, KeyError) as error:  # an argument of a settings class that is missing or unknown
        raise ConfigError(key, None, str(error)) from error


def keep_lock(root: Path) -> None:
    """Copy dvc.lock for `tools.mend_lock`, unless another `dvc repro` is writing it."""
    if (root / LOCK).exists() and (written := (root / LOCK).read_bytes()).endswith(b"\n"):
        write_text(root / KEPT, written.decode())  # a cut may be within a letter, but not before a line's end


def declared(root: Path, address: str, arguments: list[str]) -> DictConfig:
    """Return what a stage may see of params.yaml, with the `key=value` pairs of its command.

    Args:
        root: the project's folder.
        address: of the stage as DVC writes it, such as `simulate@main`.
        arguments: the command line of the stage.

    Raises:
        ConfigError: dvc.yaml has no such stage, a file is missing or damaged, or a declared key is missing.
    """
    params, seen = plain(read_params(root)), OmegaConf.create()
    known, stage_name = known_declarations(root), address.removeprefix("dvc.yaml:")
    if stage_name not in known:
        raise ConfigError("DVC_STAGE", address, f"dvc.yaml has no such stage; there are {', '.join(known)}")
    declaration = known[stage_name]
    for key in declaration["params"]:
        value: Any = params
        for name in key.split("."):
            if not isinstance(value, dict) or name not in value:
                raise ConfigError(key, None, "dvc.yaml declares it, but params.yaml does not have it")
            value = value[name]
        OmegaConf.update(seen, key, value, force_add=True)
    for name in declaration["parts"]:
        file = SHARED / f"{name}.yaml"
        if not (root / file).exists():
            raise ConfigError(name, str(file), "there is no such file; `dvc repro config` writes it")
        seen[name] = read_yaml(root / file, partial(ConfigError, name, str(file)))
    seen.merge_with_dotlist([a.lstrip("+") for a in arguments if "=" in a and not a.startswith("-")])
    return seen


def known_declarations(root: Path) -> dict[str, dict[str, list[str]]]:
    """Return `declarations` as they were found before, if no file has changed since."""
    read = [file.read_bytes() for file in (root / "params.yaml", *pipelines(root)) if file.exists()]
    checksum = hashlib.sha256(b"\0".join(read)).hexdigest()
    with suppress(OSError, ValueError, LookupError):
        found = json.loads((root / DECLARATIONS).read_text())
        if found["checksum"] == checksum:
            return cast(dict[str, dict[str, list[str]]], found["stages"])
    stages = declarations(root)
    write_json(root / DECLARATIONS, {"checksum": checksum, "stages": stages})
    return stages


def declarations(root: Path) -> dict[str, dict[str, list[str]]]:
    """Return what each stage declares: keys of params.yaml, and names of `SHARED` parts that it depends on.

    Args:
        root: the project's folder.

    Raises:
        ConfigError: DVC cannot load a pipeline.
    """
    from dvc import dvcfile, repo  # takes 0.3 s to import; other stages do without
    from dvc.dependency import ParamsDependency

    table: dict[str, dict[str, list[str]]] = {}
    wording = partial(ConfigError, "dvc.yaml", str(root))
    with translate_errors(wording), repo.Repo(str(root), uninitialized=True) as project:
        for path in pipelines(root):
            file = dvcfile.load_file(project, str(path))
            file.lockfile_contents = {}  # it is not needed, and another command may be writing it
            for name, each in file.stages.items():
                keys = [key for dep in each.deps if isinstance(dep, ParamsDependency) for key in dep.params]
                files = [Path(dep.def_path) for dep in each.deps if not isinstance(dep, ParamsDependency)]
                parts = [file.stem for file in files if file.parent == SHARED]
                prefix = "" if path.parent == root else f"{path.relative_to(root)}:"
                table[prefix + name] = {"params": keys, "parts": parts}
    return table


def pipelines(root: Path) -> list[Path]:
    """Return the files of a project that declare stages: the main one and those of studies."""
    return [root / "dvc.yaml", *sorted(root.glob("studies/*/dvc.yaml"))]


def composed(conf: Path, overrides: list[str]) -> str:
    """Compose `conf/` to YAML text with all references resolved.

    The text is byte for byte what `dvc exp run` writes, so experiments leave params.yaml unchanged.

    Raises:
        ConfigError: conf/ or an override names a key or an option that does not exist.
    """
    check_arguments(conf, overrides)
    with (
        translate_errors(partial(ConfigError, " ".join(overrides) or "config", str(conf))),
        hydra.initialize_config_dir(str(conf.resolve()), version_base="1.3"),
    ):
        return OmegaConf.to_yaml(hydra.compose("config", overrides=overrides), resolve=True)


def difference(params: Path, text: str) -> str:
    """A unified diff from params.yaml to what conf/ composes to; empty when they mean the same.

    Raises:
        ConfigError: the file is damaged.
    """
    with translate_errors(partial(ConfigError, "params", str(params))):
        written = params.read_text() if params.exists() else ""
        same = written == text or parse_yaml(written) == parse_yaml(text)
    both = written.splitlines(True), text.splitlines(True)
    return "" if same else "".join(difflib.unified_diff(*both, "params.yaml", "conf/ composed"))


def main(arguments: list[str] | None = None) -> None:
    """Command line: write params.yaml, or check that it is what conf/ composes to."""
    parser = argparse.ArgumentParser(prog="python -m pedpred.config", description=__doc__)
    parser.add_argument("--check", action="store_true", help="fail with a diff instead of writing")
    parser.add_argument("--stamp", type=Path, help="with --check: write this file when all is well")
    parser.add_argument("overrides", nargs="*", help="Hydra overrides, e.g. scale=smoke")
    options = parser.parse_args(arguments)
    with config_errors():
        text = composed(Path("conf"), options.overrides)
        if not options.check:
            write_text(Path("params.yaml"), text)
            return
        changes = difference(Path("params.yaml"), text)
    if changes and "DVC_EXP_NAME" not in os.environ:  # `dvc exp run` has just composed params.yaml itself
        sys.exit(f"{changes}\nparams.yaml is not what conf/ composes to: run `make params`{_KEEP}")
    if options.stamp:
        write_text(options.stamp, "params.yaml is what conf/ composes to\n")


if __name__ == "__main__":
    main()
