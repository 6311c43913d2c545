"""Key reduction of long body recordings in stretches, searched separately, that meet at keys of all moving joints.

In modes where a segment depends only on its own two keys, a tolerance met in every stretch is met everywhere. Stretches
may be searched in parallel, and the memory is that of a few stretches. Joints that need not move in any stretch are
found first: they hold one pose from beginning to end. This uses part of the tolerance, and the rest is for the others.
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
"""The fraction of the tolerance that the errors of all resting joints together may use."""

Run = Callable[[Callable, Iterable], Iterable]
"""Calls a function with each of many arguments and yields the results in order, like `map`."""

Part = Callable[[slice], Body]
"""Returns a slice of the samples of a long recording, which is processed part by part."""


def stretches(samples: int, stretch: int) -> list[slice]:
    """Return nearly equal stretches of at most `stretch` steps. Each begins with the last sample of the one before."""
    last = samples - 1
    bounds = np.linspace(0, last, 1 + math.ceil(last / stretch)).round().astype(np.int64).tolist()
    return [slice(first, end + 1) for first, end in itertools.pairwise(bounds)]


def keys_in_stretches(
    part: Part, tolerance: float, separate: bool, bounds: list[slice], run: Run
) -> tuple[np.ndarray, ...] | tuple[SeparateKeys, ...]:
    """Return the keys of all joints, or of their channels; all that move have keys where stretches meet."""
    rests, still = _resting_samples(part, bounds, tolerance, separate, run)
    tasks = ((part(some), tolerance, separate, rests < 0, still) for some in bounds)
    moved: list[list[np.ndarray]] = [[] for _ in rests.flat]
    for some, result in zip(bounds, run(_stretch_keys, tasks), strict=True):
        for channel, keys in zip(moved, result, strict=True):
            # The first key of a stretch is the last one of the stretch before.
            channel.append(some.start + keys[1 if some.start else 0 :])
    joined = [
        np.concatenate(keys) if rest < 0 else np.array([rest]) for keys, rest in zip(moved, rests.flat, strict=True)
    ]
    return tuple(map(SeparateKeys, joined[::2], joined[1::2])) if separate else tuple(joined)


def _resting_samples(
    part: Part, bounds: list[slice], tolerance: float, separate: bool, run: Run
) -> tuple[np.ndarray, Poses]:
    """Return the sample at which each joint or channel may rest, and the poses of joints there (joints,).

    Samples have the shape (joints, channels), with -1 for channels that must move. By the triangle inequality, the
    errors of all resting channels together stay within the fraction `AT_REST` of the tolerance.
    """
    reached, nearest, weighs, poses, grows = zip(*run(_survey, map(part, bounds)), strict=True)
    # From the middle poses of stretches, choose the one in the middle.
    candidates = aligned(joined(poses, axis=1))
    body = replace(part(slice(0, len(bounds))), poses=candidates)
    skeleton, middles, joints = body.skeleton, body.middles, np.arange(len(body.skeleton))
    still = candidates[joints, middles]
    reaches = np.max(reached, axis=0)
    samples = np.array([some.start for some in bounds])[middles] + np.array(nearest)[middles, joints]
    errors = np.max([*run(_largest_errors, ((part(some), separate, reaches, still) for some in bounds))], axis=0)
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
    """Return how far everything below each joint reaches, including balls, in the joint's unit, shape (joints,).

    Also return the sample with the middle pose of each joint (joints,), the largest weights (joints,), the middle poses
    (joints, 1), and whether scales change.
    """
    grows = body.poses.scales is not None and bool(changes(body.poses.scales).any())
    sizes = body.sizes if body.truth.scales is None else body.sizes / body.truth.scales
    return sizes.max(axis=1), body.middles, body.weights.max(axis=1), body.at_rest(), grows


def _largest_errors(task: tuple[Body, bool, np.ndarray, Poses]) -> np.ndarray:
    """Return the largest errors of channels that rest in the poses `still` (joints,), shape (joints, channels)."""
    part, separate, reaches, still = task
    pairs = zip(_channels(part.poses, separate), _channels(still[:, None], separate), strict=True)
    return np.stack([shell_error(own, held, reaches[:, None]).max(axis=1) for own, held in pairs], axis=1)


def _channels(poses: Poses, separate: bool) -> tuple[Poses, ...]:
    """Return poses (joints, n), or their rotations and their locations as separate poses."""
    if not separate:
        return (poses,)
    nowhere, unturned = (np.broadcast_to(row, (*poses.shape, len(row))) for row in (np.zeros(3), NO_TURN))
    return Poses(nowhere, poses.quaternions, poses.scales), Poses(poses.positions, unturned, poses.scales)


def _stretch_keys(task: tuple[Body, float, bool, np.ndarray, Poses]) -> list[np.ndarray]:
    """Return the keys of each channel of a stretch; channels not in `moves` hold the poses `still` (joints,)."""
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
    # A channel that rests in this stretch may move in others.
    return [own if len(own) > 1 else ends for own in keys]
