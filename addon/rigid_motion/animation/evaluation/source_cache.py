"""The sources that terms were planned from last, for as long as there is room: they tell what an edit has changed.

They are kept by their digests, which terms keep too, so that undo and redo find them again.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import fields

import numpy as np

from .sources import Source

MOST_BYTES = 32 * 2**20
"""Hundreds of undo steps of an ordinary file."""


class _Sources(OrderedDict[int, Source]):
    """Those used last come last; what is too much in bytes is dropped."""

    size = 0

    def drop(self, digest: int) -> None:
        if (source := self.pop(digest, None)) is not None:
            self.size -= size_of(source)


known = _Sources()


def cache_source(source: Source) -> None:
    """Keep a source; those that were not used for longest go where there is no room."""
    known.drop(source.digest24)
    known[source.digest24] = source
    known.size += size_of(source)
    while known.size > MOST_BYTES and len(known) > 1:
        known.drop(next(iter(known)))


def cached_source(digest: int | None) -> Source | None:
    """Return the source with this digest, of 24 bits; None where it is not known any more."""
    return None if digest is None else known.get(digest)


def clear() -> None:
    """Forget the sources of a file that is no longer open."""
    known.clear()
    known.size = 0


def size_of(source: Source) -> int:
    """Return about how many bytes a source has."""
    # What is worked out of keys later comes and goes.
    arrays = (getattr(keys, field.name) for keys in source.curves for field in fields(keys))
    return sum(array.nbytes for array in arrays if isinstance(array, np.ndarray))
