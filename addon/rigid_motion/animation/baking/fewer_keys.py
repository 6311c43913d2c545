"""Sources with fewer keys, and the moments at which their error is checked.

The few keys are poses: all channels have keys on the same frames, with the values of the recording. Frames are those of
the Action.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...gltf.errors import PARTS_PER_GAP
from ..actions.slots import Binding
from ..evaluation.components import MODE_NUMBERS, PART_OF, ROWS, SCALE
from ..evaluation.marks import without
from ..evaluation.sources import SAME_FRAME, KeyedTransform, distinct
from ..fcurves.keys import CODE, CONSTANT, LINEAR, Keys
from ..transforms import Refused, Transform
from .motions import SINGLE_PRECISION_RATIO, continuous_values


class NeedsItsKeys(Refused):
    """Raised if no more keys can be removed within the tolerance."""


@dataclass(frozen=True)
class WholeRig:
    """The result for all bones of a rig that were reduced together. Lengths are in the scene's units."""

    frames: int
    """The number of frames on which any bone still has keys."""

    slide_before: float
    """The distance that standing bones slid on the ground in the recording."""

    slide_after: float
    not_promised: Sequence[str]
    """The names of the bones for which the tolerance is not guaranteed."""


class FewerKeys(NamedTuple):
    """The planned fewer keys of one slot, and its present ones."""

    binding: Binding
    source: KeyedTransform
    fewer: KeyedTransform
    largest_error: float
    """In the scene's units. For a rig, over all bones, with and without keys, except those not guaranteed."""

    rig: WholeRig | None = None
    """The result for the whole rig, if the transform is a rig or one of its bones."""

    between: float = 0.0
    """The largest error between frames, for curves that keep to the tolerance only on frames."""

    @property
    def after(self) -> int:
        """The number of frames with keys after the reduction."""
        return count_of(self.fewer)


def count_of(source: KeyedTransform) -> int:
    """Return the number of frames on which a source has keys."""
    return len(distinct(source.keyed_frames))


def united(frames: Iterable[np.ndarray]) -> np.ndarray:
    """Return the union of all frames; frames so close that Blender takes them for one count once."""
    return distinct(np.unique(np.concatenate(list(frames))))


def samples_of(source: KeyedTransform) -> np.ndarray:
    """Return the frames that keys may be on: those of the source's keys, and whole frames between them."""
    keys = distinct(source.keyed_frames)
    whole = np.arange(np.ceil(keys[0]), np.floor(keys[-1]) + 1.0)
    return np.union1d(keys, without(whole, keys))


def seen_frames(frames: np.ndarray, sources: Sequence[KeyedTransform]) -> np.ndarray:
    """Return these frames and all visible whole frames: between them, and outside of keys if motion goes on there."""
    first, last = min(source.seen_range[0] for source in sources), max(source.seen_range[1] for source in sources)
    return np.union1d(frames, np.arange(np.floor(first), np.ceil(last) + 1.0))


def moments(frames: np.ndarray, sources: Sequence[KeyedTransform]) -> np.ndarray:
    """Return these frames and the moments to check between them: eighths of frames, and moments just before jumps."""
    jumps = [
        keys.times[1:][(keys.interpolation[:, :-1] == CONSTANT).any(axis=0)] - 2.0 * SAME_FRAME
        for source in sources
        for keys in source.curves
    ]
    eighths = np.arange(np.floor(frames[0]) * PARTS_PER_GAP, np.ceil(frames[-1]) * PARTS_PER_GAP + 1.0) / PARTS_PER_GAP
    more = np.concatenate((eighths, *jumps))
    return np.union1d(frames, without(more[(more > frames[0]) & (more < frames[-1])], frames))


def values_on(transform: Transform, source: KeyedTransform, frames: np.ndarray) -> dict[int, np.ndarray]:
    """Return the values, each (n,), on rising frames of the channels to be re-keyed, by the rows of components."""
    values, keyed = continuous_values(source, frames), {row for rows, _ in source.channels for row in rows}
    rows = [row for row in transform.channels if PART_OF[row] in source.keyed]
    if has_uneven_scale(source):
        rows = [row for row in rows if PART_OF[row] != SCALE]
    return {row: values[row] for row in rows if row in keyed or not is_constant(values[row])}


def has_uneven_scale(source: KeyedTransform) -> bool:
    """Return whether the keyed scale changes and differs from axis to axis."""
    if SCALE not in source.keyed or source.uniform_scale:
        return False
    return not np.all(is_constant(source.values_at(source.keyed_frames)[ROWS[SCALE]].T))


def is_constant(columns: np.ndarray) -> np.ndarray:
    """Return whether values (n, ...) stay constant, shape (...)."""
    return np.ptp(columns, axis=0) <= SINGLE_PRECISION_RATIO * np.maximum(np.abs(columns).max(axis=0), 1.0)


def with_keys(source: KeyedTransform, frames: np.ndarray, values: dict[int, np.ndarray], mode: str) -> KeyedTransform:
    """Return the source with only these keys in the channels that have values. Interpolation is linear between them, or
    constant where all channels were held.
    """
    codes = _interpolations(source, frames)
    old = {row: keys for keyed_rows, keys in source.channels for row in keyed_rows}
    alike: dict[tuple, list[int]] = {}
    for row in values:
        alike.setdefault((old[row].linear, old[row].cycles) if row in old else (False, None), []).append(row)
    channels = []
    for (linear, cycles), rows in alike.items():
        points = np.empty((len(rows), len(frames), 2), np.float32)
        points[..., 0], points[..., 1] = frames, [values[row] for row in rows]
        channels.append((rows, Keys(points, np.tile(codes, (len(rows), 1)), linear=linear, cycles=cycles)))
    for keyed_rows, keys in source.channels:
        indices = [index for index, row in enumerate(keyed_rows) if row not in values]
        if indices:
            channels.append(([keyed_rows[index] for index in indices], keys.only(indices)))
    rest = {row: value for row, value in source.rest.items() if row not in values}
    return replace(source, channels=tuple(channels), rest=rest, mode=MODE_NUMBERS[mode], turns=None)


def _interpolations(source: KeyedTransform, frames: np.ndarray) -> np.ndarray:
    """Return interpolation codes for keys on these frames, shape (k,): CONSTANT if all channels hold until the next."""
    codes = np.full(len(frames), LINEAR, CODE)
    keys, moving = source.key_frames, np.append(0, np.cumsum(~source.holds))
    begins = np.searchsorted(keys, frames[:-1] + SAME_FRAME, side="right") - 1
    ends = np.searchsorted(keys, frames[1:] - SAME_FRAME)
    codes[:-1][moving[np.clip(begins, 0, None)] == moving[np.clip(ends, None, len(keys) - 1)]] = CONSTANT
    return codes
