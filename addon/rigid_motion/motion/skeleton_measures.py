"""How far bodies are off between keys of their joints: at the samples and between them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from .checks import check_body, check_poses, check_radii, key_samples, whole_number
from .measures import shell_error
from .modes import interpolate, mode_named
from .poses import Poses, numbers
from .skeleton_channels import SeparateKeys, check_separable
from .skeletons import Skeleton

AT_ONCE = 2**17
"""Poses that are looked at in one go, so that long recordings do not fill the memory."""


def skeleton_errors(
    times: ArrayLike,
    poses: Poses,
    parents: ArrayLike,
    keys: Sequence[ArrayLike] | Sequence[SeparateKeys],
    mode: str = "lerp_slerp",
    *,
    radius: float | ArrayLike = 0.03,
    parts: int = 8,
    stored: Poses | None = None,
) -> np.ndarray:
    """Return largest shell error of each joint in the root's space from each sample to the next, between them as well.

    Parameters
    ----------
    times : array-like, shape (n,)
        Strictly rising, in any unit.
    poses : Poses, shape (joints, n)
        The recording: each joint in its parent's space, with unit quaternions. Between its samples, too, it is what the
        mode makes of it.
    parents : array-like of int, shape (joints,)
        The number of each joint's parent, -1 for roots.
    keys : sequence of array-like of int or of SeparateKeys, one for each joint
        As `reduce_skeleton_keys` returns them.
    mode : str
        What fills in between keys, a name in `MODES`.
    radius : float or array-like, shape (joints,)
        Of the ball at each joint that the shell error is of, in the unit of the positions.
    parts : int
        How many moments are looked at from a sample on, evenly spaced: 1 for the samples alone.
    stored : Poses, shape (joints, n), optional
        What is kept at keys, where that is not what was recorded, such as rounded quaternions.

    Returns
    -------
    array, shape (joints, n)
        In the unit of the positions. The last one is that of the last sample alone.

    Raises
    ------
    TypeError, ValueError
        Where the arguments do not fit one another, or make no sense.

    See Also
    --------
    reduce_skeleton_keys : Finds keys that keep to a tolerance at the samples.
    shell_error : The error of one pose.

    Notes
    -----
    Between samples both motions run evenly, so that a joint is hardly ever off by more there than at one of the two:
    in no body of 200 random ones. It is where joints on a chain turn by a radian or more from one sample to the next.

    Examples
    --------
    Two joints that turn against one another, and only the first as recorded:

    >>> import numpy as np
    >>> from rigid_motion.motion import Poses, skeleton_errors
    >>> half = np.array((0.0, 0.4, 0.0))
    >>> turns = np.stack((np.cos(half), 0 * half, 0 * half, np.sin(half)), axis=1)
    >>> poses = Poses(np.tile([[[0, 0, 0]], [[1, 0, 0]]], (1, 3, 1)), [turns, turns * (1, 1, 1, -1)])
    >>> skeleton_errors([0, 1, 2], poses, [-1, 0], [[0, 1, 2], [0, 2]], radius=0.1, parts=2).round(3).tolist()
    [[0.0, 0.0, 0.0], [0.04, 0.078, 0.0]]
    """
    row, skeleton, times = mode_named(mode), Skeleton(parents), numbers(times, "times")
    check_poses(poses, "poses")
    if poses.shape != (len(skeleton), *times.shape) or len(keys) != len(skeleton):
        raise ValueError(
            f"poses of shape {poses.shape} and keys of {len(keys)} joints do not fit {len(skeleton)} joints and "
            f"{times.size} times"
        )
    check_body(times, poses)
    stored = poses if stored is None else stored
    check_poses(stored, "stored poses")
    if stored.shape != poses.shape:
        raise ValueError(f"stored poses of shape {stored.shape} do not fit poses of shape {poses.shape}")
    if whole_number(parts, "parts") < 1:
        raise ValueError(f"parts is {parts}: give 1 for the samples alone, or 8 for eighths")
    radii = check_radii(radius)
    if radii.shape not in ((), (len(skeleton),)):
        raise ValueError(f"radius of shape {radii.shape}: give one number, or one for each of {len(skeleton)} joints")
    radii, count, result = np.broadcast_to(radii, len(skeleton))[:, None], len(times), np.zeros(poses.shape)
    if any(isinstance(own, SeparateKeys) for own in keys):
        check_separable(mode, poses)
    if not count:
        return result
    channels = [
        tuple(_samples(some, count) for some in (own if isinstance(own, SeparateKeys) else (own, own))) for own in keys
    ]
    step, last = max(1, AT_ONCE // (parts * len(skeleton))), count - 1
    for first in range(0, max(last, 1), step):
        end = min(first + step, last)
        between = times[first:end, None] + np.diff(times[first : end + 1])[:, None] * (np.arange(parts) / parts)
        moments = np.append(between, times[end])
        reach = range(first, end + 1), max(row.behind, row.ahead)
        every = _around(np.arange(count), *reach)
        truth = interpolate(times[every], poses[:, every], moments, mode)
        shown = Poses(
            np.empty_like(truth.positions),
            np.empty_like(truth.quaternions),
            None if truth.scales is None else np.empty_like(truth.scales),
        )
        for joint, (rotation, location) in enumerate(channels):
            turning = _around(rotation, *reach)
            shown[joint] = interpolate(times[turning], stored[joint][turning], moments, mode)
            if location is not rotation:
                moving = _around(location, *reach)
                shown.positions[joint] = interpolate(times[moving], stored[joint][moving], moments, mode).positions
        errors = shell_error(skeleton.in_root_space(shown), skeleton.in_root_space(truth), radii)
        result[:, first : end + 1] = np.maximum.reduceat(errors, np.arange(0, len(moments), parts), axis=1)
    return result


def _samples(keys: ArrayLike, count: int) -> np.ndarray:
    """Keys as rising numbers of samples, a single one where the joint or the channel rests."""
    return np.asarray(keys) if np.shape(keys) == (1,) else key_samples(keys, count)


def _around(keys: np.ndarray, samples: range, reach: int) -> np.ndarray:
    """Those of the keys (k,) that have a say in what is between the first and the last of some samples."""
    before = np.searchsorted(keys, samples[0], side="right") - 1 - reach
    return keys[max(before, 0) : np.searchsorted(keys, samples[-1]) + 1 + reach]
