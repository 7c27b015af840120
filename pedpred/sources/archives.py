"""Extract named members of an untrusted tar archive, with size limits."""

from __future__ import annotations

import shutil
import tarfile
from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import IO, cast

from tqdm import tqdm

_LARGEST_FILE_BYTES = 2**24


def unpack_members(stream: IO[bytes], size_bytes: int, names: Mapping[str, str], copy: Path) -> None:
    """Copy the named files out of a tar stream, whatever folder their paths begin in.

    A member is written under the requested name or not at all; paths in the archive are not used.

    Raises:
        tarfile.ExtractError: a member with an expected name is a link, leads outside or is huge.
    """
    with (
        tqdm.wrapattr(stream, "read", total=size_bytes or None, desc="fetch", disable=None) as counted,
        tarfile.open(fileobj=cast(IO[bytes], counted), mode="r|*") as archive,
    ):
        for member in archive:
            path = PurePosixPath(member.name)
            name = next((name for name, inside in names.items() if f"/{path}".endswith(f"/{inside}")), None)
            if name is None:
                continue
            if not member.isreg() or member.issparse() or path.is_absolute() or ".." in path.parts:
                raise tarfile.ExtractError(f"member {member.name} is not a plain file inside the archive")
            if member.size > _LARGEST_FILE_BYTES:
                raise tarfile.ExtractError(f"member {member.name} has {member.size} bytes")
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            with (copy / name).open("wb") as file:
                shutil.copyfileobj(cast(IO[bytes], archive.extractfile(member)), file)
