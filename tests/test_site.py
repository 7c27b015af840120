"""The documentation as a site: it opens and is searched from disk, and fits narrow and wide windows."""

import subprocess
import sys

import pytest

from tests.conftest import ROOT

PAGES = ("index.html", "recordings.html", "robot.html", "results.html", "data/real.html", "api/index.html")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict", "--site-dir", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, env={"NO_MKDOCS_2_WARNING": "1"})
    return folder


@pytest.mark.slow
def test_pages_fit_windows_and_are_searched_without_network(browser, site):
    page = browser.new_context(offline=True).new_page()
    problems = []
    page.on("console", lambda message: problems.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: problems.append(str(error)))
    for name in PAGES:
        for width in (1280, 390):
            page.set_viewport_size({"width": width, "height": 900})
            page.goto((site / name).as_uri())
            assert page.evaluate("document.documentElement.scrollWidth") <= width, name
    page.set_viewport_size({"width": 1280, "height": 900})
    page.goto((site / PAGES[0]).as_uri())
    page.click("[data-md-component=search-query]")
    page.keyboard.type("costmap")
    page.wait_for_selector(".md-search-result__item a[href*='nav2.html']", state="attached")
    assert problems == []
    page.context.close()
