"""The sources that terms were planned from last, for as long as there is room: they tell what an edit has changed.

They are kept by their digests, which terms keep too, so that undo and redo find them again.
"""

from __future__ import annotations

from collections import OrderedDict

from .sources import KeyedTransform

MOST_KEYS = 2**20
"""Of all that are kept: some 32 MB, hundreds of undo steps of an ordinary file."""


class _Sources(OrderedDict[int, KeyedTransform]):
    """Those used last come last; what is too much in keys is dropped."""

    size = 0

    def drop(self, digest: int) -> None:
        if (source := self.pop(digest, None)) is not None:
            self.size -= source.key_count


known = _Sources()


def cache_source(source: KeyedTransform) -> None:
    """Keep a source; those that were not used for longest go where there is no room."""
    known.drop(source.digest24)
    known[source.digest24] = source
    known.size += source.key_count
    while known.size > MOST_KEYS and len(known) > 1:
        known.drop(next(iter(known)))


def cached_source(digest: int | None) -> KeyedTransform | None:
    """Return the source with this digest, of 24 bits; None where it is not known any more."""
    return None if digest is None else known.get(digest)


def clear() -> None:
    """Forget the sources of a file that is no longer open."""
    known.clear()
    known.size = 0
