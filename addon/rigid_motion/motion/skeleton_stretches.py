"""Keys of long recordings of bodies: stretches that meet at keys of all that moves, each searched for itself.

In modes where a segment has no other keys than its own two, what holds in every stretch holds throughout. Stretches may
be searched side by side, and the memory that it takes is that of a few of them. What need not move in any of them is
found first: it stays in one pose from beginning to end, which the rest of the tolerance makes up for.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from .bodies import Body
from .measures import shell_error
from .poses import Poses, aligned, joined
from .skeleton_channels import NO_TURN, Channels, SeparateKeys, changes
from .skeleton_search import ZERO_WEIGHT, ChannelKeys, OwnKeys

AT_REST = 0.5
"""Of the tolerance: how far off all that rests may be together."""

Run = Callable[[Callable, Iterable], Iterable]
"""Calls a function with each of many arguments and gives the results in their order, as `map` does."""

Part = Callable[[slice], Body]
"""Returns some of the samples of a long recording, which is looked at part by part."""


def stretches(samples: int, stretch: int) -> list[slice]:
    """Stretches of so many samples, or fewer, each of which begins with the last sample of that before it."""
    last = samples - 1
    bounds = np.linspace(0, last, 1 + math.ceil(last / stretch)).round().astype(np.int64).tolist()
    return [slice(first, end + 1) for first, end in itertools.pairwise(bounds)]


def keys_in_stretches(
    part: Part, tolerance: float, separate: bool, bounds: list[slice], run: Run
) -> tuple[np.ndarray, ...] | tuple[SeparateKeys, ...]:
    """Return the keys of all joints, or of their channels: all that moves has keys where the stretches meet."""
    rests, still = _rests(part, bounds, tolerance, separate, run)
    tasks = ((part(some), tolerance, separate, rests < 0, still) for some in bounds)
    moved: list[list[np.ndarray]] = [[] for _ in rests.flat]
    for some, result in zip(bounds, run(_keys, tasks), strict=True):
        for channel, keys in zip(moved, result, strict=True):
            # The first key of a stretch is the last one of the stretch before.
            channel.append(some.start + keys[1 if some.start else 0 :])
    joined = [
        np.concatenate(keys) if rest < 0 else np.array([rest]) for keys, rest in zip(moved, rests.flat, strict=True)
    ]
    return tuple(map(SeparateKeys, joined[::2], joined[1::2])) if separate else tuple(joined)


def _rests(part: Part, bounds: list[slice], tolerance: float, separate: bool, run: Run) -> tuple[np.ndarray, Poses]:
    """Return the sample that each joint, or each of its channels, may stay at, and the poses of joints there (joints,).

    Samples are of shape (joints, channels), -1 where one has to move. By the triangle inequality all of them together
    are not off by more than their part of the tolerance.
    """
    reached, nearest, weighs, poses, grows = zip(*run(_survey, map(part, bounds)), strict=True)
    # Of the middles of stretches that in the middle.
    candidates = aligned(joined(poses, axis=1))
    body = replace(part(slice(0, len(bounds))), poses=candidates)
    skeleton, middles, joints = body.skeleton, body.middles, np.arange(len(body.skeleton))
    still = candidates[joints, middles]
    reaches = np.max(reached, axis=0)
    samples = np.array([some.start for some in bounds])[middles] + np.array(nearest)[middles, joints]
    errors = np.max([*run(_farthest, ((part(some), separate, reaches, still) for some in bounds))], axis=0)
    chains = skeleton.longest_chains(np.count_nonzero(errors > 0.0, axis=1) * body.free)
    weights = skeleton.most_below(np.max(weighs, axis=0))
    allowed = AT_REST * tolerance / np.maximum(chains, 1) / np.maximum(weights, ZERO_WEIGHT)
    scales = skeleton.in_root_space(still).scales
    if scales is not None and candidates.scales is not None:
        allowed /= np.where(skeleton.parents < 0, 1.0, scales[skeleton.parents])
        allowed *= not (np.any(grows) or changes(candidates.scales).any())
    allowed[~body.free] = 0.0 if separate else -1.0
    return np.where(errors <= allowed[:, None], samples[:, None], -1), still


def _survey(body: Body) -> tuple[np.ndarray, np.ndarray, np.ndarray, Poses, bool]:
    """How far what hangs on each joint gets from it, with the balls around it, in the joint's unit, shape (joints,).

    And the samples in the middle of their poses (joints,), the largest weights (joints,), the poses there (joints, 1),
    and whether scales change.
    """
    grows = body.poses.scales is not None and bool(changes(body.poses.scales).any())
    sizes = body.sizes if body.truth.scales is None else body.sizes / body.truth.scales
    return sizes.max(axis=1), body.middles, body.weights.max(axis=1), body.at_rest(), grows


def _farthest(task: tuple[Body, bool, np.ndarray, Poses]) -> np.ndarray:
    """How far channels are off where joints are still (joints,) at most, shape (joints, channels)."""
    part, separate, reaches, still = task
    pairs = zip(_channels(part.poses, separate), _channels(still[:, None], separate), strict=True)
    return np.stack([shell_error(own, held, reaches[:, None]).max(axis=1) for own, held in pairs], axis=1)


def _channels(poses: Poses, separate: bool) -> tuple[Poses, ...]:
    """Poses (joints, n), or their rotations and their locations as poses."""
    if not separate:
        return (poses,)
    nowhere, unturned = (np.broadcast_to(row, (*poses.shape, len(row))) for row in (np.zeros(3), NO_TURN))
    return Poses(nowhere, poses.quaternions, poses.scales), Poses(poses.positions, unturned, poses.scales)


def _keys(task: tuple[Body, float, bool, np.ndarray, Poses]) -> list[np.ndarray]:
    """Return the keys of each channel of a stretch; some move (joints, channels), others are still (joints,)."""
    recorded, tolerance, separate, moves, still = task
    ends = np.array((0, len(recorded.times) - 1))
    turns, advances = moves[:, 0], moves[:, -1]
    body = replace(recorded, poses=recorded.poses.copy(), desired=recorded.truth)
    body.poses.positions[~advances] = still.positions[~advances, None]
    body.poses.quaternions[~turns] = still.quaternions[~turns, None]
    if separate:
        channels = Channels(body, turns, advances)
        of_joints = channels.of_joints(ChannelKeys(channels, tolerance, False).found())
        keys = tuple(own for joint in of_joints for own in joint)
    else:
        keys = OwnKeys(body, tolerance, False).found()
    # What is still here may move elsewhere.
    return [own if len(own) > 1 else ends for own in keys]
