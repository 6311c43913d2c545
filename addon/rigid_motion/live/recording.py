"""Recording live motion: turns received samples into keys, and thins them as they arrive if a sender sends all frames.

Timestamps are the sender's, in seconds. The pose on screen when the recording began is on its first frame. Keys go to
a new Action for each object, created at the end: no data of Blender changes before that. Held objects get their keys
in the hands of the rigs and objects that hold them.
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
"""The number of samples thinned together: one second for most senders. A stretch begins and ends with a key."""

MIN_KEYED_CHANGE = 1e-6
"""Channels that change by less than this get a single key."""

PLAIN_MODE = "lerp_slerp"
"""The mode used for thinning when the keys get Blender's own in-betweens."""


class Take:
    """The recorded motion of one body.

    Parameters
    ----------
    driver
        The driver that shows the body.
    mode : str
        The mode between the keys.
    tolerance : float, optional
        The largest error of thinning, in metres. Without it every sample becomes a key.
    """

    def __init__(self, driver: Driver, mode: str, tolerance: float | None = None) -> None:
        self.driver, self._mode, self._tolerance = driver, mode, tolerance
        self._frames = np.empty(0)
        self._poses: Any = None
        """Samples that are not thinned yet: frames (n,) and poses (joints, n)."""
        self._hands: list[Hand] = []
        self._hand_numbers = np.empty(0, dtype=int)
        self._grips: Any = None
        """The number of the hand that holds it on each frame, from 1, 0 for none; and its poses (joints, n) there."""
        self.refusal = ""
        """The reason why a held object got its keys in the world instead."""
        self._last_frame = -np.inf
        self._keys: list[list[tuple[np.ndarray, Poses]]] = []
        """For each channel and stretch: the frames (k,) of its keys, and its values there."""

    def number_of(self, hand: Hand) -> int:
        """Return the number of a hand, from 1; a new hand gets the next number."""
        if hand not in self._hands:
            self._hands.append(hand)
        return self._hands.index(hand) + 1

    def add(self, frames: np.ndarray, poses: Poses, numbers: np.ndarray, grips: Poses) -> None:
        """Add poses (joints, n) on rising frames (n,). Frames not later than all earlier ones are dropped.

        `numbers` (n,) are the hands that hold the body, 0 for none, and `grips` its poses (joints, n) there.
        """
        later = frames > self._last_frame
        if not later.any():
            return
        frames, poses, grips = frames[later], poses[:, later], grips[:, later]
        self._last_frame = float(frames[-1])
        self._frames = np.concatenate((self._frames, frames))
        self._poses = poses if self._poses is None else joined((self._poses, poses), axis=1)
        self._hand_numbers = np.concatenate((self._hand_numbers, numbers[later]))
        self._grips = grips if self._grips is None else joined((self._grips, grips), axis=1)
        while self._tolerance is not None and len(self._frames) > STRETCH_SAMPLES:
            self._thin_stretch(STRETCH_SAMPLES + 1)

    def _thin_stretch(self, count: int) -> None:
        """Turn the first `count` samples into keys. The last of them is also the first sample of the next stretch."""
        frames, values = self._frames[:count], self.driver.values(self._poses[:, :count])
        self._frames, self._poses = self._frames[count - 1 :], self._poses[:, count - 1 :]
        self._keys = self._keys or [[] for _ in self.driver.prefixes]
        for keys, rows, poses in zip(self._keys, self._key_rows(frames, values), values, strict=True):
            keys.append((frames[rows], poses[rows]))

    def _key_rows(self, frames: np.ndarray, values: Poses) -> list[np.ndarray]:
        """Return the indices of the samples that become keys, for each channel."""
        if self._tolerance is None or len(frames) < 3:
            return [np.arange(len(frames))] * len(values)
        driver, mode = self.driver, PLAIN_MODE if self._mode == "BLENDER" else self._mode
        poses, radii = aligned(driver.locals(values)), np.maximum(driver.ends, DEFAULT_RADIUS_M / driver.unit)
        tolerance = self._tolerance / driver.unit
        kept = reduce_skeleton_keys(frames, poses, driver.follows, mode, tolerance=tolerance, radius=radii, tries=0)
        return [np.union1d(rows, (0, len(frames) - 1)) for rows in kept]

    def write(self) -> int:
        """Give the object a new Action with the keys. Return the number of keyed poses of all channels."""
        obj = self.driver.object
        if obj is None or not obj.is_editable or self._poses is None:
            return 0
        data = existing(obj.animation_data or obj.animation_data_create())
        if data.action is not None:
            data.action.use_fake_user = True
        data.action = bpy.data.actions.new(f"{obj.name} Live")
        if self._hand_numbers.any():
            _, grips = _separated_hands(self._frames, self._hand_numbers, self._grips)
            self._frames, self._poses = _separated_hands(self._frames, self._hand_numbers, self._poses)
            try:
                if count := self._write_held(obj, grips):
                    return count
            except Refused as refusal:
                self.refusal = str(refusal)
        self._thin_stretch(len(self._frames))
        count, moved = 0, []
        driver = self.driver
        for owner, prefix, keys, places in zip(
            driver.owners(obj), driver.prefixes, self._keys, driver.has_location.tolist(), strict=True
        ):
            if owner is not None:
                count += _write_channels(obj, owner, prefix, *_joined_keys(keys), places)
                moved.append(owner)
        set_mode(moved, self._mode, refused=[])
        return count

    def _write_held(self, obj: bpy.types.Object, grips: Poses) -> int:
        """Give a rigid body keys in the hands that hold it, where it has the poses `grips` (1, n). Return their number.

        Does nothing and returns 0 if none of the hands exists. Raises Refused if one cannot hold the object.
        """
        holders = [None, *map(holder_of, self._hands)]
        are_there = np.array([holder is not None for holder in holders])[self._hand_numbers]
        if len(self.driver.body.joints) > 1 or not are_there.any():
            return 0
        numbers, frames, poses = np.where(are_there, self._hand_numbers, 0), self._frames, self._poses[0].copy()
        poses[are_there] = grips[0, are_there]
        runs = np.split(np.arange(len(frames)), np.flatnonzero(np.diff(numbers)) + 1)
        parts = [_joined_keys([(frames[run], poses[run])]) for run in runs]
        frames, poses = np.concatenate([part[0] for part in parts]), joined([part[1] for part in parts])
        of_keys = [numbers[run[0]] for run, part in zip(runs, parts, strict=True) for _ in part[0]]
        count = _write_channels(obj, obj, "", frames, aligned(poses), True)
        hold_keys(obj, frames, [holders[number] for number in of_keys])
        set_mode(obj, self._mode)
        return count


def _separated_hands(frames: np.ndarray, numbers: np.ndarray, poses: Poses) -> tuple[np.ndarray, Poses]:
    """Return frames (n,) and poses (joints, n) with the last sample in each hand moved early enough before the first
    sample in the next hand. Otherwise Blender would merge both keys.
    """
    last, path = np.flatnonzero(np.diff(numbers)), KnotPath(frames, poses)
    until, poses = np.minimum(frames[last], frames[last + 1] - PASS_LEAD_FRAMES), poses.copy()
    poses[:, last] = path.at(until)
    return np.minimum(frames, np.append(until, np.inf)[np.searchsorted(last, np.arange(len(frames)))]), poses


def _joined_keys(keys: list[tuple[np.ndarray, Poses]]) -> tuple[np.ndarray, Poses]:
    """Return the keys of all stretches, joined; a single key if nothing moves.
    Adjacent stretches share the key between them.
    """
    frames, once = np.unique(np.concatenate([frames for frames, _ in keys]), return_index=True)
    poses = aligned(joined([poses for _, poses in keys])[once])
    is_still = (
        np.ptp(poses.positions, axis=0).max() < MIN_KEYED_CHANGE
        and np.ptp(poses.quaternions, axis=0).max() < MIN_KEYED_CHANGE
    )
    return (frames[:1], poses[:1]) if is_still else (frames, poses)


def _write_channels(
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
