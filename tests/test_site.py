"""The documentation as a site: it opens and is searched from disk, and fits narrow and wide windows."""

import subprocess
import sys

import pytest

from tests.conftest import ROOT

PAGES = ("recordings.html", "results.html", "data/real.html", "api/index.html", "index.html")


@pytest.mark.slow
def test_pages_fit_windows_and_are_searched_without_network(browser, tmp_path):
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path)]
    subprocess.run(command, cwd=ROOT, check=True, env={"NO_MKDOCS_2_WARNING": "1"})
    page, problems = browser.new_context(offline=True).new_page(), []
    page.on("console", lambda message: problems.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: problems.append(str(error)))
    for name in PAGES:
        for width in (390, 1280):
            page.set_viewport_size({"width": width, "height": 900})
            page.goto((tmp_path / name).as_uri())
            assert page.evaluate("document.documentElement.scrollWidth") <= width, name
    page.click("[data-md-component=search-query]")
    page.keyboard.type("costmap")
    page.wait_for_selector(".md-search-result__item a[href*='nav2.html']", state="attached")
    assert problems == []
    page.context.close()
