"""From what came to keys: at the moments that were sent, or thinned while it comes where every frame is sent.

Moments are the sender's, in seconds; what the screen showed as the recording began is on its first frame. Keys are in
an Action of their own for each object, which is made at the end: nothing of Blender's is touched before. What is held
has its keys in the hands of the rigs and objects that hold it.
"""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from ..animation import Refused, hold_keys, set_mode, write_channel
from ..animation.evaluation.runs import PASS_LEAD_FRAMES
from ..blender import existing
from ..motion import Poses, reduce_skeleton_keys
from ..motion.eulers import ORDERS, extrinsic_eulers_from_quaternions
from ..motion.poses import aligned, joined
from ..streams.bodies import DEFAULT_RADIUS_M
from ..streams.paths import KnotPath
from .driving import Driver, Hand, holder_of

STRETCH_SAMPLES = 60
"""Samples that are thinned together: a second of most senders. It begins and ends with keys."""

MIN_KEYED_CHANGE = 1e-6
"""The least change that takes more than a single key."""

PLAIN_MODE = "lerp_slerp"
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
        self._frames = np.empty(0)
        self._poses: Any = None
        """Frames (n,) that are not thinned yet, and poses (joints, n)."""
        self._hands: list[Hand] = []
        self._numbers = np.empty(0, dtype=int)
        self._grips: Any = None
        """By which of the hands it is held on all frames, from 1 on, 0 for none; and its poses (joints, n) there."""
        self.refusal = ""
        """Why keys are in the world of what was held."""
        self._last = -np.inf
        self._keys: list[list[tuple[np.ndarray, Poses]]] = []
        """For each channel and stretch the frames (k,) of its keys, and what it has there."""

    def number_of(self, hand: Hand) -> int:
        """Return the number of a hand, from 1 on."""
        if hand not in self._hands:
            self._hands.append(hand)
        return self._hands.index(hand) + 1

    def add(self, frames: np.ndarray, poses: Poses, numbers: np.ndarray, grips: Poses) -> None:
        """Take poses (joints, n) on rising frames (n,), those that are later than all before.

        Numbers (n,) say in which hands they are, 0 for none, and there it has the poses `grips`.
        """
        later = frames > self._last
        if not later.any():
            return
        frames, poses, grips = frames[later], poses[:, later], grips[:, later]
        self._last = float(frames[-1])
        self._frames = np.concatenate((self._frames, frames))
        self._poses = poses if self._poses is None else joined((self._poses, poses), axis=1)
        self._numbers = np.concatenate((self._numbers, numbers[later]))
        self._grips = grips if self._grips is None else joined((self._grips, grips), axis=1)
        while self._tolerance is not None and len(self._frames) > STRETCH_SAMPLES:
            self._take(STRETCH_SAMPLES + 1)

    def _take(self, count: int) -> None:
        """Make keys of so many frames. The last of them is the first of the next stretch."""
        frames, values = self._frames[:count], self.driver.values(self._poses[:, :count])
        self._frames, self._poses = self._frames[count - 1 :], self._poses[:, count - 1 :]
        self._keys = self._keys or [[] for _ in self.driver.prefixes]
        for keys, rows, poses in zip(self._keys, self._kept(frames, values), values, strict=True):
            keys.append((frames[rows], poses[rows]))

    def _kept(self, frames: np.ndarray, values: Poses) -> list[np.ndarray]:
        """Return the samples that are keys, of each channel."""
        if self._tolerance is None or len(frames) < 3:
            return [np.arange(len(frames))] * len(values)
        driver, mode = self.driver, PLAIN_MODE if self._mode == "BLENDER" else self._mode
        poses, radii = aligned(driver.locals(values)), np.maximum(driver.ends, DEFAULT_RADIUS_M / driver.unit)
        tolerance = self._tolerance / driver.unit
        kept = reduce_skeleton_keys(frames, poses, driver.follows, mode, tolerance=tolerance, radius=radii, tries=0)
        return [np.union1d(rows, (0, len(frames) - 1)) for rows in kept]

    def write(self) -> int:
        """Give the object an Action with the keys, and say how many poses of channels that are."""
        obj = self.driver.object
        if obj is None or not obj.is_editable or self._poses is None:
            return 0
        data = existing(obj.animation_data or obj.animation_data_create())
        if data.action is not None:
            data.action.use_fake_user = True
        data.action = bpy.data.actions.new(f"{obj.name} Live")
        if self._numbers.any():
            _, grips = _apart(self._frames, self._numbers, self._grips)
            self._frames, self._poses = _apart(self._frames, self._numbers, self._poses)
            try:
                if count := self._write_held(obj, grips):
                    return count
            except Refused as refusal:
                self.refusal = str(refusal)
        self._take(len(self._frames))
        count, moved = 0, []
        driver = self.driver
        for owner, prefix, keys, places in zip(
            driver.owners(obj), driver.prefixes, self._keys, driver.has_location.tolist(), strict=True
        ):
            if owner is not None:
                count += _write(obj, owner, prefix, *_of_all(keys), places)
                moved.append(owner)
        set_mode(moved, self._mode, refused=[])
        return count

    def _write_held(self, obj: bpy.types.Object, grips: Poses) -> int:
        """Give an object, which is a rigid body, keys in the hands that hold it, where it has the poses `grips` (1, n).

        Does nothing and returns 0 where no hand is there. Raises Refused where one cannot hold it.
        """
        holders = [None, *map(holder_of, self._hands)]
        are_there = np.array([holder is not None for holder in holders])[self._numbers]
        if len(self.driver.body.joints) > 1 or not are_there.any():
            return 0
        numbers, frames, poses = np.where(are_there, self._numbers, 0), self._frames, self._poses[0].copy()
        poses[are_there] = grips[0, are_there]
        runs = np.split(np.arange(len(frames)), np.flatnonzero(np.diff(numbers)) + 1)
        parts = [_of_all([(frames[run], poses[run])]) for run in runs]
        frames, poses = np.concatenate([part[0] for part in parts]), joined([part[1] for part in parts])
        of_keys = [numbers[run[0]] for run, part in zip(runs, parts, strict=True) for _ in part[0]]
        count = _write(obj, obj, "", frames, aligned(poses), True)
        hold_keys(obj, frames, [holders[number] for number in of_keys])
        set_mode(obj, self._mode)
        return count


def _apart(frames: np.ndarray, numbers: np.ndarray, poses: Poses) -> tuple[np.ndarray, Poses]:
    """Return frames (n,) and poses (joints, n) of which the last in each hand is so long before the first in the next
    that Blender does not take both for one key.
    """
    last, path = np.flatnonzero(np.diff(numbers)), KnotPath(frames, poses)
    until, poses = np.minimum(frames[last], frames[last + 1] - PASS_LEAD_FRAMES), poses.copy()
    poses[:, last] = path.at(until)
    return np.minimum(frames, np.append(until, np.inf)[np.searchsorted(last, np.arange(len(frames)))]), poses


def _of_all(keys: list[tuple[np.ndarray, Poses]]) -> tuple[np.ndarray, Poses]:
    """Return the keys of stretches as one; a single one where nothing moves.
    Where stretches meet both have the same.
    """
    frames, once = np.unique(np.concatenate([frames for frames, _ in keys]), return_index=True)
    poses = aligned(joined([poses for _, poses in keys])[once])
    is_still = (
        np.ptp(poses.positions, axis=0).max() < MIN_KEYED_CHANGE
        and np.ptp(poses.quaternions, axis=0).max() < MIN_KEYED_CHANGE
    )
    return (frames[:1], poses[:1]) if is_still else (frames, poses)


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
