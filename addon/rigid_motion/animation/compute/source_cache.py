"""The sources that slots were filled in from last, for as long as there is room: they tell what an edit has changed.

They are kept by their digests, which the Actions keep too, so that undo and redo find them again.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from dataclasses import fields

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
    # What is worked out of keys later comes and goes.
    arrays = (getattr(keys, field.name) for keys in source.curves for field in fields(keys))
    return sum(array.nbytes for array in arrays if isinstance(array, np.ndarray))


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
    before, after = _numbers(old), _numbers(new)
    if before.tobytes() == after.tobytes():
        return np.inf, -np.inf
    if (len(before), before.shape[2]) != (len(after), after.shape[2]):
        return None
    count = min(before.shape[1], after.shape[1])
    from_start, from_end = (
        (before[:, part] != after[:, part]).any(axis=(0, 2)) for part in (slice(0, count), slice(-count, None))
    )
    leading = int(from_start.argmax()) if from_start.any() else count
    trailing = int(from_end[::-1].argmax()) if from_end.any() else count
    trailing = min(trailing, count - leading)
    return (
        float(new.times[leading - 1]) if leading else -np.inf,
        float(new.times[len(new.times) - trailing]) if trailing else np.inf,
    )


def _numbers(keys: Keys) -> np.ndarray:
    """Return all there is to n keys of c channels, shape (c, n, numbers)."""
    arrays = [keys.points, keys.left, keys.right, keys.interpolation[..., None]]
    if keys.easing is not None:
        arrays += [keys.easing[..., None], np.moveaxis(keys.easing_settings, 0, 2)]
    return np.concatenate([array for array in arrays if array is not None], axis=2)
