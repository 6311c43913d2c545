"""Marks: numbers that keys set from a frame on, such as modes; which frames are one; and whether curves change."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..fcurves.keys import Keys

FULL_TURN = 2.0 * np.pi

HALF_TURN = np.pi - 1e-4
"""The smallest angle, in radians, that counts as half a turn: single precision may lose a little."""

WHOLE_TURN = 1e-5
"""Turns in the Turns channel that differ from whole turns by less are rounded to them."""

MAX_PARALLEL_COSINE_GAP = 1e-6
"""Axes count as parallel if one minus their cosine is smaller: less than a tenth of a degree."""

SCREW_AXIS = "SCREW"
"""Turns are about the axis of the segment's own rotation, or about the local Z axis if it does not rotate."""

TURN_AXES = (SCREW_AXIS, "X", "Y", "Z")
"""The possible axes of turns: the segment's screw axis, or a fixed local axis."""

SAME_FRAME = 0.01
"""Keys closer than this, in frames, are one key to Blender, and here."""

SAME_VALUE = 1e-5
"""Values that differ by less (relative, absolute below 1) are the same: keys set from visible poses are so far off."""


def distinct(frames: np.ndarray) -> np.ndarray:
    """Return rising frames of keys, counting keys that are one key to Blender only once."""
    return frames[np.diff(frames, prepend=-np.inf) > SAME_FRAME]


def near(frames: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return which frames (n,) coincide with any of the others (m,) to Blender, shape (n,)."""
    frames, others = np.asarray(frames, dtype=np.float64), np.sort(others)
    first = np.searchsorted(others, frames - SAME_FRAME, side="right")
    return first < np.searchsorted(others, frames + SAME_FRAME)


def without(frames: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return the frames (n,) that coincide with none of the others (m,) to Blender."""
    return frames[~near(frames, others)]


@dataclass(frozen=True, eq=False)
class Marks:
    """Numbers that apply from given frames on, each until the next; the first one also applies before its frame."""

    frames: np.ndarray
    """In rising order, shape (n,)."""

    numbers: np.ndarray
    """Shape (n,)."""

    def at(self, frames: np.ndarray) -> np.ndarray:
        """Return the numbers (m,) at frames (m,)."""
        return np.asarray(self.numbers)[np.clip(np.searchsorted(self.frames, frames, side="right") - 1, 0, None)]

    def __repr__(self) -> str:
        return f"{np.asarray(self.frames, dtype=float).tolist()} {np.asarray(self.numbers, dtype=int).tolist()}"


def which_vary(keys: Keys) -> np.ndarray:
    """Return which curves (c,) have more than one value, in keys or handles."""
    if len(keys.times) < 2:
        return np.zeros(len(keys.points), dtype=bool)
    values = [points[..., 1] for points in (keys.points, keys.left, keys.right) if points is not None]
    return np.any(np.concatenate(values, axis=1) != keys.values[:, :1], axis=1)


def sweeps(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the change of angle (S,) between angles and axes (4, S); 0 if the axes are not parallel."""
    lengths = np.sqrt(np.einsum("ks,ks->s", start[1:], start[1:]) * np.einsum("ks,ks->s", end[1:], end[1:]))
    dot = np.einsum("ks,ks->s", start[1:], end[1:])
    is_parallel = (lengths > 0.0) & (np.abs(dot) >= (1.0 - MAX_PARALLEL_COSINE_GAP) * lengths)
    return np.where(is_parallel, np.sign(dot) * end[0] - start[0], 0.0)


def turns_at(keys: Keys, frames: np.ndarray) -> np.ndarray:
    """Return the Turns channel as steps at frames (m,): 0 before its first key, and rounded if almost whole."""
    at = np.searchsorted(keys.times, frames, side="right") - 1
    turns = np.where(at < 0, 0.0, keys.values[0, np.clip(at, 0, None)])
    whole = np.rint(turns)
    return np.where(np.abs(turns - whole) < WHOLE_TURN, whole, turns)
