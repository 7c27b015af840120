"""An XML parser that names lines in its errors and refuses document types, which could define entities."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from xml.parsers import expat

from pedpred.errors import brief
from pedpred.reading.errors import CORRECT, ContentError


class XmlParser:
    """Calls handlers for the elements of a file.

    Args:
        root: name that the outermost element must have.
        start: called with the name and the attributes of an element that begins.
        end: called with the name of an element that ends.
        remedy: what to do if the outermost element is another one.
    """

    def __init__(
        self,
        root: str,
        start: Callable[[str, Mapping[str, str]], None],
        end: Callable[[str], None],
        remedy: str = CORRECT,
    ):
        self._root, self._start, self._remedy = root, start, remedy
        self._parser = expat.ParserCreate()
        self._parser.StartElementHandler = self._check_root
        self._parser.EndElementHandler = end
        self._parser.StartDoctypeDeclHandler = self._refuse_doctype

    def feed(self, raw: bytes, final: bool = False) -> int:
        """Parse a piece of the file, and return the position of the last element in bytes.

        Raises:
            ContentError: the outermost element is another one, or the file has a document type.
            xml.parsers.expat.ExpatError: it is no XML.
        """
        self._parser.Parse(raw, final)
        return self._parser.CurrentByteIndex

    def problem(self, text: str, remedy: str = CORRECT) -> ContentError:
        """An error in the present line."""
        return ContentError(text, remedy, self._parser.CurrentLineNumber)

    def _check_root(self, name: str, attributes: Mapping[str, str]) -> None:
        if name != self._root:
            found = brief(name)[1:-1]
            raise self.problem(f"the outermost element is <{found}>, expected <{self._root}>", self._remedy)
        self._parser.StartElementHandler = self._start
        self._start(name, attributes)

    def _refuse_doctype(self, *_: object) -> None:
        raise self.problem("a document type, which could define entities", "Remove the line <!DOCTYPE ...>")
