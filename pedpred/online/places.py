"""What was learned at a place, as a file: a robot that starts again goes on with it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from pedpred.errors import InputError, ValueRuleError, brief
from pedpred.files import check_input, read_json, translate_errors, write_json
from pedpred.forecasting.postprocessing import PlaceKnowledge
from pedpred.online.network import digest_of

PLACE_SCHEMA = 3
_CHECKSUM = "sha256"
_REMEDY = "Delete it: it is learned again"


def write_place(path: Path, place: PlaceKnowledge, unused: Mapping[str, Any], network_sha256: str) -> None:
    """Write what was learned of a network's forecasts; see `pedpred.files.atomic_write`.

    Args:
        path: the file.
        place: what is used.
        unused: see `read_place`.
        network_sha256: checksum of the network.
    """
    learned = {name: unused.get(name) if value is None else value for name, value in place.plain().items()}
    about = {"schema": PLACE_SCHEMA, "network_sha256": network_sha256, **learned}
    write_json(path, about | {_CHECKSUM: digest_of(about)})


def read_place(
    path: Path, initial: PlaceKnowledge, network_sha256: str
) -> tuple[PlaceKnowledge, dict[str, Any]]:
    """Read what was learned of the forecasts of the same network.

    Args:
        path: the file.
        initial: before the first instant; what is None there is not used.
        network_sha256: checksum of the network.

    Returns:
        What is used; the rest of what was learned, as it stands in the file, to be written again.

    Raises:
        InputError: the file is missing, damaged or of another schema or network.
    """
    check_input(path, folder=False)
    wording = partial(InputError, path, "place", remedy=_REMEDY)
    about = read_json(path, wording)
    with translate_errors(wording):
        if about["schema"] != PLACE_SCHEMA:
            raise ValueRuleError("schema", brief(about["schema"]), f"it must be {PLACE_SCHEMA}")
        if about.pop(_CHECKSUM) != digest_of(about):
            raise ValueRuleError(_CHECKSUM, None, "the values are not those that were written")
        if about["network_sha256"] != network_sha256:
            rule = "it was learned of another network's forecasts"
            raise ValueRuleError("network_sha256", brief(about["network_sha256"]), rule)
        place = initial.restored(about)
        return place, {name: about[name] for name, value in place.plain().items() if value is None}
