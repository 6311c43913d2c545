"""Cleaning: removes the jitter of a shaky recording without moving any sample further than allowed.

The result is the motion that is likeliest for the noise that was found. Its jerk is as large as the recording's around
each sample, so that hits stay hits and calm stretches become smooth. There is nothing to set.
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
from .jitter import DIFFERENCE_ORDERS, Jitter, jitter
from .measures import shell_error
from .modes import interpolate
from .outliers import outliers
from .poses import Poses, joined, numbers
from .skeletons import Skeleton

CAP_ROUNDS = 12
"""Rounds of pulling back samples that moved too far: first with their surroundings, then alone, then completely. Each
of the three stages has as many."""

SLIDE_RATIO = 0.25
"""Fraction of the tolerance that a standing joint may slide from where it first stood, unless it did slide further."""

LOOK_AGAIN_ROUNDS, GIVEN_BACK_SAMPLES = 4, 24
"""Rounds of looking for spikes in the cleaned recording, and the samples on either side of one that get their old poses
back. A sample held at the tolerance looks like a spike beside smooth samples, but not where these have jitter, too."""

MIN_NOISE_RATIO = 1e-3
"""Jitter below this fraction of the tolerance (or of the radius, if there is no tolerance) counts as none."""

MIN_MOVED_PER_NOISE = 0.3
"""Mean square of the corrections, in squares of the noise that was found, below which this was no noise: removing noise
moves samples by most of it, but little of motion. So a cleaned recording is not cleaned again."""

MAX_STEADY_NOISE_RATIO = 0.97
"""Steady times replace timestamps only if the noise with them is below this fraction of the noise with timestamps."""

MAX_STAMP_JITTER_STEPS = 0.25
"""Standard deviation of the timestamps from steady times, in steps, up to which steady times are tried."""


@dataclass(frozen=True, eq=False)
class Cleaned:
    """A cleaned recording: arrays have the shape (n,) for one body, (joints, n) for several joints.

    See Also
    --------
    clean : Returns it.

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
    """Seconds (n,): the timestamps, or steady steps if only the clock jittered."""

    poses: Poses
    moved: np.ndarray
    """How far any point within the radius was moved, in root space."""

    spikes: np.ndarray
    repeats: np.ndarray
    """Which samples were spikes, and which only repeated the one before. Both were left out and bridged."""

    alone: np.ndarray
    """Which samples were left unchanged, or nearly, because motion cannot be told from noise there."""

    noise: np.ndarray
    """Standard deviation of the noise along an axis, of positions and of rotations in radians: (2,), or (2, joints)."""

    stands: np.ndarray
    """Which joints were held where they stood, and when: as given, but not below or at samples that were left out."""


def clean(
    times: ArrayLike,
    poses: Poses,
    tolerance: float | None = None,
    radius: ArrayLike = 0.1,
    skeleton: Skeleton | None = None,
    looks: Looks | None = None,
    stands: ArrayLike | None = None,
) -> Cleaned:
    """Remove the jitter and the spikes of a recording.

    Parameters
    ----------
    times : array-like, shape (n,)
        Seconds, strictly rising.
    poses : Poses, shape (n,) or (joints, n)
        As `repair` returns them; joints in the space of their parents. Scales stay as they are.
    tolerance : float, optional
        How far any point within `radius` may be moved, in the unit of the positions. Spikes and repeated samples, which
        are replaced, may be moved any distance, and so may all joints below them.
    radius : float or array-like, shape (joints,)
        The radius of the ball around each origin.
    skeleton : Skeleton, optional
        The parent of each joint. Without a skeleton, no joint has a parent.
    looks : Looks, optional
        A cache of what was found in the same recording for other tolerances, most of which is the same for all.
    stands : array-like of bool, shape of the poses, optional
        Which joints stand, and when, as `standing` finds them in a shaky recording. A standing joint gets no further
        from where it first stood than it did before, or than a quarter of the tolerance. Without it, feet may slide.

    Returns
    -------
    Cleaned

    Raises
    ------
    TypeError
        If the recording is not `Poses`.
    ValueError
        If the shapes do not fit, times do not rise, or the tolerance is not above 0.

    See Also
    --------
    repair : Makes quaternions unit and times rise.
    reduce_keys : Finds few keys of the cleaned recording.
    standing : Finds which joints of a body stand.

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
    times, jitters = _steadied(times, [joints[joint] for joint in range(len(skeleton))])
    # Rounded to a power of ten, so that similar tolerances share the results in the cache.
    least = [MIN_NOISE_RATIO * 10.0 ** np.floor(np.log10(tolerance or own)) for own in radii.tolist()]
    found = [look(times, joints[own], jitters[own], least[own], radii[own]) for own in range(len(skeleton))]
    cleaned, held = _corrected(found, skeleton, radii, tolerance, standing)
    # The recording is clean now: look for spikes without any noise.
    still = [_selected_noise(each, (False, False)) for each in jitters]
    for _ in range(LOOK_AGAIN_ROUNDS):
        parts = [cleaned[own] for own in range(len(found))]
        again = [look(times, *own) for own in zip(parts, still, least, radii, strict=True)]
        if not any(each.out.any() for each in again):
            break
        for each, other in zip(found, again, strict=True):
            each.give_back(other.out)
        cleaned, held = _corrected(found, skeleton, radii, tolerance, standing)
    moved = shell_error(skeleton.in_root_space(cleaned), skeleton.in_root_space(joints), radii[:, None])
    spikes, repeats, alone = (
        np.array([getattr(each, name) for each in found]) for name in ("spikes", "repeats", "alone")
    )
    noise = np.array([(each.noise.position, each.noise.rotation) for each in found]).T
    if len(poses.shape) == 2:
        return Cleaned(times, cleaned, moved, spikes, repeats, alone, noise, held)
    return Cleaned(times, cleaned[0], moved[0], spikes[0], repeats[0], alone[0], noise[:, 0], held[0])


class _Joint:
    """The analysis of one joint: its noise, the samples that are left out, and its corrections."""

    def __init__(self, times: np.ndarray, poses: Poses, noise: Jitter, least: float, radius: float) -> None:
        left: Jitter | None = noise
        while left is not None:
            left = self._analyse(times, poses, left, least, radius)

    def _analyse(self, times: np.ndarray, poses: Poses, noise: Jitter, least: float, radius: float) -> Jitter | None:
        """Find everything for this noise, or return the rest of the noise if part of it turns out not to be noise."""
        self.start, self.noise = poses, _significant_noise(noise, least, radius)
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
            # Measure the jitter again without these samples.
            again = jitter(times[rows], poses[rows])
            here = np.array([np.interp(times, times[rows], each) for each in again.here])
            self.noise = _significant_noise(_selected_noise(again, taken)._replace(here=here), least, radius)
            self.start = _bridged(times, poses, rows)
        self.corrections = Corrections(times, self.start, self.noise, self.out)
        is_noise = self.corrections.moved > MIN_MOVED_PER_NOISE
        if (is_noise != taken).any():
            # Spikes depend on the noise, too: find them again.
            return _selected_noise(noise, is_noise)
        sizes = np.array([[self.noise.position], [self.noise.rotation]])
        self.alone = ~self.out & ((self.noise.here > MIN_MOTION_PER_NOISE * sizes) & (sizes > 0.0)).any(axis=0)
        return None

    def copied(self) -> _Joint:
        """Return a copy whose corrections can be changed."""
        result = copy(self)
        result.corrections = self.corrections and self.corrections.copied()
        return result

    def give_back(self, rows: np.ndarray) -> None:
        """Undo the corrections around the marked rows (n,)."""
        if not rows.any():
            return
        at, here = np.flatnonzero(rows), np.arange(len(rows))
        following = np.searchsorted(at, here)
        apart = np.minimum(*(np.abs(at[np.clip(following - back, 0, len(at) - 1)] - here) for back in (0, 1)))
        self.share = np.minimum(self.share, np.clip(apart / GIVEN_BACK_SAMPLES - 1.0, 0.0, 1.0))
        self.alone |= ~self.out & (self.share < 1.0)


class Looks:
    """A cache of joint analyses for cleaning the same joints within another tolerance."""

    def __init__(self) -> None:
        self._found: dict[bytes, _Joint] = {}
        self._before: dict[bytes, _Joint] = {}

    def turn_over(self) -> None:
        """Drop the entries that were not used since the previous call."""
        self._found, self._before = {}, self._found

    def __call__(self, times: np.ndarray, poses: Poses, noise: Jitter, least: float, radius: float) -> _Joint:
        arrays = times, poses.positions, poses.quaternions, np.array([least, radius, *noise[:2]])
        key = blake2b(b"".join(each.tobytes() for each in arrays)).digest()
        found = self._found.get(key) or self._before.get(key) or _Joint(times, poses, noise, least, radius)
        self._found[key] = found
        return found.copied()


def _corrected(
    found: list[_Joint], skeleton: Skeleton, radii: np.ndarray, tolerance: float | None, standing: np.ndarray
) -> tuple[Poses, np.ndarray]:
    """Return corrected poses (joints, n), and which joints are held where they stand (joints, n).

    All samples are within the tolerance, except those that are left out and the joints below them. Joints that are held
    slide no further than they did before, or than allowed.
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
        # Without a tolerance, pulling samples back must not move the samples around them further than the first result.
        limits = off.max(axis=1, keepdims=True) + 1e-99 if limits is None else limits
        slid = slide_ratios(shown.positions, there.positions, held, SLIDE_RATIO * (tolerance or 0.0))
        over = skeleton.most_below(np.maximum(off / limits, slid))
        if (over <= 1.0).all():
            return cleaned, held
        if attempt < CAP_ROUNDS:
            # At first, the surrounding motion gives way, too.
            for each, own in zip(found, over, strict=True):
                if each.corrections and own.max() > 1.0:
                    each.corrections.draw_back(own)
        else:
            last = attempt >= 2 * CAP_ROUNDS
            share = np.where(over > 1.0, 0.0 if last else share * (1.0 - 1e-9) / np.maximum(over, 1.0), share)
    return cleaned, held


def _significant_noise(noise: Jitter, least: float, radius: float) -> Jitter:
    """Return the noise, or zero where it is too small to be worth moving anything."""
    position, rotation = (size if size * arm > least else 0.0 for size, arm in ((noise[0], 1.0), (noise[1], radius)))
    return noise._replace(position=position, rotation=rotation)


def _selected_noise(noise: Jitter, taken: Sequence[bool] | np.ndarray) -> Jitter:
    """Return the noise of positions, rotations, both or none."""
    return noise._replace(position=noise.position * taken[0], rotation=noise.rotation * taken[1])


def _bridged(times: np.ndarray, poses: Poses, rows: np.ndarray) -> Poses:
    """Return poses where all but these rows follow the interpolated motion through these rows."""
    through = interpolate(times[rows], poses[rows], times, "motor_spline")
    positions, quaternions = through.positions.copy(), through.quaternions.copy()
    positions[rows], quaternions[rows] = poses.positions[rows], poses.quaternions[rows]
    return replace(poses, positions=positions, quaternions=quaternions)


def _steadied(times: np.ndarray, joints: list[Poses]) -> tuple[np.ndarray, list[Jitter]]:
    """Return the times with less jitter, timestamps or steady steps, and the jitter of each joint with them."""
    stamped = [jitter(times, poses) for poses in joints]
    steps = np.diff(times)
    counts = np.concatenate(([0.0], np.cumsum(np.maximum(np.rint(steps / np.median(steps)), 1.0))))
    pace, begin = np.polyfit(counts, times, 1)
    steady = begin + pace * counts
    if not 1e-6 * pace < np.std(times - steady) < MAX_STAMP_JITTER_STEPS * pace:
        return times, stamped
    even = [jitter(steady, poses) for poses in joints]
    before, after = (np.array([each[:2] for each in noises]).sum(axis=0) for noises in (stamped, even))
    return (steady, even) if (after < MAX_STEADY_NOISE_RATIO * before).all() else (times, stamped)
