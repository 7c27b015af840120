"""Formats of recordings, a module each: `NAME`, `recognises(head)` and `read(path, options)`."""
