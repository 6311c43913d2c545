"""The sources that slots were filled in from last, for as long as there is room: they tell what an edit has changed.

They are kept by their digests, which the Actions keep too, so that undo and redo find them again.
"""

from __future__ import annotations

import math
from collections import OrderedDict

import numpy as np

from ..curves.keys import Keys
from .sources import Source

MOST_BYTES = 32 * 2**20
"""Hundreds of undo steps of an ordinary file."""


class _Sources(OrderedDict[str, Source]):
    """Those used last come last; what is too much in bytes is dropped."""

    size = 0

    def drop(self, digest: str) -> None:
        if (source := self.pop(digest, None)) is not None:
            self.size -= size_of(source)


known = _Sources()


def cache_source(source: Source) -> None:
    """Keep a source; those that were not used for longest go where there is no room."""
    known.drop(source.digest)
    known[source.digest] = source
    known.size += size_of(source)
    while known.size > MOST_BYTES and len(known) > 1:
        known.drop(next(iter(known)))


def cached_source(digest: str) -> Source | None:
    """Return the source with this digest, None where it is not known any more."""
    return known.get(digest)


def clear() -> None:
    """Forget the sources of a file that is no longer open."""
    known.clear()
    known.size = 0


def size_of(source: Source) -> int:
    """Return about how many bytes a source has."""
    return sum(len(keys.raw) for keys in source.curves)


def changed_range(old: Source, new: Source) -> tuple[int, int] | None:
    """Return the whole frames on which in-betweens may have changed from one source to the next, of the same transform.

    None where it may be all of them.
    """
    alike = (
        (old.order, old.keyed, old.in_nla, old.frame_range, old.uniform_scale, old.driven, old.influence)
        == (new.order, new.keyed, new.in_nla, new.frame_range, new.uniform_scale, new.driven, new.influence)
        and not (old.goes_on or new.goes_on)
        and not (old.passed.any() or new.passed.any())
        and old.settings == new.settings
        and [rows for rows, _ in old.channels] == [rows for rows, _ in new.channels]
    )
    if not alike:
        return None
    ranges = [_changed(one, other) for one, other in zip(old.curves, new.curves, strict=True)]
    if None in ranges:
        return None
    first, last = min(first for first, _ in ranges), max(last for _, last in ranges)
    if first > last:
        return None
    # Progress is what all channels make of it together, from key to key of any of them; smooth modes look one key on.
    margin = 1 if new.is_smooth else 0
    ends = []
    for source in (old, new):
        keys = source.key_frames
        before = int(keys.searchsorted(first, side="right")) - 1 - margin
        behind = int(keys.searchsorted(last)) + margin
        ends.append((keys[max(before, 0)], keys[min(behind, len(keys) - 1)]))
    begin, end = new.frame_range
    first = min(max(math.floor(min(first for first, _ in ends)), begin), end)
    return first, max(first, min(math.ceil(max(last for _, last in ends)), end))


def _changed(old: Keys, new: Keys) -> tuple[float, float] | None:
    """Return from which frame on and up to which channels may have changed.

    These are the nearest keys before and behind that are the same; (inf, -inf) where all are, None where there is no
    telling.
    """
    if old.raw == new.raw:
        return np.inf, -np.inf
    before, after = _by_key(old), _by_key(new)
    if before.shape[1] != after.shape[1]:
        return None
    count = min(len(before), len(after))
    leading, trailing = (
        int(np.argmin(np.append((before[part] == after[part]).all(axis=1)[::step], False)))
        for part, step in ((slice(0, count), 1), (slice(-count, None), -1))
    )
    trailing = min(trailing, count - leading)
    return (
        float(new.times[leading - 1]) if leading else -np.inf,
        float(new.times[len(new.times) - trailing]) if trailing else np.inf,
    )


def _by_key(keys: Keys) -> np.ndarray:
    """Return all there is to each of n keys as bytes, shape (n, bytes)."""
    parts = [part for part in (keys.points, keys.left, keys.right) if part is not None]
    rows = [part.swapaxes(0, 1) for part in (*parts, keys.interpolation)]
    if keys.easing is not None:
        rows += [keys.easing.T, np.moveaxis(keys.easing_settings, 2, 0)]
    return np.concatenate([np.ascontiguousarray(row).reshape(len(row), -1).view(np.uint8) for row in rows], axis=1)
