"""`make trust`: thousands of damaged files for every reader, each reader in a process of its own.

Failures (a crash, a hang, too much memory, another exception, an error that names no file) are kept in
build/trust/ with the command that repeats them.
"""

import argparse
import logging
import multiprocessing
import resource
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from multiprocessing.connection import Connection
from pathlib import Path

from tqdm import tqdm

from tests.trust.readers import READERS
from tests.trust.trial import LOST, READ, REFUSED, bench

KEPT = Path("build/trust")
_TIMEOUT_S = 120.0  # of a child: to start, then for each trial
_ADDRESS_BYTES = 6 * 2**30  # limit, beyond what the libraries have mapped
_RESTARTS = 50
_MOST_KEPT = 20  # failures of a reader


def attempt(pipe: Connection, name: str, first: int, count: int) -> None:
    """Run trials `first` to `count` of one reader in a child; send seed, outcome and reason of each."""
    logging.disable(logging.CRITICAL)
    table = bench(name, READERS[name])
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + _ADDRESS_BYTES,) * 2)
    for seed in range(first, count):
        pipe.send((seed, *table.trial(seed)))


def outcomes(name: str, count: int) -> Iterator[tuple[int, str, str]]:
    """Yield seed, outcome and reason of every trial of a reader; restart children that die."""
    seed = 0
    for _ in range(_RESTARTS):
        here, there = multiprocessing.Pipe(duplex=False)
        spawn, given = multiprocessing.get_context("spawn"), (there, name, seed, count)
        child = spawn.Process(target=attempt, args=given, daemon=True)
        child.start()
        there.close()
        try:
            while seed < count:
                if not here.poll(_TIMEOUT_S):
                    raise TimeoutError(f"no answer for {_TIMEOUT_S:g} s")
                yield here.recv()
                seed += 1
        except (EOFError, TimeoutError) as end:
            child.kill()
            child.join()
            yield seed, LOST, f"{end or 'the process died'} (exit code {child.exitcode})"
            seed += 1
        if seed >= count:
            child.join()
            return
    yield seed, LOST, f"given up after {_RESTARTS} dead processes"


def keep(name: str, seed: int, why: str) -> None:
    """Keep the file of a failure and the command that repeats it."""
    folder = KEPT / f"{name}-{seed}"
    folder.mkdir(parents=True, exist_ok=True)
    file, raw = bench(name, READERS[name]).damaged(seed)
    (folder / Path(file).name).write_bytes(raw)
    (folder / "why.txt").write_text(f"{why}\n\npython -m tests.trust.campaign --replay {name} {seed}\n")


def campaign(names: Sequence[str], count: int, jobs: int) -> dict[str, Counter[str]]:
    """Count the outcomes of every reader, by kind."""
    found = {name: Counter[str]() for name in names}

    def one(name: str, bar: tqdm) -> None:
        for seed, outcome, why in outcomes(name, count):
            found[name][outcome] += 1
            if outcome == LOST and found[name][LOST] <= _MOST_KEPT:
                keep(name, seed, why)
                bar.write(f"{name} {seed}: {why[:200]}")
            bar.update()

    with (
        tqdm(total=count * len(names), desc="damaged files", unit="file") as bar,
        ThreadPoolExecutor(jobs) as pool,
    ):
        list(pool.map(lambda name: one(name, bar), reversed(names)))  # the slow ones stand last
    return found


def markdown(found: dict[str, Counter[str]]) -> str:
    """Format a table of attempts, passes and failures."""
    rows = ["| reader | attempts | right or refused by name | lost |", "| --- | --: | --: | --: |"]
    total = sum(found.values(), Counter[str]())
    for name, kinds in [*found.items(), ("all", total)]:
        survived = kinds[READ] + kinds[REFUSED]
        rows.append(f"| {name} | {kinds.total()} | {survived} | {kinds[LOST]} |")
    return "\n".join(rows)


def main() -> None:
    """Run the campaign, or repeat one trial."""
    parser = argparse.ArgumentParser(prog="python -m tests.trust.campaign", description=__doc__)
    parser.add_argument("--attempts", type=int, default=10_000, help="damaged files per reader")
    parser.add_argument("--jobs", type=int, default=2, help="readers at a time")
    parser.add_argument("--readers", nargs="+", choices=READERS, default=list(READERS))
    parser.add_argument("--replay", nargs=2, metavar=("READER", "SEED"), help="repeat one trial")
    given = parser.parse_args()
    if given.replay:
        name, seed = given.replay[0], int(given.replay[1])
        sys.exit(": ".join(bench(name, READERS[name]).trial(seed)))
    found = campaign(given.readers, given.attempts, given.jobs)
    sys.stdout.write(f"\n{markdown(found)}\n")
    sys.exit(any(kinds[LOST] for kinds in found.values()))


if __name__ == "__main__":
    main()
