"""Keys of long recordings of bodies: stretches that meet at keys of all that moves, each searched for itself.

In modes where a segment has no other keys than its own two, what holds in every stretch holds throughout. Stretches may
be searched side by side, and the memory that it takes is that of a few of them. What need not move in any of them is
found first: it stays in one pose from beginning to end, which the rest of the tolerance makes up for.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from .bodies import SOME_TURN, Body
from .measures import shell_error
from .poses import Poses
from .quaternions import align_signs, normalise
from .skeleton_channels import NO_TURN, Channels, SeparateKeys, changes
from .skeleton_search import TINY, ChannelKeys, OwnKeys
from .skeletons import Skeleton

AT_REST = 0.5
"""Of the tolerance: how far off all that rests may be together."""

Run = Callable[[Callable, Iterable], Iterable]
"""Calls a function with each of many arguments and gives the results in their order, as `map` does."""


@dataclass(frozen=True, eq=False)
class LongRecording:
    """A body as `reduce_skeleton_keys` gets it."""

    times: np.ndarray
    poses: Poses
    skeleton: Skeleton
    mode: str
    radii: np.ndarray
    weights: np.ndarray
    free: np.ndarray

    def part(self, samples: slice) -> LongRecording:
        """Some of the samples. Views."""
        return replace(self, times=self.times[samples], poses=self.poses[:, samples], weights=self.weights[:, samples])

    @property
    def body(self) -> Body:
        """The recorded body."""
        poses = Poses(self.poses.positions, align_signs(self.poses.quaternions), self.poses.scales)
        return Body(self.times, poses, self.skeleton, self.mode, self.radii, self.weights, self.free)


def keys_in_stretches(
    recording: LongRecording, tolerance: float, separate: bool, stretch: int, run: Run
) -> tuple[np.ndarray, ...] | tuple[SeparateKeys, ...]:
    """The keys of all joints, or of their channels: all that moves has keys where stretches of so many samples meet."""
    last = len(recording.times) - 1
    bounds = np.linspace(0, last, 1 + math.ceil(last / stretch)).round().astype(np.int64).tolist()
    parts = [recording.part(slice(first, end + 1)) for first, end in itertools.pairwise(bounds)]
    rests = _rests(recording, tolerance, separate, np.max([*run(_reaches, parts)], axis=0))
    joints = np.arange(len(rests))
    still = Poses(recording.poses.positions[joints, rests[:, -1]], recording.poses.quaternions[joints, rests[:, 0]])
    found = run(_keys, [(part, tolerance, separate, rests < 0, still) for part in parts])
    # The first key of a stretch is the last one of the stretch before.
    moved = [[first + keys[1 if first else 0 :] for keys in some] for first, some in zip(bounds, found, strict=False)]
    joined = [np.array([rest]) for rest in rests.flat]
    for channel in np.flatnonzero(rests < 0).tolist():
        joined[channel] = np.concatenate([keys[channel] for keys in moved])
    return tuple(map(SeparateKeys, joined[::2], joined[1::2])) if separate else tuple(joined)


def _reaches(part: LongRecording) -> np.ndarray:
    """How far what hangs on each joint gets from it, with the balls around it, in the joint's unit, shape (joints,)."""
    body = part.body
    return (body.sizes if body.truth.scales is None else body.sizes / body.truth.scales).max(axis=1)


def _rests(recording: LongRecording, tolerance: float, separate: bool, reaches: np.ndarray) -> np.ndarray:
    """The sample that each joint, or each of its channels, may stay at, -1 where it has to move, (joints, channels).

    By the triangle inequality all of them together are not off by more than their part of the tolerance.
    """
    skeleton, poses, free = recording.skeleton, recording.poses, recording.free
    found = np.array(
        [
            [_rest(part, reach) for part in _channels(joint, separate)]
            for joint, reach in zip(poses, reaches, strict=True)
        ]
    )
    samples, errors = found[..., 0].astype(np.int64), found[..., 1]
    chains = skeleton.longest_chains(np.count_nonzero(errors > 0.0, axis=1) * free)
    weights = skeleton.most_below(recording.weights.max(axis=1))
    allowed = AT_REST * tolerance / np.maximum(chains, 1) / np.maximum(weights, TINY)
    if poses.scales is not None:
        above = skeleton.in_root_space(poses[:, :1]).scales[skeleton.parents, 0]
        allowed /= np.where(skeleton.parents < 0, 1.0, above)
        allowed *= not changes(poses.scales).any()
    allowed[~free] = 0.0 if separate else -1.0
    return np.where(errors <= allowed[:, None], samples, -1)


def _channels(joint: Poses, separate: bool) -> tuple[Poses, ...]:
    """A joint's poses (n,), or its rotation and its location as poses."""
    if not separate:
        return (joint,)
    nowhere, unturned = (np.broadcast_to(row, (len(joint), len(row))) for row in (np.zeros(3), NO_TURN))
    return Poses(nowhere, joint.quaternions, joint.scales), Poses(joint.positions, unturned, joint.scales)


def _rest(poses: Poses, reach: float) -> tuple[int, float]:
    """The sample nearest to the mean of poses (n,), and how far they are off it at most."""
    quaternions = align_signs(poses.quaternions)
    scales = None if poses.scales is None else poses.scales.mean(keepdims=True)
    mean = Poses(
        poses.positions.mean(axis=0, keepdims=True),
        normalise(quaternions.mean(axis=0, keepdims=True) + SOME_TURN),
        scales,
    )
    sample = int(np.argmin(shell_error(poses, mean, reach)))
    return sample, float(shell_error(poses, poses[[sample]], reach).max())


def _keys(task: tuple[LongRecording, float, bool, np.ndarray, Poses]) -> list[np.ndarray]:
    """The keys of each channel of a stretch, of which some move (joints, channels) and others are still (joints,)."""
    part, tolerance, separate, moves, still = task
    recorded, ends = part.body, np.array((0, len(part.times) - 1))
    turns, advances = moves[:, 0], moves[:, -1]
    positions, quaternions = recorded.poses.positions.copy(), recorded.poses.quaternions.copy()
    positions[~advances], quaternions[~turns] = still.positions[~advances, None], still.quaternions[~turns, None]
    body = recorded.with_poses(Poses(positions, quaternions, recorded.poses.scales))
    if separate:
        channels = Channels(body, turns, advances)
        keys = [own for joint in channels.of_joints(ChannelKeys(channels, tolerance, False).found()) for own in joint]
    else:
        keys = OwnKeys(body, tolerance, False).found()
    # What is still here may move elsewhere.
    return [own if len(own) > 1 else ends for own in keys]
