"""Decompression with a limit: a few bytes may unpack to more than the memory holds."""

from __future__ import annotations

from bz2 import BZ2Decompressor
from collections.abc import Callable
from io import BytesIO

from lz4.frame import LZ4FrameDecompressor
from zstandard import ZstdDecompressor

from pedpred.errors import shape_error

LARGEST_CHUNK_BYTES = 2**27
"""Limit of a chunk or message when unpacked; writers make chunks of some MiB, and the largest map has 64."""

_DECOMPRESS: dict[str, Callable[[bytes, int], bytes]] = {
    "": lambda raw, most: raw,
    "lz4": lambda raw, most: LZ4FrameDecompressor().decompress(raw, max_length=most),
    "bz2": lambda raw, most: BZ2Decompressor().decompress(raw, max_length=most),
    "zstd": lambda raw, most: ZstdDecompressor().stream_reader(BytesIO(raw)).read(most),
}


def unpack(raw: bytes, compression: str) -> bytes:
    """Unpack bytes, whatever size they declare.

    Args:
        raw: compressed bytes.
        compression: lz4, bz2, zstd, or empty.

    Raises:
        ValueRuleError: they unpack to more than `LARGEST_CHUNK_BYTES`.
        Exception: they are damaged; see `pedpred.files.translate_errors`.
    """
    plain = _DECOMPRESS[compression](raw, LARGEST_CHUNK_BYTES + 1)
    if len(plain) > LARGEST_CHUNK_BYTES:
        raise shape_error("chunk", (len(plain),), f"at most {LARGEST_CHUNK_BYTES} bytes")
    return plain
