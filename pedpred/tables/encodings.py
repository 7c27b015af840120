"""How text is encoded: UTF-8, UTF-16 with a mark, or Windows-1252 of programs in Western Europe."""

from __future__ import annotations

import codecs
import logging
from collections.abc import Iterator
from pathlib import Path

from pedpred.files import read_lines

UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
"""How texts in UTF-16 begin."""

_MARK = "\ufeff"
_HANDLER, _WINDOWS = "pedpred.western", "cp1252"
_log = logging.getLogger(__name__)


def decoded_lines(path: Path) -> Iterator[tuple[int, str]]:
    """Number (from 1) and content of each line that is not blank; see `read_lines`.

    Marks of UTF-8 at the beginning of lines, as where files were joined, are left out. Bytes that are not
    UTF-8 are read as Windows-1252, with a warning at the end.

    Args:
        path: a text; a byte order mark means UTF-16.

    Raises:
        OSError, UnicodeError, ShapeError: see `read_lines`.
    """
    with path.open("rb") as file:
        encoding = "utf-16" if file.read(2) in UTF_16 else "utf-8-sig"
    before = _western.count
    for number, line in read_lines(path, encoding, _HANDLER):
        text = line.removeprefix(_MARK)
        if text is line or not text.isspace():
            yield number, text
    if (count := _western.count - before) > 0:
        _log.warning("%s: not all of the text is UTF-8: %d bytes are read as Windows-1252", path, count)


class _Western:
    """Decodes bytes that are not UTF-8, and counts them."""

    def __init__(self) -> None:
        self.count = 0

    def __call__(self, error: UnicodeError) -> tuple[str, int]:
        if not isinstance(error, UnicodeDecodeError) or error.encoding != "utf-8":
            raise error
        text = error.object[error.start : error.end].decode(_WINDOWS)
        self.count += len(text)
        return text, error.end


_western = _Western()
codecs.register_error(_HANDLER, _western)
