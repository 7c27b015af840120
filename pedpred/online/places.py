"""What was learned at a place, as a file: a robot that starts again goes on with it."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from pedpred.errors import StorageError, ValueRuleError, brief
from pedpred.files import check_input, read_json, translate_errors, write_json
from pedpred.forecasting.chain import Place
from pedpred.online.network import digest_of

PLACE_SCHEMA = 1
_CHECKSUM = "sha256"
_REMEDY = "Delete it: it is learned again"


def write_place(path: Path, place: Place, network_sha256: str) -> None:
    """Write what was learned of a network's forecasts; see `pedpred.files.atomic_write`."""
    about = {"schema": PLACE_SCHEMA, "network_sha256": network_sha256, **place.plain()}
    write_json(path, about | {_CHECKSUM: digest_of(about)})


def read_place(path: Path, unlearned: Place, network_sha256: str) -> Place:
    """Read what was learned of the forecasts of the same network.

    Args:
        path: the file.
        unlearned: what has not learned yet.
        network_sha256: checksum of the network.

    Raises:
        StorageError: the file is missing, damaged or of another schema or network.
    """
    check_input(path, "place", StorageError, folder=False)
    wording = partial(StorageError, path, "place", remedy=_REMEDY)
    about = read_json(path, wording)
    with translate_errors(wording):
        if about["schema"] != PLACE_SCHEMA:
            raise ValueRuleError("schema", brief(about["schema"]), f"it must be {PLACE_SCHEMA}")
        if about.pop(_CHECKSUM) != digest_of(about):
            raise ValueRuleError(_CHECKSUM, None, "the values are not those that were written")
        if about["network_sha256"] != network_sha256:
            rule = "it was learned of another network's forecasts"
            raise ValueRuleError("network_sha256", brief(about["network_sha256"]), rule)
        return unlearned.relearned(about)
