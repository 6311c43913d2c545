"""Cleaning: a shaky recording without its trembling, and no sample further from where it was than was allowed.

What is looked for is the motion that is likeliest for the noise that was found: its jerk is as large as it is around
there, so that hits stay hits and what is calm gets smooth. Nothing is to be set.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from .checks import check_poses, check_radii
from .corrections import MIN_MOTION_PER_NOISE, Corrections
from .measures import shell_error
from .modes import interpolate
from .outliers import outliers
from .poses import Poses, joined, numbers
from .skeletons import Skeleton
from .trembling import DIFFERENCE_ORDERS, Trembling, trembling

CAP_ROUNDS = 12
"""In which samples that are too far off are drawn back together with the motion around them, and as many alone."""

MIN_NOISE_RATIO = 1e-3
"""Of the tolerance, or else of the radius: what trembles less is still."""

MAX_STEADY_NOISE_RATIO = 0.97
"""Of the noise by stamped times has to be left by steady ones for these to be right."""

MAX_STAMP_JITTER_STEPS = 0.25
"""Of a step: standard deviation of stamps from steady times, where there may be such."""


@dataclass(frozen=True, eq=False)
class Cleaned:
    """A recording that was cleaned: of one body arrays (n,), of several joints (joints, n).

    See Also
    --------
    clean : What returns it.

    Examples
    --------
    >>> import numpy as np
    >>> from rigid_motion.motion import Poses, clean
    >>> places = np.zeros((60, 3))
    >>> places[40] = 0.2, 0, 0
    >>> cleaned = clean(np.arange(60) / 60, Poses(places, np.tile([1.0, 0, 0, 0], (60, 1))))
    >>> np.flatnonzero(cleaned.spikes).tolist(), cleaned.moved[39:42].round(6).tolist()
    ([40], [0.0, 0.2, 0.0])
    """

    times: np.ndarray
    """Seconds (n,): as stamped, or in steady steps where only the clock trembled."""

    poses: Poses
    moved: np.ndarray
    """How far any point within the radius was moved in the root's space."""

    spikes: np.ndarray
    repeats: np.ndarray
    """Which samples were spikes, and which only repeated the one before: both were left out, and bridged."""

    alone: np.ndarray
    """Which samples were left where they are, or nearly, as motion cannot be told from noise there."""

    noise: np.ndarray
    """What was found to be noise, of places and of rotations in radians, along an axis: (2,), or (2, joints)."""


def clean(
    times: ArrayLike,
    poses: Poses,
    tolerance: float | None = None,
    radius: ArrayLike = 0.1,
    skeleton: Skeleton | None = None,
) -> Cleaned:
    """Take the trembling and the spikes out of a recording.

    Parameters
    ----------
    times : array-like, shape (n,)
        Seconds, strictly rising.
    poses : Poses, shape (n,) or (joints, n)
        As `repair` returns them; those of joints in their parents' space. Scales stay as they are.
    tolerance : float, optional
        How far any point within `radius` may be moved, in the unit of the positions; of spikes and repeated samples,
        which are replaced, anything, and of what hangs on them.
    radius : float or array-like, shape (joints,)
        Of the balls around the origins.
    skeleton : Skeleton, optional
        Which joint hangs on which. Without, none does.

    Returns
    -------
    Cleaned

    Raises
    ------
    TypeError
        Where the recording is no `Poses`.
    ValueError
        Where the shapes do not fit, times do not rise, or the tolerance is not above 0.

    See Also
    --------
    repair : Unit quaternions and rising times.
    reduce_keys : Few keys of what was cleaned.

    Notes
    -----
    Feet that stand are not held: where they tremble they may slide by as much as they are allowed to be moved.

    Examples
    --------
    >>> import numpy as np
    >>> from rigid_motion.motion import Poses, clean
    >>> times, random = np.arange(200) / 100, np.random.default_rng(1)
    >>> places = np.stack([np.sin(times), np.cos(times), times], axis=1)
    >>> shaky = Poses(places + random.normal(size=(200, 3)) * 1e-3, np.tile([1.0, 0, 0, 0], (200, 1)))
    >>> cleaned = clean(times, shaky, tolerance=0.004)
    >>> bool(np.linalg.norm(cleaned.poses.positions - places, axis=1).max() < 0.002), bool(cleaned.moved.max() < 0.004)
    (True, True)
    """
    check_poses(poses, "poses")
    times, radii = numbers(times, "times"), check_radii(radius)
    if times.ndim != 1 or poses.shape[-1:] != times.shape or len(poses.shape) > 2:
        raise ValueError(f"times of shape {times.shape} do not fit poses of shape {poses.shape}")
    if not (np.diff(times) > 0.0).all():
        raise ValueError("times need to rise; repair does that")
    if tolerance is not None and not tolerance > 0.0:
        raise ValueError(f"a tolerance of {tolerance:g} leaves nothing to clean: give more than 0")
    joints = poses if len(poses.shape) == 2 else poses[None]
    skeleton = skeleton or Skeleton(np.full(len(joints.positions), -1))
    if len(skeleton) != joints.shape[0]:
        raise ValueError(f"a skeleton of {len(skeleton)} joints does not fit poses of {joints.shape[0]}")
    radii = np.broadcast_to(radii, len(skeleton))
    times, trembles = _steadied(times, [joints[joint] for joint in range(len(skeleton))])
    least = [MIN_NOISE_RATIO * (tolerance or own) for own in radii.tolist()]
    found = [_Joint(times, joints[own], trembles[own], least[own], radii[own]) for own in range(len(skeleton))]
    cleaned = _within(found, skeleton, radii, tolerance)
    moved = shell_error(skeleton.in_root_space(cleaned), skeleton.in_root_space(joints), radii[:, None])
    spikes, repeats, alone = (
        np.array([getattr(each, name) for each in found]) for name in ("spikes", "repeats", "alone")
    )
    noise = np.array([(each.noise.position, each.noise.rotation) for each in found]).T
    if len(poses.shape) == 2:
        return Cleaned(times, cleaned, moved, spikes, repeats, alone, noise)
    return Cleaned(times, cleaned[0], moved[0], spikes[0], repeats[0], alone[0], noise[:, 0])


class _Joint:
    """What is found of one joint: its noise, the samples that are left out, and its corrections."""

    def __init__(self, times: np.ndarray, poses: Poses, noise: Trembling, least: float, radius: float) -> None:
        self.start, self.noise = poses, _much(noise, least, radius)
        self.spikes, self.repeats = outliers(times, poses, self.noise)
        self.out = self.spikes | self.repeats
        rows = np.flatnonzero(~self.out)
        self.alone = np.zeros(len(times), dtype=bool)
        self.corrections: Corrections | None = None
        if len(rows) <= DIFFERENCE_ORDERS[-1] + 1:
            self.spikes, self.repeats, self.out = np.zeros((3, len(times)), dtype=bool)
            return
        if self.out.any():
            # What trembles is found again without them.
            self.noise = _much(trembling(times[rows], poses[rows]), least, radius)
            here = np.array([np.interp(times, times[rows], each) for each in self.noise.here])
            self.noise = self.noise._replace(here=here)
            self.start = _bridged(times, poses, rows)
        sizes = np.array([[self.noise.position], [self.noise.rotation]])
        self.alone = ~self.out & ((self.noise.here > MIN_MOTION_PER_NOISE * sizes) & (sizes > 0.0)).any(axis=0)
        self.corrections = Corrections(times, self.start, self.noise, self.out)


def _within(found: list[_Joint], skeleton: Skeleton, radii: np.ndarray, tolerance: float | None) -> Poses:
    """Return corrected poses (joints, n), of which all are within the tolerance that hang on nothing left out."""
    count = len(found[0].out)
    share = np.ones((len(found), count))
    bounded = ~np.array([each.out for each in found])
    for joints in skeleton.levels[1:]:
        bounded[joints] &= bounded[skeleton.parents[joints]]
    there = skeleton.in_root_space(joined([each.start[None] for each in found]))
    for attempt in range(2 * CAP_ROUNDS + 1):
        pairs = zip(found, share, strict=True)
        made = [each.corrections.made(own) if each.corrections else each.start for each, own in pairs]
        cleaned = joined([poses[None] for poses in made])
        if tolerance is None:
            return cleaned
        off = shell_error(skeleton.in_root_space(cleaned), there, radii[:, None])
        over = skeleton.most_below(np.where(bounded, off / tolerance, 0.0))
        if (over <= 1.0).all():
            return cleaned
        if attempt < CAP_ROUNDS:
            # As long as that helps, the motion around gives way, too.
            for each, own in zip(found, over, strict=True):
                if each.corrections and own.max() > 1.0:
                    each.corrections.draw_back(own)
        else:
            last = attempt == 2 * CAP_ROUNDS - 1
            share = np.where(over > 1.0, 0.0 if last else share * (1.0 - 1e-9) / np.maximum(over, 1.0), share)
    return cleaned


def _much(noise: Trembling, least: float, radius: float) -> Trembling:
    """Return noise without what is too little to be worth moving anything."""
    position, rotation = (size if size * arm > least else 0.0 for size, arm in ((noise[0], 1.0), (noise[1], radius)))
    return noise._replace(position=position, rotation=rotation)


def _bridged(times: np.ndarray, poses: Poses, rows: np.ndarray) -> Poses:
    """Return poses of which all but these rows are as the motion through these has them."""
    through = interpolate(times[rows], poses[rows], times, "motor_spline")
    positions, quaternions = through.positions.copy(), through.quaternions.copy()
    positions[rows], quaternions[rows] = poses.positions[rows], poses.quaternions[rows]
    return replace(poses, positions=positions, quaternions=quaternions)


def _steadied(times: np.ndarray, joints: list[Poses]) -> tuple[np.ndarray, list[Trembling]]:
    """Return the times by which joints tremble less, as stamped or in steady steps, and by how much each does."""
    stamped = [trembling(times, poses) for poses in joints]
    steps = np.diff(times)
    counts = np.concatenate(([0.0], np.cumsum(np.maximum(np.rint(steps / np.median(steps)), 1.0))))
    pace, begin = np.polyfit(counts, times, 1)
    steady = begin + pace * counts
    if not 1e-6 * pace < np.std(times - steady) < MAX_STAMP_JITTER_STEPS * pace:
        return times, stamped
    even = [trembling(steady, poses) for poses in joints]
    before, after = (np.array([each[:2] for each in noises]).sum(axis=0) for noises in (stamped, even))
    return (steady, even) if (after < MAX_STEADY_NOISE_RATIO * before).all() else (times, stamped)
