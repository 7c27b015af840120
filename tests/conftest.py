"""What all tests share."""

import os
from pathlib import Path

import pytest
import torch
import yaml
from hypothesis import settings

settings.register_profile("pedpred", deadline=None, derandomize=True)
settings.load_profile("pedpred")
torch.set_num_threads(1)  # the networks of the tests are too small to share

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def ewap_folder() -> Path:
    """The raw EWAP files, where the project would look for them; skips when they are nowhere."""
    folders = yaml.safe_load((ROOT / "conf/mirrors/ewap.yaml").read_text())["folders"]
    for place in (os.environ.get("PEDPRED_MIRROR"), *folders, "data/raw/ewap"):
        if place and (ROOT / place / "seq_hotel" / "obsmat.txt").exists():
            return ROOT / place
    pytest.skip("the EWAP recordings are not here: run `dvc repro fetch` or set PEDPRED_MIRROR")


@pytest.fixture(scope="session")
def model(tmp_path_factory):
    """An untrained network, exported; its folder, itself and its encoder."""
    from tests.exported import export

    return export(tmp_path_factory.mktemp("model"))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The pipeline's tests wait a lot: begun first, they wait beside the others."""
    items.sort(key=lambda item: item.get_closest_marker("pipeline") is None)
