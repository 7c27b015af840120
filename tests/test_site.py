"""The documentation as a site: it opens from disk, is searched there, and fits narrow and wide windows."""

import subprocess
import sys

import pytest

from tests.conftest import ROOT

PAGES = ("index.html", "recordings.html", "robot.html", "results.html", "data/eth.html", "api/online.html")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict", "--site-dir", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, env={"NO_MKDOCS_2_WARNING": "1"})
    return folder


def opened(browser, path):
    """A page from disk, without network; and what goes wrong."""
    page = browser.new_context(offline=True).new_page()
    problems = []
    page.on("console", lambda said: problems.append(said.text) if said.type == "error" else None)
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("request", lambda asked: None if asked.url.startswith("file:") else problems.append(asked.url))
    page.goto(path.as_uri())
    return page, problems


@pytest.mark.parametrize("start", ["index.html", "data/eth.html"])
def test_a_site_on_a_disk_is_searched(browser, site, start):
    page, problems = opened(browser, site / start)
    page.click("[data-md-component=search-query]")
    for words, found in (("nav2", "nav2"), ("costmap", "nav2"), ("frame id", "recordings")):
        page.keyboard.type(words)
        page.wait_for_selector(f".md-search-result__item a[href*='{found}.html']", state="attached")
        page.fill("[data-md-component=search-query]", "")
        page.wait_for_selector(".md-search-result__item", state="detached")
    assert problems == []
    page.context.close()


def test_on_a_phone_every_table_says_what_its_figures_are(browser, site):
    page, _ = opened(browser, site / "results.html")
    page.set_viewport_size({"width": 390, "height": 900})
    titles = "[...document.querySelectorAll('table:has(td[data-title]) th:first-child')]"
    shown = page.evaluate(f"{titles}.map((one) => one.offsetHeight > 0)")
    assert shown
    assert all(shown)
    page.context.close()


@pytest.mark.parametrize("name", PAGES)
def test_no_page_needs_sideways_scrolling(browser, site, name):
    page, problems = opened(browser, site / name)
    for width in (1280, 390):
        page.set_viewport_size({"width": width, "height": 900})
        assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert problems == []
    page.context.close()


def test_an_equation_within_a_sentence_stays_within_its_paragraph(browser, site):
    """Also at the start of a line."""
    page, _ = opened(browser, site / "method.html")
    inline = "[...document.querySelectorAll('math:not([display=block])')]"
    assert page.evaluate(f"{inline}.length") > 20
    assert page.evaluate(f"{inline}.filter((one) => !one.closest('p, li, td')).length") == 0
    page.context.close()
