"""Former place of `read_any`."""

from pedpred.command.conversion import convert, info
from pedpred.command.reading import read_any

__all__ = ["convert", "info", "read_any"]
