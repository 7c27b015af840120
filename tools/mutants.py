"""Change equations in the core, one at a time, and run the tests: `python -m tools.mutants`.

Without arguments, all modules of `SCOPE` are changed, and reports/mutants.md is written. With files or
folders as arguments, the same table is printed for them. Results are kept in build/mutants, so that an
interrupted run continues where it was: a mutant is tried again when its function, or the test that failed,
has changed; a survivor when the tests that reach its function have.

pytest collects the tests once. Each mutant is a forked process, in which the code of one function is replaced
and the tests that reach this function run, the quickest first, until one fails. Loops are interpreted, not
compiled. A mutant that needs twice the processor time of its tests counts as killed.

mutmut does not change functions with decorators, as all compiled loops have; cosmic-ray starts Python, pytest
and torch again for each mutant, which takes a day.
"""

from __future__ import annotations

import argparse
import ast
import gc
import hashlib
import importlib
import json
import os
import signal
import sys
import threading
import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from types import CodeType, FrameType, FunctionType
from typing import Any

import pytest
import torch
import yaml
from tqdm import tqdm

from pedpred.errors import user_errors
from pedpred.files import check_input, write_text
from tools.altered import change_constant, change_functions, import_module, loaded_functions, place_of
from tools.arguments import count, in_project
from tools.forked import Job, run_forked
from tools.mutations import Mutation, constants, functions, mutations

SCOPE = (
    *("metrics", "forecasting", "evaluation", "tracking", "features", "models", "training"),
    *(
        "simulation/kernel.py",
        "simulation/physics.py",
        "driving/risk.py",
        "driving/planner.py",
        "driving/measures.py",
    ),
)
"""Folders and files of pedpred that are changed."""
TESTS = (
    *("comparison", "displacement", "evaluation", "features", "learning"),
    *("predictions", "regions", "selection", "tracking", "trust"),
    *("literature_study", "situations", "rows", "batch"),
)
"""Modules of tests that hold laws and values of the core, besides tests/by_hand."""
WORK, REPORT, REASONS = (
    Path("build/mutants"),
    Path("reports/mutants.md"),
    Path("tests/by_hand/survivors.yaml"),
)
BUDGET_S = 5.0
"""Processor time of the tests that a mutant has to survive; slower tests are left out."""
SLACK_S = 3.0
"""A mutant may need twice the time that its tests took under a profiler, and this besides."""
LONGEST_S = 3.0
"""Tests that take longer with interpreted loops are left out."""
IMPORTED_LATE = ("torch._dynamo", "torch.onnx", "sympy", "onnxruntime", "scipy.interpolate", "scipy.stats")
"""Modules that libraries import at a first call; each mutant would import them again."""
SURVIVED, KILLED, IMPOSSIBLE = range(3)
"""A change is impossible where the code is no longer valid, or where nothing reads the number again."""

Result = dict[str, Any]


@dataclass(frozen=True)
class Mutant:
    """One changed function, or constant, of a module.

    Attributes:
        path: of the module.
        name: qualified name of the function; of a constant its name.
        first_line: of the function, decorators included; 0 of a constant.
        mutation: the change.
        key: path, name and change.
        digest: of the function's source.
        tree: of the module.
    """

    path: str
    name: str
    first_line: int
    mutation: Mutation
    key: str
    digest: str
    tree: ast.Module


def mutants_of(paths: Iterable[Path]) -> list[Mutant]:
    """All changes of some modules."""
    found = []
    for path in paths:
        tree, seen = ast.parse(path.read_text()), Counter[str]()
        for name, node in [*functions(tree), *constants(tree)]:
            first = 0
            if isinstance(node, ast.FunctionDef):
                first = min([node.lineno, *(one.lineno for one in node.decorator_list)])
            for mutation in mutations(node):
                key = f"{path} {name}: {mutation.change}"
                seen[key] += 1
                key += f" (no. {seen[key]})" if seen[key] > 1 else ""
                found.append(Mutant(str(path), name, first, mutation, key, _digest(ast.dump(node)), tree))
    return found


class Trials:
    """A plugin of pytest that runs mutants instead of tests.

    Attributes:
        mutants: of the given modules.
        results: by key: status, digest of the function, digest of the tests, and the test that failed.
    """

    def __init__(self, paths: Sequence[Path], jobs: int):
        self._paths, self._jobs = paths, jobs
        self._failed: list[str] = []
        self.mutants: list[Mutant] = []
        self.results: dict[str, Result] = {}

    def pytest_collection(self) -> None:
        """Make hypothesis stop at the first failing example."""
        import hypothesis  # not before pytest, which rewrites its assertions

        phases = (hypothesis.Phase.explicit, hypothesis.Phase.generate)
        checks = list(hypothesis.HealthCheck)
        hypothesis.settings.register_profile("mutants", phases=phases, suppress_health_check=checks)
        hypothesis.settings.load_profile("mutants")

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Record what fails, or is skipped, in this process."""
        if not report.passed:
            self._failed.append(report.nodeid)

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Run each test once, then the mutants."""
        self._config: Any = session.config
        self._items = {item.nodeid: item for item in session.items}
        self.mutants = mutants_of(self._paths)
        for path in self._paths:
            import_module(path)
        for name in IMPORTED_LATE:
            importlib.import_module(name)
        loaded = loaded_functions()
        self._seconds, reaching = self._measure_tests()
        gc.collect()
        gc.freeze()
        kept, waiting = dict(_kept_results()), []
        for mutant in self.mutants:
            targets = loaded.get((mutant.path, mutant.name, mutant.first_line), [])
            chosen = self._choose(mutant, reaching)
            tests = _digest(*chosen, *map(_file_digest, sorted(set(map(_file, chosen)))))
            old = kept.get(mutant.key)
            if old and _is_valid(old, mutant, tests):
                self.results[mutant.key] = old
            else:
                waiting.append((mutant, targets, chosen, tests))
        self._try(waiting)
        session.testscollected = 0  # none of them was to be reported
        return True

    def _choose(self, mutant: Mutant, reaching: dict[Any, set[str]]) -> list[str]:
        """The tests that reach a function, the quickest first, within the budget."""
        found = set(reaching.get((mutant.path, mutant.name), ()))
        if not mutant.first_line:  # those of the functions that may read the constant
            found = set().union(*(tests for place, tests in reaching.items() if place[0] == mutant.path))
        chosen: list[str] = []
        spent_s = 0.0
        for nodeid in sorted(found, key=lambda one: (self._seconds[one], one)):
            spent_s += self._seconds[nodeid]
            if spent_s > BUDGET_S and chosen:
                break
            chosen.append(nodeid)
        return chosen

    def _measure_tests(self) -> tuple[dict[str, float], dict[Any, set[str]]]:
        """Seconds of each test, and the tests that reach each place; kept for each file of tests."""
        library = _digest(*(path.read_text() for path in sorted(Path("pedpred").rglob("*.py"))))
        files: dict[str, list[str]] = defaultdict(list)
        for nodeid in self._items:
            files[_file(nodeid)].append(nodeid)
        kept = {
            name: WORK / "reached" / library / f"{name.replace('/', '-')}-{_file_digest(name)}.json"
            for name in files
        }
        jobs = [
            Job(partial(self._measure, files[name], path), 1e6, name)
            for name, path in kept.items()
            if not path.exists()
        ]
        for name, status, _ in tqdm(
            run_forked(jobs, self._jobs, WORK / "tmp"),
            total=len(jobs),
            desc="tests, unchanged",
            unit="file",
            mininterval=2,
        ):
            if status:
                raise RuntimeError(f"{name}: the process of these tests ended with status {status}")
        seconds, reaching = {}, defaultdict(set)
        for path in kept.values():
            found = json.loads(path.read_text()) if path.exists() else {}
            for nodeid, (spent_s, places) in found.items():
                if nodeid in self._items:
                    seconds[nodeid] = spent_s
                    for place in places:
                        reaching[tuple(place)].add(nodeid)
        return seconds, reaching

    def _measure(self, nodeids: Sequence[str], kept: Path) -> tuple[int, str]:
        """Run the tests of a file, and keep what those reach that pass."""
        signal.signal(signal.SIGPROF, _too_long)
        root, called, found = str(Path.cwd()) + os.sep, set[CodeType](), {}

        def profile(frame: FrameType, event: str, _: Any) -> None:
            if event == "call" and frame.f_code.co_filename.startswith(root):
                called.add(frame.f_code)

        for nodeid in nodeids:
            called.clear()
            began_s = time.process_time()
            signal.setitimer(signal.ITIMER_PROF, LONGEST_S, LONGEST_S)
            threading.setprofile(profile)
            sys.setprofile(profile)
            try:
                failing = self._first_failing([nodeid])
            except (TimeoutError, Warning):  # while pytest was writing its report
                failing = nodeid
                self._items[nodeid].session._setupstate.teardown_exact(None)
            sys.setprofile(None)
            signal.setitimer(signal.ITIMER_PROF, 0)
            if not failing:
                found[nodeid] = time.process_time() - began_s, sorted(set(map(place_of, called)))
        write_text(kept, json.dumps(found))
        return 0, ""

    def _first_failing(self, nodeids: Sequence[str]) -> str:
        """Run tests until one fails."""
        self._config._tmp_path_factory._basetemp = Path(os.environ["TMPDIR"])
        for k, nodeid in enumerate(nodeids):
            item, after = self._items[nodeid], self._items[nodeids[k + 1]] if k + 1 < len(nodeids) else None
            self._failed.clear()
            item.ihook.pytest_runtest_protocol(item=item, nextitem=after)
            if self._failed:
                return nodeid
        return ""

    def _try(self, waiting: Sequence[Any]) -> None:
        jobs = []
        for mutant, targets, chosen, tests in waiting:
            seconds = SLACK_S + 2 * sum(self._seconds[nodeid] for nodeid in chosen)
            jobs.append(Job(partial(self._trial, mutant, targets, chosen), seconds, (mutant, tests)))
        quickest = sorted(self._seconds, key=lambda nodeid: self._seconds[nodeid])[:20]
        control = Job(lambda: (bool(self._first_failing(quickest)), ""), 600.0, None)
        WORK.mkdir(parents=True, exist_ok=True)
        bar, survived = tqdm(total=len(jobs), desc="mutants", unit="mutant", mininterval=2), 0
        for about, status, failing in run_forked([control, *jobs, control], self._jobs, WORK / "tmp"):
            if about is None:  # nothing was changed
                if status != SURVIVED:
                    raise RuntimeError(f"tests fail without a change: remove {WORK / 'results.jsonl'}")
                continue
            mutant, tests = about
            if status < 0:  # ended by a signal: it needed too much time, or crashed
                status = KILLED
            elif status > IMPOSSIBLE:
                status = IMPOSSIBLE
            result: Result = {"status": status, "digest": mutant.digest, "tests": tests}
            if failing:
                result |= {"by": failing, "by_digest": _file_digest(_file(failing))}
            self.results[mutant.key] = result
            with (WORK / "results.jsonl").open("a") as file:
                file.write(json.dumps({mutant.key: result}) + "\n")
            survived += status == SURVIVED
            bar.set_postfix_str(f"{survived} survived", refresh=False)
            bar.update()
        bar.close()

    def _trial(
        self, mutant: Mutant, targets: Sequence[FunctionType], chosen: Sequence[str]
    ) -> tuple[int, str]:
        if targets:
            possible = change_functions(mutant.tree, mutant.mutation, targets)
        else:
            possible = change_constant(mutant.tree, mutant.mutation, mutant.path, mutant.name)
        if not possible:
            return IMPOSSIBLE, ""
        failing = self._first_failing(chosen)
        return (KILLED if failing else SURVIVED), failing


def _too_long(*_: object) -> None:
    sys.setprofile(None)  # or the report of the failure would take too long as well
    raise TimeoutError


def _is_valid(old: Result, mutant: Mutant, tests: str) -> bool:
    """Whether an earlier result still holds."""
    if old["digest"] != mutant.digest or old["status"] == IMPOSSIBLE:
        return False
    if "by" in old:
        return bool(old["by_digest"] == _file_digest(_file(old["by"])))
    return bool(old["tests"] == tests)


def _kept_results() -> Iterator[tuple[str, Result]]:
    """Results of earlier runs; a line that an interruption cut is left out."""
    path = WORK / "results.jsonl"
    for line in path.read_text().splitlines() if path.exists() else ():
        with suppress(ValueError):
            yield from json.loads(line).items()


def _file(nodeid: str) -> str:
    return nodeid.split("::")[0]


@cache
def _file_digest(path: str) -> str:
    return _digest(Path(path).read_text() if Path(path).exists() else "")


def _digest(*texts: str) -> str:
    return hashlib.sha256("\n".join(texts).encode()).hexdigest()[:16]


_ABOUT = """# Wrong changes that a test notices

`make mutants` makes one wrong change at a time in the modules below and runs the tests that reach the changed
function. A test that fails kills the mutant. Checks of arguments (`raise`), text and logging are not changed.
Survivors have a reason: mostly the result is the same for all inputs, so that no test can notice the change.

| module | mutants | killed | share | explained | not explained |
| --- | ---: | ---: | ---: | ---: | ---: |
"""


def report(mutants: Sequence[Mutant], results: dict[str, Result], reasons: dict[str, str]) -> str:
    """A table of modules, and a list of survivors, as Markdown."""
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    survivors = []
    for mutant in mutants:
        status, why = results[mutant.key]["status"], reasons.get(mutant.key)
        found = "killed" if status == KILLED else "explained" if why else "unexplained"
        if status != IMPOSSIBLE:
            counts[mutant.path][found] += 1
            counts["all"][found] += 1
        if status == SURVIVED:
            survivors.append(f"* line {mutant.mutation.line}, `{mutant.key}`: {why or '**not explained**'}\n")
    rows = []
    for path, count_of in sorted(counts.items(), key=lambda row: row[0] == "all"):
        share = f"{count_of['killed'] / count_of.total():.1%}"
        numbers = count_of.total(), count_of["killed"], share, count_of["explained"], count_of["unexplained"]
        rows.append(f"| {path} | {' | '.join(map(str, numbers))} |\n")
    return _ABOUT + "".join(rows) + "\n## Survivors\n\n" + "".join(survivors)


@user_errors()
def main() -> None:
    """Try the mutants of some modules."""
    form = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(
        prog="python -m tools.mutants", description=__doc__, formatter_class=form
    )
    parser.add_argument("paths", nargs="*", type=Path, help="files and folders of pedpred (all of the core)")
    parser.add_argument("--tests", nargs="+", help="files of tests (those that hold the core's laws)")
    parser.add_argument("--jobs", type=count, default=os.cpu_count(), help="processes at once (%(default)s)")
    given = parser.parse_args()
    in_project(Path())
    for path in given.paths:
        check_input(path)
    folders = given.paths or [Path("pedpred") / part for part in SCOPE]
    paths = [path for one in folders for path in ([one] if one.suffix else sorted(one.rglob("*.py")))]
    tests = given.tests or ["tests/by_hand", *(f"tests/test_{name}.py" for name in TESTS)]
    os.environ["NUMBA_DISABLE_JIT"] = "1"
    torch.set_num_threads(1)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    trials = Trials(paths, given.jobs)
    numpy = ["-W", "ignore::RuntimeWarning"]  # interpreted loops warn where compiled ones do not
    pytest.main(["-q", "-s", "-p", "no:cacheprovider", *numpy, *tests], plugins=[trials])
    if not trials.mutants or len(trials.results) < len(trials.mutants):
        sys.exit("not all mutants were tried")
    reasons = yaml.safe_load(REASONS.read_text()) if REASONS.exists() else {}
    text = report(trials.mutants, trials.results, reasons or {})
    if not given.paths and not given.tests:
        write_text(REPORT, text)
    print(text)


if __name__ == "__main__":
    main()
