"""Decompression with a limit: a few damaged bytes may unpack to more than the memory holds."""

from __future__ import annotations

from io import BytesIO

from lz4.frame import LZ4FrameDecompressor
from zstandard import ZstdDecompressor

from pedpred.errors import shape_error

LARGEST_BYTES = 2**27
"""Limit of a chunk or message when unpacked; writers make chunks of some MiB, and the largest map has 64."""


def unpack(raw: bytes, compression: str) -> bytes:
    """Unpack a chunk or a message.

    Args:
        raw: compressed bytes.
        compression: lz4, zstd, or empty.

    Raises:
        ValueRuleError: they unpack to more than `LARGEST_BYTES`.
        Exception: they are damaged; see `pedpred.files.translate_errors`.
    """
    most = LARGEST_BYTES + 1
    if compression == "zstd":
        raw = ZstdDecompressor().stream_reader(BytesIO(raw)).read(most)
    elif compression == "lz4":
        raw = LZ4FrameDecompressor().decompress(raw, max_length=most)
    if len(raw) > LARGEST_BYTES:
        raise shape_error("chunk", (len(raw),), f"at most {LARGEST_BYTES} bytes")
    return raw
