"""`make trust`: thousands of damaged files for every reader, each reader in a process of its own.

A case that is lost (a crash, a hang, too much memory, a foreign exception, an error that names no file) is
kept in build/trust/ with the command that repeats it.
"""

from __future__ import annotations

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
_PATIENCE_S = 120.0  # of the campaign with a child: starting, then one trial
_ROOM_BYTES = 6 * 2**30  # of addresses, beyond what the libraries have taken
_RESTARTS = 50
_MOST_KEPT = 20  # lost cases of a reader


def attempt(pipe: Connection, name: str, first: int, count: int) -> None:
    """The child: trials `first` to `count` of one reader; says seed, outcome and reason of each."""
    logging.disable(logging.CRITICAL)
    table = bench(name, READERS[name])
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + _ROOM_BYTES,) * 2)
    for seed in range(first, count):
        pipe.send((seed, *table.trial(seed)))


def outcomes(name: str, count: int) -> Iterator[tuple[int, str, str]]:
    """Seed, outcome and reason of every trial of a reader, whatever becomes of the children."""
    seed = 0
    for _ in range(_RESTARTS):
        here, there = multiprocessing.Pipe(duplex=False)
        child = multiprocessing.get_context("spawn").Process(
            target=attempt, args=(there, name, seed, count), daemon=True
        )
        child.start()
        there.close()
        try:
            while seed < count:
                if not here.poll(_PATIENCE_S):
                    raise TimeoutError(f"no answer for {_PATIENCE_S:g} s")
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
    """Put a lost case where it can be looked at and repeated."""
    folder = KEPT / f"{name}-{seed}"
    folder.mkdir(parents=True, exist_ok=True)
    file, raw = bench(name, READERS[name]).damaged(seed)
    (folder / Path(file).name).write_bytes(raw)
    (folder / "why.txt").write_text(f"{why}\n\npython -m tests.trust.campaign --replay {name} {seed}\n")


def campaign(names: Sequence[str], count: int, jobs: int) -> dict[str, Counter[str]]:
    """Every reader's outcomes, by kind."""
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
    """Attempts, what survived them, and what was lost."""
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
