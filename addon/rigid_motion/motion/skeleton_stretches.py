"""Keys of long recordings of bodies: stretches that meet at keys of all that moves, each searched for itself.

In modes where a segment has no other keys than its own two, what holds in every stretch holds throughout. Stretches may
be searched side by side, and the memory that it takes is that of a few of them. What need not move in any of them is
found first: it stays in one pose from beginning to end, which the rest of the tolerance makes up for.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from .bodies import SOME_TURN, Body
from .measures import shell_error
from .poses import Poses
from .quaternions import align_signs, normalise
from .skeleton_channels import NO_TURN, Channels, SeparateKeys
from .skeleton_search import TINY, ChannelKeys, OwnKeys
from .skeletons import Skeleton

AT_REST = 0.5
"""Of the tolerance: how far off all that rests may be together."""

Run = Callable[[Callable, Iterable], Iterable]
"""Calls a function with each of many arguments and gives the results in their order, as `map` does."""


@dataclass(frozen=True, eq=False)
class LongRecording:
    """A body as `reduce_skeleton_keys` gets it, but for its poses, which are looked at part by part."""

    times: np.ndarray
    skeleton: Skeleton
    mode: str
    radii: np.ndarray
    weights: np.ndarray
    free: np.ndarray
    poses: Callable[[slice], Poses]
    """Those of some of the samples, shape (joints, samples)."""

    def part(self, samples: slice) -> Stretch:
        poses = self.poses(samples)
        poses = Poses(poses.positions, align_signs(poses.quaternions), poses.scales)
        return Stretch(
            self.times[samples], poses, self.weights[:, samples], self.skeleton, self.mode, self.radii, self.free
        )


@dataclass(frozen=True, eq=False)
class Stretch:
    """A part of a long recording."""

    times: np.ndarray
    poses: Poses
    weights: np.ndarray
    skeleton: Skeleton
    mode: str
    radii: np.ndarray
    free: np.ndarray

    @property
    def body(self) -> Body:
        return Body(self.times, self.poses, self.skeleton, self.mode, self.radii, self.weights, self.free)


def stretches(samples: int, stretch: int) -> list[slice]:
    """Stretches of so many samples, or fewer, each of which begins with the last sample of that before it."""
    last = samples - 1
    bounds = np.linspace(0, last, 1 + math.ceil(last / stretch)).round().astype(np.int64).tolist()
    return [slice(first, end + 1) for first, end in itertools.pairwise(bounds)]


def keys_in_stretches(
    recording: LongRecording, tolerance: float, separate: bool, stretch: int, run: Run
) -> tuple[np.ndarray, ...] | tuple[SeparateKeys, ...]:
    """The keys of all joints, or of their channels: all that moves has keys where stretches of so many samples meet."""
    bounds = stretches(len(recording.times), stretch)
    rests, still = _rests(recording, bounds, tolerance, separate, run)
    tasks = ((recording.part(some), tolerance, separate, rests < 0, still) for some in bounds)
    moved = [[] for _ in rests.flat]
    for some, found in zip(bounds, run(_keys, tasks), strict=True):
        for channel, keys in zip(moved, found, strict=True):
            # The first key of a stretch is the last one of the stretch before.
            channel.append(some.start + keys[1 if some.start else 0 :])
    joined = [
        np.concatenate(keys) if rest < 0 else np.array([rest]) for keys, rest in zip(moved, rests.flat, strict=True)
    ]
    return tuple(map(SeparateKeys, joined[::2], joined[1::2])) if separate else tuple(joined)


def _rests(
    recording: LongRecording, bounds: list[slice], tolerance: float, separate: bool, run: Run
) -> tuple[np.ndarray, Poses]:
    """The sample that each joint, or each of its channels, may stay at, and the poses of joints there (joints,).

    Samples are of shape (joints, channels), -1 where one has to move. By the triangle inequality all of them together
    are not off by more than their part of the tolerance.
    """
    skeleton, start = recording.skeleton, recording.part(slice(0, 1)).poses

    def each(look: Callable, *known: object) -> tuple[tuple, ...]:
        return tuple(zip(*run(look, ((recording.part(some), separate, *known) for some in bounds)), strict=True))

    reaches, sums, grows = each(_survey, start)
    reaches, mean = np.max(reaches, axis=0)[:, None], _mean(sums, [some.stop - some.start for some in bounds])
    samples, errors, poses = each(_nearest, reaches, mean)
    stretch = np.argmin(errors, axis=0)
    joints, channels = np.indices(stretch.shape)
    samples = (np.array(samples) + [[[some.start]] for some in bounds])[stretch, joints, channels]
    still = Poses(
        np.array([some.positions for some in poses])[stretch, joints, channels],
        np.array([some.quaternions for some in poses])[stretch, joints, channels],
        None if start.scales is None else np.array([some.scales for some in poses])[stretch, joints, channels],
    )
    errors = np.max(each(_farthest, reaches, still)[0], axis=0)
    chains = skeleton.longest_chains(np.count_nonzero(errors > 0.0, axis=1) * recording.free)
    weights = skeleton.most_below(recording.weights.max(axis=1))
    allowed = AT_REST * tolerance / np.maximum(chains, 1) / np.maximum(weights, TINY)
    if start.scales is not None:
        above = skeleton.in_root_space(start).scales[skeleton.parents, 0]
        allowed /= np.where(skeleton.parents < 0, 1.0, above)
        allowed *= not np.any(grows)
    allowed[~recording.free] = 0.0 if separate else -1.0
    rests = np.where(errors <= allowed[:, None], samples, -1)
    return rests, Poses(still.positions[:, -1], still.quaternions[:, 0])


def _survey(task: tuple[Stretch, bool, Poses]) -> tuple[np.ndarray, Poses, bool]:
    """How far what hangs on each joint gets from it, with the balls around it, in the joint's unit, shape (joints,).

    And the sums of poses (joints, 1), with quaternions on the side of those at the start; and whether scales change.
    """
    part, _, start = task
    body, poses = part.body, part.poses
    sides = np.where(np.einsum("jni,jni->jn", poses.quaternions, start.quaternions) < 0.0, -1.0, 1.0)
    sums = Poses(
        poses.positions.sum(axis=1, keepdims=True),
        np.einsum("jn,jni->ji", sides, poses.quaternions)[:, None],
        None if poses.scales is None else poses.scales.sum(axis=1, keepdims=True),
    )
    reaches = (body.sizes if body.truth.scales is None else body.sizes / body.truth.scales).max(axis=1)
    return reaches, sums, poses.scales is not None and bool(np.any(poses.scales != start.scales))


def _mean(sums: Sequence[Poses], counts: Sequence[int]) -> Poses:
    """The mean of poses of which these are sums, shape (joints, 1)."""
    count = sum(counts)
    return Poses(
        np.sum([some.positions for some in sums], axis=0) / count,
        normalise(np.sum([some.quaternions for some in sums], axis=0) / count + SOME_TURN),
        None if sums[0].scales is None else np.sum([some.scales for some in sums], axis=0) / count,
    )


def _nearest(task: tuple[Stretch, bool, np.ndarray, Poses]) -> tuple[np.ndarray, np.ndarray, Poses]:
    """The samples nearest to poses (joints, 1), their errors and their poses, each of shape (joints, channels)."""
    part, separate, reaches, poses = task
    joints = np.arange(len(part.poses))[:, None]
    errors = [
        shell_error(some, pose, reaches)
        for some, pose in zip(_channels(part.poses, separate), _channels(poses, separate), strict=True)
    ]
    samples = np.argmin(errors, axis=2).T
    return samples, np.min(errors, axis=2).T, part.poses[joints, samples]


def _farthest(task: tuple[Stretch, bool, np.ndarray, Poses]) -> tuple[np.ndarray]:
    """How far channels are off poses (joints, channels) at most, shape (joints, channels)."""
    part, separate, reaches, still = task
    errors = [
        shell_error(some, _channels(still[:, [channel]], separate)[channel], reaches).max(axis=1)
        for channel, some in enumerate(_channels(part.poses, separate))
    ]
    return (np.stack(errors, axis=1),)


def _channels(poses: Poses, separate: bool) -> tuple[Poses, ...]:
    """Poses (joints, n), or their rotations and their locations as poses."""
    if not separate:
        return (poses,)
    nowhere, unturned = (np.broadcast_to(row, (*poses.shape, len(row))) for row in (np.zeros(3), NO_TURN))
    return Poses(nowhere, poses.quaternions, poses.scales), Poses(poses.positions, unturned, poses.scales)


def _keys(task: tuple[Stretch, float, bool, np.ndarray, Poses]) -> list[np.ndarray]:
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
