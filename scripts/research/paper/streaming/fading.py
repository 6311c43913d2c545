"""Fading: how the picture goes on without a jump where the path under it changes.

Where a packet makes another motion of what is already being shown, the difference is taken along and fades: that of the
positions along a straight line, that of the rotations about its axis, both in the axes of the world. As one twist in
the axes of the body, which would do for small differences, a body that turns fast would swing what is left of a large
one about: on random motions with a fifth of the packets lost, that made frames seven times as long as the motion's own
longest. Seconds throughout.

Source of the idea: Bollo, "Inertialization: High-Performance Animation Transitions in Gears of War", GDC 2018.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import conjugate, multiply

AT_ONCE = 1024
"""Jumps worked on at once, which bounds the memory that they take."""

SMALLEST_SINE = 1e-150
"""Stands for the sine of no turn at all, which has no axis."""


@dataclass(frozen=True, eq=False)
class Jumps:
    """c changes of the path, in the order of time."""

    times: np.ndarray
    """Of the last frames before the changes, shape (c,)."""

    durations: np.ndarray
    """In which the differences fade, shape (c,)."""

    offsets: np.ndarray
    """From the new path to the old one at those times, shape (c, 3)."""

    half_angles: np.ndarray
    """Of the turns from the new path to the old one, 0 to pi / 2, shape (c,)."""

    axes: np.ndarray
    """Of those turns, of length 1, or 0 where nothing turns, shape (c, 3)."""

    @classmethod
    def between(cls, times: np.ndarray, durations: np.ndarray, old: Poses, new: Poses) -> Jumps:
        """From the poses (c,) of the old path to those of the new at the same times (c,)."""
        turns = multiply(old.quaternions, conjugate(new.quaternions))
        turns = np.where(turns[:, :1] < 0.0, -turns, turns)
        sines = np.linalg.norm(turns[:, 1:], axis=-1)
        axes = turns[:, 1:] / np.maximum(sines, SMALLEST_SINE)[:, None]
        return cls(times, durations, old.positions - new.positions, np.arctan2(sines, turns[:, 0]), axes)

    def __getitem__(self, index: Any) -> Jumps:
        """Some of the changes, by NumPy's rules: a slice, a mask, or indices, of which some may come again."""
        return Jumps(*(getattr(self, field.name)[index] for field in fields(self)))

    def then(self, others: Jumps) -> Jumps:
        """These changes, and others after them."""
        both = ((getattr(self, field.name), getattr(others, field.name)) for field in fields(self))
        return Jumps(*map(np.concatenate, both))


def fade(times: np.ndarray, path: Poses, jumps: Jumps) -> Poses:
    """A path that jumps, without its jumps.

    Parameters
    ----------
    times : array, shape (k,)
        Of the frames, not falling.
    path : Poses, shape (k,)
    jumps : Jumps

    Returns
    -------
    Poses, shape (k,)
        Every jump fades by itself, by a weight w that falls from 1 to 0 as (1 - u)^2. Of a frame where jumps of d, d',
        ... and turns of r, r', ... are fading, the latest first, the position is that of the path + w d + w' d' ...,
        and the rotation ... r'^w' r^w times that of the path: so the first frame of a new path goes on from the frame
        before it, whatever was fading there.
    """
    positions, quaternions = path.positions.copy(), path.quaternions.copy()
    begins = np.searchsorted(times, jumps.times, side="right")
    ends = np.maximum(np.searchsorted(times, jumps.times + jumps.durations), begins)
    for last in range(len(begins), 0, -AT_ONCE):
        few = np.arange(max(0, last - AT_ONCE), last)
        counts = (ends - begins)[few]
        # Every frame with every jump that is fading there, the latest first.
        jump = few.repeat(counts)
        frame = np.arange(len(jump)) + np.repeat(begins[few] - np.cumsum(counts) + counts, counts)
        order = np.lexsort((-jump, frame))
        jump, frame = jump[order], frame[order]
        weights = (1.0 - (times[frame] - jumps.times[jump]) / jumps.durations[jump]) ** 2
        np.add.at(positions, frame, weights[:, None] * jumps.offsets[jump])
        angles = weights * jumps.half_angles[jump]
        turns = np.concatenate((np.cos(angles)[:, None], np.sin(angles)[:, None] * jumps.axes[jump]), axis=-1)
        rank = np.arange(len(frame)) - np.searchsorted(frame, frame)
        for place in range(int(rank.max(initial=-1)) + 1):
            pairs = rank == place
            quaternions[frame[pairs]] = multiply(turns[pairs], quaternions[frame[pairs]])
    return Poses(positions, quaternions)
