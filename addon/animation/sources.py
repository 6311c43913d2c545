"""What the animator keyed: the location, rotation, scale and mode channels of one slot, as arrays.

A source is read, never written. Its digest tells whether anything changed that in-betweens depend on. Frames are those
of the Action; values are in the channels' own units.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..motion import KEYFRAME_MODES
from .curves import BEZIER, CONSTANT, ELASTIC, LINEAR, Keys, cycled, cyclic_times, evaluate

MODE_IDS = ("BLENDER", *KEYFRAME_MODES)
"""What the values of the mode channel stand for: Blender's own in-betweens, and then the modes in their order."""

UNKNOWN = -1
"""The mode of an object from a file that is damaged, or of a later version."""

LOCATION, ROTATION, SCALE = "location", "rotation", "scale"
ROWS = {LOCATION: slice(0, 3), ROTATION: slice(3, 7), SCALE: slice(7, 10)}
"""Where the components of each are, in arrays with a row for each of the ten. Euler angles leave row 6 alone."""

PART_OF = tuple(name for name, own in ROWS.items() for _ in range(own.start, own.stop))
"""Of which of them each row is a component."""

REST = np.array((0, 0, 0, 1, 0, 0, 0, 1, 1, 1), dtype=np.float64)
"""The components of something that is not moved. Rotations are quaternions where they are not channels."""

SAME_FRAME = 0.01
"""Keys closer than this are one key to Blender, and here."""


def distinct(frames: np.ndarray) -> np.ndarray:
    """Rising frames of keys, those that are one key to Blender once."""
    return frames[np.diff(frames, prepend=-np.inf) > SAME_FRAME]


@dataclass(frozen=True, eq=False)
class Source:
    """The keys of one slot, and the values that what it does not key rests at."""

    order: str | None
    """The order of Euler angles, or None for quaternions."""

    keyed: frozenset[str]
    """Which of location, rotation and scale are keyed, in one of their components at least."""

    channels: tuple[tuple[list[int], Keys], ...]
    """The channels with keys, those together that are keyed together: their rows among the components, and keys."""

    rest: dict[int, float]
    """The values of components that have no keys, of what is keyed, by their rows."""

    own: np.ndarray
    """The delta transforms that the object has of its own, as components, shape (10,)."""

    mode: int | Keys
    """The mode of all segments, as `MODE_IDS` counts them, or the mode channel."""

    span: tuple[int, int] | None
    """First and last frame of the scenes it is in, where something goes on outside of the keys."""

    @cached_property
    def digest(self) -> str:
        """Differs wherever anything differs that the in-betweens depend on."""
        summary = hashlib.blake2b(digest_size=16)
        for rows, keys in self.channels:
            summary.update(bytes(rows))
            summary.update(keys.raw)
        if self.rest:
            summary.update(repr(self.rest).encode())
        summary.update(self.own.tobytes())
        summary.update(self.mode.raw if isinstance(self.mode, Keys) else b"%d" % self.mode)
        summary.update(repr((self.order, self.span)).encode())
        return summary.hexdigest()

    @property
    def curves(self) -> list[Keys]:
        """The keys of all channels that have any."""
        return [keys for _, keys in self.channels]

    @property
    def key_count(self) -> int:
        """How many keys its channels have."""
        return sum(keys.interpolation.size for keys in self.curves)

    @property
    def is_together(self) -> bool:
        """Whether all channels have their keys on the same frames, and go through them once."""
        return len(self.channels) == 1 and self.cyclic is None

    @cached_property
    def keyed_frames(self) -> np.ndarray:
        """Where any of the channels has a key of the animator's, shape (k,)."""
        return np.unique(np.concatenate([keys.times for keys in self.curves]))

    @cached_property
    def key_frames(self) -> np.ndarray:
        """The same without keys that are one to Blender, and with the copies that cycles make in the span, (n,)."""
        if self.is_together:
            return self.curves[0].times
        times = [keys.times for keys in self.curves]
        if self.cyclic is not None:
            # A whole round more on both sides, for the span may begin and end in the middle of a segment.
            margin = max(own[-1] - own[0] for own in times)
            first = min(self.span[0], *(own[0] for own in times)) - margin
            last = max(self.span[1], *(own[-1] for own in times)) + margin
            times = [cyclic_times(keys, keys.times, first, last) for keys in self.curves]
        frames = np.unique(np.concatenate(times))
        return distinct(frames)

    @cached_property
    def modes(self) -> np.ndarray:
        """The mode of each segment, as `MODE_IDS` counts them, shape (n - 1,)."""
        # A moment into the segment; in a copy that runs backwards that is a moment before its original's end.
        starts = self.key_frames[:-1] + SAME_FRAME
        return self.modes_at(starts if self.cyclic is None else cycled(self.cyclic, starts)[0])

    def modes_at(self, frames: np.ndarray) -> np.ndarray:
        """The modes at these frames, as `MODE_IDS` counts them: each key of the mode channel holds until the next."""
        if not isinstance(self.mode, Keys):
            return np.full(len(frames), self.mode)
        modes = self.mode.values[0, np.clip(np.searchsorted(self.mode.times, frames, side="right") - 1, 0, None)]
        return np.rint(modes).astype(int)

    @property
    def is_live(self) -> bool:
        """Whether there is a segment that is to be filled in otherwise than Blender does."""
        moved = bool(np.any(self.modes)) if isinstance(self.mode, Keys) else self.mode != 0
        return moved and len(self.curves) > 0 and len(self.key_frames) > 1

    @cached_property
    def frame_range(self) -> tuple[int, int]:
        """The first and last whole frame that in-betweens are for."""
        first, last = self.span or (np.inf, -np.inf)
        first = min(first, *(float(keys.times[0]) for keys in self.curves))
        last = max(last, *(float(keys.times[-1]) for keys in self.curves))
        return math.floor(first), math.ceil(last)

    @cached_property
    def uniform_scale(self) -> bool:
        """Whether the scale is animated, and at every key the same along all axes and positive. Else Blender scales."""
        if SCALE not in self.keyed:
            return False
        x, y, z = self.values_at(self.key_frames)[ROWS[SCALE]]
        return bool(np.allclose(x, y) and np.allclose(x, z) and np.all(x > 0.0) and np.ptp(x) > 0.0)

    def values_at(self, frames: np.ndarray) -> np.ndarray:
        """What the channels alone have on these frames, shape (10, m)."""
        rows = np.repeat(REST[:, None], len(frames), axis=1)
        for row, value in self.rest.items():
            rows[row] = value
        evaluated = evaluate(self.curves, [frames] * len(self.channels))
        for (own, _), values in zip(self.channels, evaluated, strict=True):
            rows[own] = values
        return rows

    @cached_property
    def holds(self) -> np.ndarray:
        """Whether all channels hold their value throughout a segment, shape (n - 1,)."""
        return np.all(self._interpolations == CONSTANT, axis=0)

    @cached_property
    def is_plain(self) -> np.ndarray:
        """Whether no channel is eased in a segment, nor holds, shape (n - 1,)."""
        return np.all((self._interpolations == LINEAR) | (self._interpolations == BEZIER), axis=0)

    @cached_property
    def _interpolations(self) -> np.ndarray:
        """The codes of each channel's keys that segments run on from, shape (channels, n - 1)."""
        starts, codes = self.key_frames[:-1] + SAME_FRAME, []
        for keys in self.curves:
            at = starts if keys.cycles is None else cycled(keys, starts)[0]
            codes.append(keys.interpolation[:, np.clip(np.searchsorted(keys.times, at, side="right") - 1, 0, None)])
        return np.concatenate(codes)

    @property
    def is_elastic(self) -> bool:
        """Whether any key eases elastically, which depends on how far a channel goes."""
        return any(keys.easing is not None and np.any(keys.interpolation == ELASTIC) for keys in self.curves)

    @cached_property
    def used_up(self) -> tuple[float, float]:
        """Before and after which frame cycles with a count are through: Blender goes back to the outermost keys."""
        cycles = [keys.cycles for keys in self.curves if keys.cycles is not None]
        before = any(one.before != "NONE" and one.before_count > 0 for one in cycles)
        after = any(one.after != "NONE" and one.after_count > 0 for one in cycles)
        return float(self.key_frames[0]) if before else -np.inf, float(self.key_frames[-1]) if after else np.inf

    @cached_property
    def cyclic(self) -> Keys | None:
        """The first of the channels that repeat."""
        return next((keys for keys in self.curves if keys.cycles is not None), None)
