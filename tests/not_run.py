"""The last line of a run of the tests: how many did not run, and why."""

from collections import Counter
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
    counts = Counter(" ".join(reason.split()) for reason in reasons)
    causes = "; ".join(f"{count} {reason}" for reason, count in counts.most_common())
    line = f"{counts.total()} of {tests} tests did not run"
    return f"{line}: {causes}" if causes else line
