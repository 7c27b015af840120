"""An input that is not there is said to be not there: nothing is said of its content."""

from functools import partial
from pathlib import Path

import pandas as pd
import pytest

import pedpred
from pedpred.command.recordings import read_ground_at
from pedpred.errors import InputError
from pedpred.files import translate_errors
from pedpred.online.shipped import default_model
from pedpred.ros import read_bag

WALKS = pd.DataFrame({"time": [0.0, 0.4], "id": 1, "x": [0.0, 0.4], "y": 0.0})
PLACES = ("nowhere", "nowhere.yaml", "nowhere.png", "nowhere.wkt", "nowhere.json", "nowhere/model")


def load_place(path):
    pedpred.OnlinePredictor.load().load_place(path)


READERS = {
    "a map": read_ground_at,
    "a map of a table": lambda path: pedpred.predict(WALKS, path),
    "a model": pedpred.OnlinePredictor.load,
    "a model of a table": lambda path: pedpred.predict(WALKS, model=path),
    "what was learned at a place": load_place,
    "a bag": read_bag,
}


@pytest.mark.parametrize("read", READERS.values(), ids=READERS)
def test_what_is_not_there_is_said_to_be_not_there(read, tmp_path):
    for place in PLACES:
        with pytest.raises(InputError, match=r"there is no such (file|folder)") as refused:
            read(tmp_path / place)
        assert str(tmp_path / place) in str(refused.value)
        assert str(refused.value).endswith("Correct the name")


def test_a_file_that_a_reader_misses_is_said_to_be_missing(tmp_path):
    said = rf"scene: there is no such file or folder: {tmp_path}/none"
    with pytest.raises(InputError, match=said), translate_errors(partial(InputError, tmp_path, "scene")):
        (tmp_path / "none").read_bytes()


def test_a_folder_is_no_file_and_a_file_no_folder(tmp_path):
    with pytest.raises(InputError, match=r"it is a folder\. Name a file"):
        load_place(tmp_path)
    with pytest.raises(InputError, match=r"it is a file\. Name a folder"):
        pedpred.OnlinePredictor.load(Path(default_model()) / "model.json")
