"""Cleaning: a shaky recording without its trembling, and no sample further from where it was than was allowed.

What is looked for is the motion that is likeliest for the noise that was found: its jerk is as large as it is around
there, so that hits stay hits and what is calm gets smooth. Nothing is to be set.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from hashlib import blake2b

import numpy as np
from numpy.typing import ArrayLike

from .checks import check_poses, check_radii
from .contacts import slide_ratios
from .corrections import MIN_MOTION_PER_NOISE, Corrections
from .measures import shell_error
from .modes import interpolate
from .outliers import outliers
from .poses import Poses, joined, numbers
from .skeletons import Skeleton
from .trembling import DIFFERENCE_ORDERS, Trembling, trembling

CAP_ROUNDS = 12
"""In which samples that are too far off are drawn back with the motion around, in as many alone, in as many fully."""

SLIDE_RATIO = 0.25
"""Of the tolerance: how far a joint that stands may get from where it stood at first, unless it got further."""

LOOK_AGAIN_ROUNDS, GIVEN_BACK_SAMPLES = 4, 24
"""What would be a spike if it were cleaned again, as what is at the bound beside what is smooth, gets so many samples
back on either side as they were: where these tremble, too, it is none. Looked for so many times."""

MIN_NOISE_RATIO = 1e-3
"""Of the tolerance, or else of the radius: what trembles less is still."""

MIN_MOVED_PER_NOISE = 0.3
"""Mean squares of what samples are moved by, in those of the noise that was found: where they are less that is none, as
most of it would go, but what motion leaves. So what has been cleaned is not cleaned again."""

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

    stands: np.ndarray
    """Which joints were held as they stood: those that were said to, where they hang on nothing that was left out."""


def clean(
    times: ArrayLike,
    poses: Poses,
    tolerance: float | None = None,
    radius: ArrayLike = 0.1,
    skeleton: Skeleton | None = None,
    looks: Looks | None = None,
    stands: ArrayLike | None = None,
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
    looks : Looks, optional
        What was found when this was cleaned within another tolerance, most of which is found once.
    stands : array-like of bool, shape of the poses, optional
        Which joints stand, and when, as `standing` finds them where a recording is shaky. There none gets further from
        where it stood at first than it did, or than a quarter of the tolerance. Without, feet may slide.

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
    standing : Which joints of a body stand.

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
    standing = np.broadcast_to(np.asarray(stands is not None and stands, dtype=bool), poses.shape)
    radii = np.broadcast_to(radii, len(skeleton))
    look = looks or Looks()
    times, trembles = _steadied(times, [joints[joint] for joint in range(len(skeleton))])
    # The same for all tolerances that are much the same.
    least = [MIN_NOISE_RATIO * 10.0 ** np.floor(np.log10(tolerance or own)) for own in radii.tolist()]
    found = [look(times, joints[own], trembles[own], least[own], radii[own]) for own in range(len(skeleton))]
    cleaned, held = _within(found, skeleton, radii, tolerance, standing)
    # Whatever would be found of these would be no noise.
    still = [_some(each, (False, False)) for each in trembles]
    for _ in range(LOOK_AGAIN_ROUNDS):
        parts = [cleaned[own] for own in range(len(found))]
        again = [look(times, *own) for own in zip(parts, still, least, radii, strict=True)]
        if not any(each.out.any() for each in again):
            break
        for each, other in zip(found, again, strict=True):
            each.give_back(other.out)
        cleaned, held = _within(found, skeleton, radii, tolerance, standing)
    moved = shell_error(skeleton.in_root_space(cleaned), skeleton.in_root_space(joints), radii[:, None])
    spikes, repeats, alone = (
        np.array([getattr(each, name) for each in found]) for name in ("spikes", "repeats", "alone")
    )
    noise = np.array([(each.noise.position, each.noise.rotation) for each in found]).T
    if len(poses.shape) == 2:
        return Cleaned(times, cleaned, moved, spikes, repeats, alone, noise, held)
    return Cleaned(times, cleaned[0], moved[0], spikes[0], repeats[0], alone[0], noise[:, 0], held[0])


class _Joint:
    """What is found of one joint: its noise, the samples that are left out, and its corrections."""

    def __init__(self, times: np.ndarray, poses: Poses, noise: Trembling, least: float, radius: float) -> None:
        left: Trembling | None = noise
        while left is not None:
            left = self._find(times, poses, left, least, radius)

    def _find(self, times: np.ndarray, poses: Poses, noise: Trembling, least: float, radius: float) -> Trembling | None:
        """Find all that for such noise, or return what is left of the noise: the rest was none."""
        self.start, self.noise = poses, _much(noise, least, radius)
        self.share = np.ones(len(times))
        self.spikes, self.repeats = outliers(times, poses, self.noise)
        self.out = self.spikes | self.repeats
        rows = np.flatnonzero(~self.out)
        self.alone = np.zeros(len(times), dtype=bool)
        self.corrections: Corrections | None = None
        if len(rows) <= DIFFERENCE_ORDERS[-1] + 1:
            self.spikes, self.repeats, self.out = np.zeros((3, len(times)), dtype=bool)
            return None
        taken = np.array(self.noise[:2]) > 0.0
        if self.out.any():
            # What trembles is found again without them.
            again = trembling(times[rows], poses[rows])
            here = np.array([np.interp(times, times[rows], each) for each in again.here])
            self.noise = _much(_some(again, taken)._replace(here=here), least, radius)
            self.start = _bridged(times, poses, rows)
        self.corrections = Corrections(times, self.start, self.noise, self.out)
        is_noise = self.corrections.moved > MIN_MOVED_PER_NOISE
        if (is_noise != taken).any():
            # Spikes have to be told by that, too.
            return _some(noise, is_noise)
        sizes = np.array([[self.noise.position], [self.noise.rotation]])
        self.alone = ~self.out & ((self.noise.here > MIN_MOTION_PER_NOISE * sizes) & (sizes > 0.0)).any(axis=0)
        return None

    def copied(self) -> _Joint:
        """Return the same, to be drawn back and given back."""
        result = copy(self)
        result.corrections = self.corrections and self.corrections.copied()
        return result

    def give_back(self, rows: np.ndarray) -> None:
        """Leave what is around rows (n,) of a mask as it was."""
        if not rows.any():
            return
        at, here = np.flatnonzero(rows), np.arange(len(rows))
        following = np.searchsorted(at, here)
        apart = np.minimum(*(np.abs(at[np.clip(following - back, 0, len(at) - 1)] - here) for back in (0, 1)))
        self.share = np.minimum(self.share, np.clip(apart / GIVEN_BACK_SAMPLES - 1.0, 0.0, 1.0))
        self.alone |= ~self.out & (self.share < 1.0)


class Looks:
    """What was found of joints, for when the same are cleaned within another tolerance: of this time and the last."""

    def __init__(self) -> None:
        self._found: dict[bytes, _Joint] = {}
        self._before: dict[bytes, _Joint] = {}

    def turn_over(self) -> None:
        """Forget what has not been looked for since this was called before."""
        self._found, self._before = {}, self._found

    def __call__(self, times: np.ndarray, poses: Poses, noise: Trembling, least: float, radius: float) -> _Joint:
        arrays = times, poses.positions, poses.quaternions, np.array([least, radius, *noise[:2]])
        key = blake2b(b"".join(each.tobytes() for each in arrays)).digest()
        found = self._found.get(key) or self._before.get(key) or _Joint(times, poses, noise, least, radius)
        self._found[key] = found
        return found.copied()


def _within(
    found: list[_Joint], skeleton: Skeleton, radii: np.ndarray, tolerance: float | None, standing: np.ndarray
) -> tuple[Poses, np.ndarray]:
    """Return corrected poses (joints, n), of which all are within the tolerance that hang on nothing left out, and
    which of them are held, as they stand besides: these slide no further than they did or may.
    """
    share = np.array([each.share for each in found])
    bounded = ~np.array([each.out for each in found])
    for joints in skeleton.levels[1:]:
        bounded[joints] &= bounded[skeleton.parents[joints]]
    held = standing.reshape(bounded.shape) & bounded
    limits: ArrayLike | None = tolerance
    there = skeleton.in_root_space(joined([each.start[None] for each in found]))
    for attempt in range(3 * CAP_ROUNDS + 1):
        pairs = zip(found, share, strict=True)
        made = [each.corrections.made(own) if each.corrections else each.start for each, own in pairs]
        cleaned = joined([poses[None] for poses in made])
        shown = skeleton.in_root_space(cleaned)
        off = np.where(bounded, shell_error(shown, there, radii[:, None]), 0.0)
        # What is held back moves nothing around it further than it was to be moved.
        limits = off.max(axis=1, keepdims=True) + 1e-99 if limits is None else limits
        slid = slide_ratios(shown.positions, there.positions, held, SLIDE_RATIO * (tolerance or 0.0))
        over = skeleton.most_below(np.maximum(off / limits, slid))
        if (over <= 1.0).all():
            return cleaned, held
        if attempt < CAP_ROUNDS:
            # As long as that helps, the motion around gives way, too.
            for each, own in zip(found, over, strict=True):
                if each.corrections and own.max() > 1.0:
                    each.corrections.draw_back(own)
        else:
            last = attempt >= 2 * CAP_ROUNDS
            share = np.where(over > 1.0, 0.0 if last else share * (1.0 - 1e-9) / np.maximum(over, 1.0), share)
    return cleaned, held


def _much(noise: Trembling, least: float, radius: float) -> Trembling:
    """Return noise without what is too little to be worth moving anything."""
    position, rotation = (size if size * arm > least else 0.0 for size, arm in ((noise[0], 1.0), (noise[1], radius)))
    return noise._replace(position=position, rotation=rotation)


def _some(noise: Trembling, taken: Sequence[bool] | np.ndarray) -> Trembling:
    """Return the noise of places, rotations, both or none."""
    return noise._replace(position=noise.position * taken[0], rotation=noise.rotation * taken[1])


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
