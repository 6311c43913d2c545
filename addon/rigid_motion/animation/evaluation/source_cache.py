"""Cache of the sources that terms were last planned from: comparing with them tells what an edit has changed.

Sources are stored by digest, which terms store, too, so undo and redo find them again. The cache has limited room.
"""

from __future__ import annotations

from collections import OrderedDict

from .sources import KeyedTransform

MOST_KEYS = 2**20
"""The largest total number of keys in the cache: about 32 MB, or hundreds of undo steps of an ordinary file."""


class _Sources(OrderedDict[int, KeyedTransform]):
    """Sources by digest, the most recently used last, with their total number of keys."""

    size = 0

    def drop(self, digest: int) -> None:
        if (source := self.pop(digest, None)) is not None:
            self.size -= source.key_count


known = _Sources()


def cache_source(source: KeyedTransform) -> None:
    """Add a source to the cache, dropping the least recently used ones if there is no room."""
    known.drop(source.digest24)
    known[source.digest24] = source
    known.size += source.key_count
    while known.size > MOST_KEYS and len(known) > 1:
        known.drop(next(iter(known)))


def cached_source(digest: int | None) -> KeyedTransform | None:
    """Return the source with this 24-bit digest; None if it is no longer cached."""
    return None if digest is None else known.get(digest)


def clear() -> None:
    """Forget the sources of a file that has been closed."""
    known.clear()
    known.size = 0
