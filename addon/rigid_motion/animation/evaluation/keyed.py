"""What is keyed in one slot, as arrays, and what that says by itself."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..fcurves.keys import ELASTIC, Keys
from .components import PART_OF, ROTATION, ROWS, SMOOTH
from .marks import SCREW_AXIS, Marks, vary


@dataclass(frozen=True, eq=False)
class Keyed:
    """The keys of one slot, and the values that what it does not key rests at."""

    order: str | None
    """The order of Euler angles, AXIS_ANGLE, or None for quaternions."""

    keyed: frozenset[str]
    """The parts of location, rotation and scale that are keyed, in one of their components at least, or turned."""

    channels: tuple[tuple[list[int], Keys], ...]
    """The channels with keys, those together that are keyed together: their rows among the components, and keys."""

    rest: dict[int, float]
    """The values of components that have no keys, of what is keyed, by their rows."""

    original: np.ndarray
    """An object's own delta transforms, as components, shape (10,): modes act on what is seen with them."""

    mode: int | Marks
    """The number of the mode of all segments, or of those from frames on. 0 is Blender's own."""

    turns: Keys | None = None
    """The channel of whole turns more, of segments from the frames of its keys on; None where it has no say."""

    turns_axis: str | Marks = SCREW_AXIS
    """One of `TURN_AXES`, or their numbers there."""

    location_axes: np.ndarray | None = None
    """The axes that location runs along, as columns (3, 3) in those of the body at rest; None where they are one."""

    seen: tuple[int, int] | None = None
    """First and last frame that are seen of it, in scenes and strips."""

    driven: frozenset[int] = frozenset()
    """The rows of components that drivers move, or whose channels are muted: to the others they are still."""

    @cached_property
    def digest(self) -> str:
        """Differs wherever anything differs that the motion depends on."""
        summary = hashlib.blake2b(digest_size=16)
        for rows, keys in self.channels:
            summary.update(bytes(rows))
            summary.update(keys.raw)
        # Where something stands that is not keyed does not change how it moves.
        rest = {row: value for row, value in self.rest.items() if row >= ROWS[ROTATION].start}
        seen = self.seen if self.goes_on and self.cyclic is None else None
        summary.update(repr((self.order, sorted(self.keyed), rest, self.mode, sorted(self.driven), seen)).encode())
        summary.update(self.original[ROWS[ROTATION]].tobytes())
        if self.location_axes is not None:
            summary.update(self.location_axes.tobytes())
        if self.turns is not None:
            summary.update(self.turns.raw + repr(self.turns_axis).encode())
        return summary.hexdigest()

    @property
    def digest24(self) -> int:
        """The first 24 bits of the digest."""
        return int(self.digest[:6], 16)

    @cached_property
    def curves(self) -> list[Keys]:
        """The keys of all channels that have any."""
        return [keys for _, keys in self.channels]

    @cached_property
    def key_count(self) -> int:
        """The number of keys that its channels have."""
        return sum(keys.interpolation.size for keys in self.curves)

    @cached_property
    def changing(self) -> frozenset[str]:
        """The parts that turns, or channels with more than one value, change."""
        parts = {
            PART_OF[row]
            for rows, keys in self.channels
            for row, varies in zip(rows, vary(keys).tolist(), strict=True)
            if varies
        }
        if ROTATION in self.keyed and self.turns is not None and self.turns.values.any():
            parts.add(ROTATION)
        return frozenset(parts)

    @cached_property
    def keyed_frames(self) -> np.ndarray:
        """Frames on which any of the channels has a key of the animator's, shape (k,)."""
        return np.unique(np.concatenate([np.empty(0), *(keys.times for keys in self.curves)]))

    @cached_property
    def keyed_range(self) -> tuple[float, float]:
        """The first and the last frame with a key."""
        return min(float(keys.times[0]) for keys in self.curves), max(float(keys.times[-1]) for keys in self.curves)

    @cached_property
    def goes_on(self) -> bool:
        """Return whether any channel goes on outside of its keys, by cycles or at its slope."""
        return any(keys.linear or keys.cycles is not None for keys in self.curves)

    @cached_property
    def is_linear(self) -> bool:
        """Return whether it goes on at its slope outside of its keys."""
        return self.cyclic is None and any(keys.linear for keys in self.curves)

    @cached_property
    def is_smooth(self) -> bool:
        """Return whether a mode in it looks at the keys around a segment."""
        return bool(np.isin(self.mode.numbers if isinstance(self.mode, Marks) else self.mode, SMOOTH).any())

    @cached_property
    def is_elastic(self) -> bool:
        """Return whether any key eases elastically, which depends on how far a channel goes."""
        return any(keys.easing is not None and np.any(keys.interpolation == ELASTIC) for keys in self.curves)

    @cached_property
    def cyclic(self) -> Keys | None:
        """The first of the channels that change and repeat."""
        return next((keys for keys in self.curves if keys.cycles is not None and vary(keys).any()), None)
