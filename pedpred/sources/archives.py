"""Tar archives of strangers: a member is written where the reader wants it, within bounds, or not at all."""

from __future__ import annotations

import shutil
import tarfile
from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import IO, cast

from tqdm import tqdm

_LARGEST_FILE_BYTES, _LARGEST_HEADER_BYTES = 2**24, 2**20


def unpack_members(stream: IO[bytes], size_bytes: int, names: Mapping[str, str], copy: Path) -> None:
    """Copy the named files out of a tar stream, whatever folder their paths begin in.

    A member is written under the requested name or not at all; paths in the archive are not used.

    Raises:
        tarfile.ExtractError: a member with an expected name is a link, leads outside or is huge.
    """
    with (
        tqdm.wrapattr(stream, "read", total=size_bytes or None, desc="fetch", disable=None) as counted,
        tarfile.open(fileobj=cast(IO[bytes], counted), mode="r|*", tarinfo=_Member) as archive,
    ):
        for member in archive:
            path = PurePosixPath(member.name)
            name = next((name for name, inside in names.items() if f"/{path}".endswith(f"/{inside}")), None)
            if name is None:
                continue
            if not member.isreg() or path.is_absolute() or ".." in path.parts:
                raise tarfile.ExtractError(f"member {member.name} is not a plain file inside the archive")
            if member.size > _LARGEST_FILE_BYTES:
                raise tarfile.ExtractError(f"member {member.name} has {member.size} bytes")
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            with (copy / name).open("wb") as file:
                shutil.copyfileobj(cast(IO[bytes], archive.extractfile(member)), file)


class _Member(tarfile.TarInfo):
    """A member whose further header, which is read into memory, has a bound."""

    @classmethod
    def frombuf(cls, buf: bytes | bytearray, encoding: str, errors: str) -> _Member:
        """Read a header block.

        Raises:
            tarfile.ReadError: it announces a huge further header.
        """
        member = super().frombuf(buf, encoding, errors)
        read_at_once = member.type in (*tarfile.GNU_TYPES, tarfile.XHDTYPE, tarfile.XGLTYPE)
        if member.type == tarfile.GNUTYPE_SPARSE or (read_at_once and member.size > _LARGEST_HEADER_BYTES):
            raise tarfile.ReadError(f"a header of {member.size} bytes and type {member.type!r}")
        return member
