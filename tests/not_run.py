"""The last line of a run of the tests: how many did not run, and why.

Reasons to skip begin with "needs"; what follows a colon says which: "needs recordings: ewap".
"""

from collections import Counter, defaultdict
from collections.abc import Iterable

import pytest


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_sessionfinish(session):
    """Write the line below everything else, also with several workers."""
    result = yield
    terminal, tests = session.config.pluginmanager.get_plugin("terminalreporter"), session.testscollected
    if terminal and tests and not session.config.option.collectonly:
        reports = [report for reports in terminal.stats.values() for report in reports]
        reached = {report.nodeid for report in reports if isinstance(report, pytest.TestReport)}
        reasons = [report.longrepr[2].removeprefix("Skipped: ") for report in terminal.getreports("skipped")]
        reasons += ["not reached"] * (tests - len(reached))  # the run was ended, or a worker was lost
        terminal.write_line(summary(reasons, tests))
    return result


def summary(reasons: Iterable[str], tests: int) -> str:
    """Sum up the reasons of all tests that did not run in one line, those of most tests first."""
    groups: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for reason in reasons:
        what, _, which = " ".join(reason.split()).partition(": ")
        groups[what][which] += 1
    causes = []
    for what, counts in sorted(groups.items(), key=lambda group: -group[1].total()):
        several = what.replace("needs ", "need ", 1) if counts.total() > 1 else what
        which = ", ".join(f"{one} {_spaced(count)}" for one, count in counts.most_common() if one)
        causes.append(f"{_spaced(counts.total())} {several}" + (f" ({which})" if which else ""))
    missing = sum(counts.total() for counts in groups.values())
    line = f"{_spaced(missing)} of {_spaced(tests)} tests did not run"
    return f"{line}: {'; '.join(causes)}" if causes else line


def _spaced(number: int) -> str:
    return f"{number:_}".replace("_", " ")
