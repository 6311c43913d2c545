"""Key reduction of skeletons: few keys for all joints of a body.

The final positions count: an error of a joint moves all joints below it. The error is therefore measured in the root's
space, through the hierarchy, at every joint and sample. Joints have separate keys, or all of them share *key poses*, as
animators work from pose to pose.

Source: the error in the space of the whole object follows the Animation Compression Library. Shared key poses follow
Roberts, Lewis and Anjyo, "Optimal and interactive keyframe selection for motion capture", 2019.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from .bodies import Body
from .checks import check_body, check_flag, check_poses, check_wishes, whole_number
from .key_budget import fewest_keys
from .key_costs import SampleTracks
from .modes import MODES, mode_named
from .poses import MAX_ABS, Poses, aligned, numbers, packed
from .skeleton_channels import Channels, SeparateKeys, check_separable
from .skeleton_search import ZERO_WEIGHT, ChannelKeys, OwnKeys, that_move
from .skeleton_stretches import Run, keys_in_stretches, stretches
from .skeletons import Skeleton

BUDGET_STEPS = 9
"""Steps of the search for the tolerance that a budget of separate keys can meet."""

MAX_LOG_TOLERANCE_STEP = 1.5
"""Decrease of the logarithm of the tolerance, until a tolerance needs more keys than the budget."""

LOG_TOLERANCE_PRECISION = 0.01
"""Final precision of the logarithm of the tolerance."""

MAX_JOINT_DEPTH = 1000
"""The most joints above a joint with separate keys: the work grows with the square of this number."""

SHORTEST_STRETCH = 2
"""The least samples from one shared key to the next."""

MAX_LOG_TOLERANCE_DROP = 12.0
"""The largest decrease of the logarithm of the tolerance, from the error of a body at rest."""


def reduce_skeleton_keys(
    times: ArrayLike,
    poses: Poses,
    parents: ArrayLike,
    mode: str = "motor_spline",
    *,
    tolerance: float | None = None,
    radius: float | ArrayLike = 0.03,
    shared: bool = False,
    separate: bool = False,
    budget: int | None = None,
    weights: ArrayLike | None = None,
    fixed: ArrayLike | None = None,
    tries: int = 2,
    stretch: int | None = None,
    run: Run = map,
) -> tuple[np.ndarray, ...] | tuple[SeparateKeys, ...]:
    """Return the fewest keys of joints that keep every joint within a tolerance, or the best ones within a budget.

    Parameters
    ----------
    times : array-like, shape (n,)
        Strictly rising, in any unit.
    poses : Poses, shape (joints, n)
        The recording: each joint in its parent's space, with unit quaternions.
    parents : array-like of int, shape (joints,)
        The number of each joint's parent, -1 for roots.
    mode : str
        The interpolation between keys, a name in `MODES`.
    tolerance : float, optional
        The largest shell error of any joint at any sample, in the root's space and in the unit of the positions.
    radius : float or array-like, shape (joints,)
        The radius of the ball at each joint for the shell error, in the unit of the positions.
    shared : bool
        Key poses: all joints have keys at the same samples. Otherwise each joint has separate keys, the fewest in
        total.
    separate : bool
        Rotation and location of each joint have separate keys, for modes where they are independent, as in
        `lerp_slerp`, and for joints whose scale does not change. With 4 numbers for a rotation and 3 for a location,
        they never need more numbers than the keys of whole joints, and mostly a fifth to two fifths fewer.
    budget : int, optional
        The maximum number of keys, instead of a tolerance: key poses, at least 2, or keys of all joints together, at
        least 2 for each joint. With `separate`, keys of rotations and locations count, at least 2 for each, or 1 if it
        never changes. The error is then as small as possible: for key poses as in `reduce_keys`, for separate keys by
        bisecting the tolerance, which takes about as long as ten searches.
    weights : array-like, shape (joints,) or (joints, n), optional
        The weight of each joint's error, at each sample: more for feet that stand (see `standing`) and hands that hold,
        0 for joints that do not matter. A joint of weight 2 stays within half the tolerance.
    fixed : array-like of bool, shape (joints,), optional
        Joints that stay as recorded: they move with their parents, and the joints below them are measured.
    tries : int
        With `shared`, as in `reduce_keys`.
    stretch : int, optional
        For long recordings, with a tolerance and in modes that are not smooth: all moving joints share keys after every
        stretch of at most this many samples, and each stretch is searched separately. This takes the memory of one
        stretch, less time, and with 1000 to 2000 samples at 60 Hz up to 0.4 % more keys.
    run : callable
        Runs the searches of stretches, called like `map`: `ProcessPoolExecutor().map` runs them in parallel.

    Returns
    -------
    tuple of array of int, one for each joint
        The samples with keys, rising. A joint that need not move has a single sample, whose pose it holds. Other joints
        include the first and the last sample, and fixed joints have all samples. With `separate`, a tuple of
        `SeparateKeys`, and the same holds for rotations and locations. A channel that never changes has only the first
        sample. With `stretch`, that may be another sample, and a fixed channel that moves nothing may have one, too.

    Raises
    ------
    TypeError
        If the recording is not a `Poses`.
    ValueError
        As `reduce_keys` does, and if parents form a cycle, if chains are longer than 1000 joints without `shared`, or
        if radii or weights are not sensible numbers. The message names the joint.

    See Also
    --------
    reduce_keys : The same for one object.
    SeparateKeys : The keys of each joint with `separate`.
    standing : Which joints stand on the ground, for weights.

    Notes
    -----
    The error in the space of the whole object follows the Animation Compression Library. Shared key poses follow
    Roberts, Lewis and Anjyo, "Optimal and interactive keyframe selection for motion capture", 2019.

    Examples
    --------
    An elbow that turns evenly about its z axis, below a shoulder that does not move:

    >>> import numpy as np
    >>> from rigid_motion.motion import Poses, reduce_skeleton_keys
    >>> turn = np.linspace(0, np.pi / 2, 30)
    >>> positions = np.tile([[[0, 0, 1.4]], [[0.3, 0, 0]]], (1, 30, 1))
    >>> elbow = np.stack((np.cos(turn / 2), 0 * turn, 0 * turn, np.sin(turn / 2)), axis=1)
    >>> poses = Poses(positions, [np.tile([1, 0, 0, 0], (30, 1)), elbow])
    >>> keys = reduce_skeleton_keys(np.arange(30) / 30, poses, [-1, 0], "dq_sclerp", tolerance=0.002)
    >>> [samples.tolist() for samples in keys]
    [[0], [0, 29]]
    """
    mode_named(mode)
    check_wishes(tolerance, budget, tries)
    check_flag(shared, "shared")
    check_flag(separate, "separate")
    if shared and separate:
        raise ValueError("key poses are whole poses: give one of shared=True and separate=True, not both")
    check_poses(poses, "poses")
    skeleton, times = Skeleton(parents), numbers(times, "times")
    if poses.shape != (len(skeleton), *times.shape):
        raise ValueError(f"poses of shape {poses.shape} do not fit {len(skeleton)} joints and {times.size} times")
    check_body(times, poses)
    radii = _values_for_joints(radius, "radius", (len(skeleton),))
    weights = _values_for_joints(1.0 if weights is None else weights, "weight", (len(skeleton),), poses.shape)
    if not np.any(weights > 0.0):
        raise ValueError("every joint has a weight of 0: nothing would matter")
    weights = np.broadcast_to(weights if weights.ndim == 2 else weights[:, None], poses.shape)
    free = ~_fixed_mask(fixed, len(skeleton))
    if separate:
        check_separable(mode, poses)
    if stretch is not None:
        _check_stretch(stretch, mode, shared, tolerance)
    if not shared and len(times) > 1 and skeleton.depths.max() > MAX_JOINT_DEPTH:
        joint = int(np.argmax(skeleton.depths))
        raise ValueError(
            f"joint {joint} hangs on {skeleton.depths[joint]} others, and keys of their own are searched for where it "
            f"is {MAX_JOINT_DEPTH} at most: shared=True finds key poses for longer chains"
        )

    def part(some: slice) -> Body:
        return Body(times[some], aligned(poses[:, some]), skeleton, mode, radii, weights[:, some], free)

    if stretch is not None and tolerance is not None and len(times) > stretch + 1:
        return keys_in_stretches(part, tolerance, separate, stretches(len(times), stretch), run)
    body = part(slice(None))
    channels = Channels(body) if separate else None
    if budget is not None and channels:
        budget = channels.budget(budget)
    elif budget is not None and not shared and budget < 2 * np.count_nonzero(free):
        raise ValueError(f"a budget of {budget} keys is too small for {np.count_nonzero(free)} joints: each may need 2")
    if len(times) <= 1:
        every = np.arange(len(times))
        return (SeparateKeys(every, every),) * len(skeleton) if separate else (every,) * len(skeleton)
    if shared:
        key_poses, every = fewest_keys(_WholeBody(body, tolerance or 1.0), budget, tries), np.arange(len(times))
        return tuple(key_poses if moves else every for moves in free.tolist())
    search = functools.partial(OwnKeys, body) if channels is None else functools.partial(ChannelKeys, channels)
    if tolerance is not None:
        keys = search(tolerance).found()
    else:
        assert budget is not None  # one of them is there
        keys = _own_keys_within(search, budget)
    return keys if channels is None else channels.of_joints(keys)


def _check_stretch(stretch: int, mode: str, shared: bool, tolerance: float | None) -> None:
    """Raise a TypeError if a stretch is not a whole number, a ValueError if it is too short or cannot be used here."""
    if whole_number(stretch, "stretch") < SHORTEST_STRETCH:
        raise ValueError(f"a stretch of {stretch} samples is too short: give {SHORTEST_STRETCH} or more")
    if shared or tolerance is None:
        raise ValueError("stretches are for keys of each joint's own within a tolerance: leave out shared and budget")
    if MODES[mode].is_smooth:
        raise ValueError(
            f"{mode} is smooth, so that keys count beyond the segments next to them: leave out stretch, or take one of "
            + ", ".join(name for name, row in MODES.items() if not row.is_smooth)
        )


def _own_keys_within(search_for: Callable[[float], OwnKeys], budget: int) -> tuple[np.ndarray, ...]:
    """Return the keys with the smallest error among searches with several tolerances that stay within the budget."""
    best = search_for(math.inf)
    body = best.body
    free = np.flatnonzero(body.free).tolist()
    least = float(body.errors(body.at_rest()).max())
    # Pairs of log tolerance and log key count: `low` needs more keys than the budget, `high` does not.
    low, high = None, (math.log(max(least, ZERO_WEIGHT)), math.log(len(free) or 1))
    lowest = high[0] - MAX_LOG_TOLERANCE_DROP
    for _ in range(BUDGET_STEPS):
        logarithm = _next_log_tolerance(low, high, math.log(budget))
        if logarithm < lowest or (low and high[0] - low[0] < LOG_TOLERANCE_PRECISION):
            break
        search = search_for(math.exp(logarithm))
        count = sum(len(keys) for joint, keys in enumerate(search.found()) if body.free[joint])
        if count > budget:
            low = logarithm, math.log(count)
            continue
        high, error = (logarithm, math.log(count)), float(body.errors(search.shown).max())
        if error <= least:
            best, least = search, error
    best.spend(budget)
    return tuple(best.keys)


def _next_log_tolerance(low: tuple[float, float] | None, high: tuple[float, float], count: float) -> float:
    """Return the logarithm of the tolerance to try next for the logarithm of a key count.

    It lies on a straight line between a tolerance that is too low and one that is not, but never near the ends of that
    line, as key counts are not a smooth function of tolerances.
    """
    if low is None:
        return high[0] - MAX_LOG_TOLERANCE_STEP
    share = (count - high[1]) / (low[1] - high[1]) if low[1] > high[1] else 0.5
    return high[0] + min(max(share, 0.25), 0.75) * (low[0] - high[0])


class _WholeBody(SampleTracks):
    """All joints at once, with the same keys. The error of a sample is the largest error of any joint."""

    def __init__(self, body: Body, tolerance: float) -> None:
        # Joints that never move in their parents' space are the same with any keys.
        moves = that_move(body.poses) & body.free
        moves[0] |= not moves.any()
        super().__init__(body.times, body.poses[moves], body.mode, 0.0, tolerance)
        self.body, self.moving, self.everything = body, np.flatnonzero(moves), packed(body.poses)

    def errors(self, samples: np.ndarray, shown: Poses) -> np.ndarray:
        everything = self.everything[samples]
        everything[self.moving] = shown
        return self.in_tolerances(self.body.errors(everything, samples).max(axis=0), samples)


def _fixed_mask(fixed: ArrayLike | None, joints: int) -> np.ndarray:
    """Return which joints are fixed, shape (joints,). Joint indices raise a ValueError: 0 and 1 would be ambiguous."""
    mask = np.zeros(joints, dtype=bool) if fixed is None else np.asarray(fixed)
    if mask.dtype != bool or mask.shape not in ((), (joints,)):
        raise ValueError(
            f"fixed needs True or False for each of {joints} joints: np.isin(np.arange({joints}), fixed) makes that of "
            "numbers of joints"
        )
    return np.broadcast_to(mask, (joints,))


def _values_for_joints(given: ArrayLike, name: str, *shapes: tuple[int, ...]) -> np.ndarray:
    """Return the numbers, with a single one broadcast to the first shape. Raise a ValueError for invalid numbers."""
    given = numbers(given, f"{name}s")
    if given.shape not in ((), *shapes):
        desired = " or ".join(map(str, shapes))
        raise ValueError(f"{name} of shape {given.shape}: give one number, or an array of shape {desired}")
    given = np.broadcast_to(given, shapes[0]) if given.ndim == 0 else given
    if not (valid := (given == 0.0) | ((given > 1.0 / MAX_ABS) & (given < MAX_ABS))).all():
        joint = np.argwhere(~valid)[0]
        raise ValueError(
            f"joint {joint[0]} has a {name} of {given[tuple(joint)]}: give 0, or a number from {1.0 / MAX_ABS:g} to "
            f"{MAX_ABS:g}"
        )
    return given
