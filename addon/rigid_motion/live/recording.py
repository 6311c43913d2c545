"""From what came to keys: at the moments that were sent, or thinned while it comes where every frame is sent.

Moments are the sender's, in seconds; what the screen showed as the recording began is on its first frame. Keys are in
an Action of their own for each object, which is made at the end: nothing of Blender's is touched before.
"""

from __future__ import annotations

import bpy
import numpy as np

from ..animation import set_mode, write_channel
from ..motion import Poses, reduce_skeleton_keys
from ..motion.eulers import ORDERS, extrinsic_eulers_from_quaternions
from ..motion.poses import joined
from ..motion.quaternions import align_signs
from ..streams.bodies import RADIUS
from .driving import Driver, Values

STRETCH = 60
"""Samples that are thinned together: a second of most senders. It begins and ends with keys."""

STILL = 1e-6
"""The least change that takes more than a single key."""

PLAIN = "lerp_slerp"
"""The mode that thinning goes by where keys are to have Blender's own in-betweens."""


class Take:
    """What one body did while it was recorded.

    Parameters
    ----------
    driver
        What shows the body.
    mode : str
        What fills in between the keys.
    tolerance : float, optional
        Metres within which samples are thinned. Without, all that comes are keys.
    """

    def __init__(self, driver: Driver, mode: str, tolerance: float | None = None) -> None:
        self.driver, self._mode, self._tolerance = driver, mode, tolerance
        self._frames, self._poses = np.empty(0), None
        """Frames (n,) that are not thinned yet, and poses (joints, n)."""
        self._last = -np.inf
        self._values: Values | None = None
        self._keys: list[list[tuple[np.ndarray, Poses]]] = []
        """For each channel and stretch the frames (k,) of its keys, and what it has there."""

    def add(self, frames: np.ndarray, poses: Poses) -> None:
        """Take poses (joints, n) on rising frames (n,), those that are later than all before."""
        later = frames > self._last
        if not later.any():
            return
        frames, poses = frames[later], poses[:, later]
        self._last = float(frames[-1])
        self._frames = np.concatenate((self._frames, frames))
        self._poses = poses if self._poses is None else joined((self._poses, poses), axis=1)
        while self._tolerance is not None and len(self._frames) > STRETCH:
            self._take(STRETCH + 1)

    def _take(self, count: int) -> None:
        """Make keys of so many frames. The last of them is the first of the next stretch."""
        frames, values = self._frames[:count], self.driver.values(self._poses[:, :count])
        self._frames, self._poses = self._frames[count - 1 :], self._poses[:, count - 1 :]
        self._values = values
        self._keys = self._keys or [[] for _ in values.prefixes]
        for keys, rows, poses in zip(self._keys, self._kept(frames, values), values.poses, strict=True):
            keys.append((frames[rows], poses[rows]))

    def _kept(self, frames: np.ndarray, values: Values) -> list[np.ndarray]:
        """Return the samples that are keys, of each channel."""
        if self._tolerance is None or len(frames) < 3:
            return [np.arange(len(frames))] * len(values.prefixes)
        poses, parents, unit = self.driver.locals(values)
        poses = Poses(poses.positions, align_signs(poses.quaternions))
        mode = PLAIN if self._mode == "BLENDER" else self._mode
        radii = np.maximum(self.driver.ends, RADIUS / unit)
        kept = reduce_skeleton_keys(
            frames, poses, parents, mode, tolerance=self._tolerance / unit, radius=radii, tries=0
        )
        return [np.union1d(rows, (0, len(frames) - 1)) for rows in kept]

    def write(self) -> int:
        """Give the object an Action with the keys, and say how many poses of channels that are."""
        obj = self.driver.object
        if obj is None or not obj.is_editable or self._poses is None:
            return 0
        self._take(len(self._frames))
        data = obj.animation_data or obj.animation_data_create()
        if data.action is not None:
            data.action.use_fake_user = True
        data.action = bpy.data.actions.new(f"{obj.name} Live")
        count, moved = 0, []
        owners = self.driver.owners(obj)
        for owner, prefix, keys, places in zip(
            owners, self._values.prefixes, self._keys, self._values.has_location.tolist(), strict=True
        ):
            if owner is not None:
                count += _write(obj, owner, prefix, *_of_all(keys), places)
                moved.append(owner)
        set_mode(moved, self._mode, refused=[])
        return count


def _of_all(keys: list[tuple[np.ndarray, Poses]]) -> tuple[np.ndarray, Poses]:
    """Return the keys of stretches as one; a single one where nothing moves.
    Where stretches meet both have the same.
    """
    frames, once = np.unique(np.concatenate([frames for frames, _ in keys]), return_index=True)
    poses = joined([poses for _, poses in keys])[once]
    positions, quaternions = poses.positions, align_signs(poses.quaternions)
    if np.ptp(positions, axis=0).max() < STILL and np.ptp(quaternions, axis=0).max() < STILL:
        once = slice(1)
        frames, positions, quaternions = frames[once], positions[once], quaternions[once]
    return frames, Poses(positions, quaternions)


def _write(
    obj: bpy.types.Object,
    owner: bpy.types.Object | bpy.types.PoseBone,
    prefix: str,
    frames: np.ndarray,
    poses: Poses,
    has_location: bool,
) -> int:
    group = owner.name if prefix else "Object Transforms"
    channels = {"location": poses.positions} if has_location else {}
    if owner.rotation_mode in ORDERS:
        channels["rotation_euler"] = extrinsic_eulers_from_quaternions(poses.quaternions, owner.rotation_mode)
    else:
        channels["rotation_quaternion"] = poses.quaternions
    for name, values in channels.items():
        write_channel(obj, prefix + name, frames, values, group=group)
    return len(frames)
