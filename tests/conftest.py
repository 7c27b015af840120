"""What all tests share."""

import gc
import os
import shutil
from contextlib import suppress
from pathlib import Path

import pytest
import yaml
from hypothesis import settings

from pedpred.online import graph
from tests.not_run import pytest_sessionfinish as pytest_sessionfinish
from tests.plain_git import PLAIN_GIT

settings.register_profile("pedpred", deadline=None, derandomize=True)
settings.load_profile("pedpred")
with suppress(ImportError):  # a robot has no torch, see .ci/pythons
    import torch

    torch.set_num_threads(1)  # the networks of the tests are too small to share
graph._LOADED = {}  # networks stay, since tests load the same ones again and again
os.environ.setdefault("PEDPRED_JOBS", "1")  # and their sets smaller than what a worker takes to start

os.environ.update(PLAIN_GIT)


def pytest_collection_finish():
    """What has been imported and collected stays: the garbage collector need not look at it at each pass."""
    gc.collect()
    gc.freeze()


ROOT = Path(__file__).resolve().parents[1]


def raw_folder(data_set: str) -> Path:
    """The raw files of a data set, where the project would look for them; skips when they are nowhere."""
    about = yaml.safe_load((ROOT / f"conf/mirrors/{data_set}.yaml").read_text())
    names = [line.split()[1] for line in about["sha256sums"]]
    needed = [name for name in names if Path(name).name not in about["optional"]]
    for place in (os.environ.get("PEDPRED_MIRROR"), *about["folders"], f"data/raw/{data_set}"):
        if place and all((ROOT / place / name).exists() for name in needed):
            return ROOT / place
    pytest.skip(f"needs recordings in mirror/ or $PEDPRED_MIRROR: {data_set}")


with_ros = pytest.mark.skipif(not os.environ.get("PEDPRED_REQUIRE_ROS"), reason="needs `make ros`")
"""For tests that ROS takes part in, or definitions or tools that come with it."""


@pytest.fixture(scope="session")
def ewap_folder() -> Path:
    """The raw EWAP files."""
    return raw_folder("ewap")


@pytest.fixture(scope="session")
def laboratory_folder() -> Path:
    """The raw files of the laboratory recordings."""
    return raw_folder("juelich")


@pytest.fixture(scope="session")
def model(tmp_path_factory):
    """An untrained network, exported; its folder, itself and its encoder."""
    from tests.exported import export

    return export(tmp_path_factory.mktemp("model"))


@pytest.fixture(scope="session")
def mixture(tmp_path_factory):
    """The same of a network without memory, which needs no encoder."""
    from tests.exported import export_mixture

    return export_mixture(tmp_path_factory.mktemp("mixture"))


@pytest.fixture(scope="session")
def ros2():
    """Makes messages and bags of ROS 2."""
    from tests.bags import Store

    return Store()


@pytest.fixture(scope="session")
def browser():
    """A headless Chromium of this machine."""
    from playwright.sync_api import sync_playwright

    path = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if path is None and os.environ.get("PEDPRED_REQUIRE_CHROMIUM"):
        pytest.fail("Chromium is required here, but it is not installed")
    if path is None:
        pytest.skip("needs Chromium")
    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield opened
        opened.close()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Let modules with slow tests begin first: they wait beside others, and none of them ends alone."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)
