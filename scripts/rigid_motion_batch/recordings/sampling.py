"""Sampling of a motion: enough samples that interpolation between them is accurate.

A recording is evaluated on even frames, and at every key of every F-curve. If Blender's motion between two samples
differs from interpolation by lines and even turns (`lerp_slerp`), the gap between them is halved, and its halves again.
Everyday recordings, with a key on every frame, stay as they are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigid_motion.motion import Poses, Skeleton
from rigid_motion.motion.algebras.vector_quaternion import lerp_slerp
from rigid_motion.motion.decimation import nearest
from rigid_motion.motion.poses import reshaped
from rigid_motion.motion.quaternions import align_signs, angle_between

from .clips import ClipWarning
from .matrices import filled, growing
from .recordings import MOST_POSES, Trajectory
from .rest_bodies import RestBody, in_parents

MAX_GAP_ERROR_M = 1e-3
"""Metres: the largest interpolation error between two samples."""

OF_JOINTS, OF_OBJECTS = 0.03, 0.1
"""Radius in metres around a joint and an object within which errors of all points count, as in comparisons."""

HALVING_ERROR_RATIO = 0.6
"""Fraction of that error at which a gap is halved: checks see at least 3/4 of the largest error of a cubic curve."""

LOOK_PLACES = np.array([0.25, 0.75])
"""Places in a gap that are checked. Half-way, an ease in and out would look like a straight line."""

HALF_WAY = np.array([0.5])
"""Place where straight curves are checked: several combined bend to one side."""

MAX_LINE_TURN_RAD = np.radians(20.0)
"""Turns between samples above this angle are checked like eased ones: linearly interpolated quaternions ease a turn."""

MAX_GAP_HALVINGS = 8
"""How often a gap may be halved."""

MIN_KEY_GAP_STEPS = 0.0125
"""Keys closer than this, in steps of the recording, count as one: Blender ignores a hundredth of a frame."""

JUMP_STEPS = 2.0 * MIN_KEY_GAP_STEPS
"""Duration of a jump, in steps of the recording."""

MAX_SAME_GAP_STEPS = 2e-3
"""Steps by which equal gaps may differ: F-curves store frames in single precision."""

MAX_KEYS_PER_S, MIN_KEYS_PER_S = 240.0, 5.0
"""Largest and smallest number of keys a second that is taken as the rate of a file."""

MAX_ROUND_RATE_ERROR = 2e-4
"""Ratio by which a whole-number rate may be off: 29.97 is not a whole number."""

ON_A_FRAME = 1e-4
"""Distance from a whole frame within which a key is on it."""

MAX_MULTIPLE_ERROR = 0.05
"""Fraction of the smallest gap between keys by which other gaps may deviate from its multiples."""

MAX_SAMPLES_PER_KEY = 4.0
"""Largest average number of samples per key in a thinned curve."""

MIN_FLIP_RAD = np.radians(60.0)
"""Turn between two samples and back, above which Euler angles have jumped by a whole turn."""

MOST_ADDED = 20
"""Added samples per original sample: noise could require any number."""

BLOCK_GAPS = 256
"""Gaps checked at once."""


@dataclass(frozen=True, eq=False)
class Moments:
    """The first moments at which a recording is sampled."""

    frames: np.ndarray
    """Frames of shape (n,), increasing, not only whole ones."""

    fps: float
    """Frames a second."""

    begin: float = 0.0
    """The frame at which the time is 0."""

    step: float = 1.0
    """Frames between two samples of the recording."""

    straight: bool = False
    """True if all keys are connected by straight lines or steps."""

    def times(self, frames: np.ndarray) -> np.ndarray:
        """Return the times of frames, in seconds."""
        return (frames - self.begin) / self.fps


def merged(even: np.ndarray, keys: np.ndarray, step: float) -> np.ndarray:
    """Return even frames (n,), increasing, merged with the keys between the first and last of them.

    A key near an even frame is replaced by it; of several keys near each other, the first is kept.
    """
    keys = np.unique(keys[(keys > even[0]) & (keys < even[-1])])
    kept: list[float] = []
    for key in keys[distances_to_nearest(keys, even) >= MIN_KEY_GAP_STEPS * step].tolist():
        if not kept or key - kept[-1] >= MIN_KEY_GAP_STEPS * step:
            kept.append(key)
    return np.sort(np.concatenate((even, kept)))


def moments_between(first: float, last: float, fps: float, step: float, keys: np.ndarray, *, straight: bool) -> Moments:
    """Return even frames from the first to the last frame, and all keys (n,) between, given in any order."""
    even = first + step * np.arange(int((last - first) / step + MAX_SAME_GAP_STEPS) + 1)
    if last - even[-1] > MAX_SAME_GAP_STEPS * step:
        even = np.append(even, last)
    frames = on_frames(merged(even, keys, step))
    return Moments(frames, fps, float(frames[0]), step, straight)


def on_frames(frames: np.ndarray) -> np.ndarray:
    """Return frames, with those near whole frames rounded."""
    whole = np.rint(frames)
    return np.where(np.abs(frames - whole) < ON_A_FRAME, whole, frames)


def rate_of(keys: Iterable[np.ndarray], fps: float) -> float | None:
    """Return the highest number of keys a second of any F-curve; None if no recording has such a rate.

    `keys` are the frames of each curve's keys, increasing, at `fps` frames a second. Curves with even gaps, and thinned
    ones with gaps that are multiples of the smallest, take precedence over uneven ones.
    """
    rates: dict[bool, list[float]] = {True: [], False: []}
    for frames in keys:
        gaps = np.diff(frames)
        if len(gaps := gaps[gaps > ON_A_FRAME]):
            times = gaps / gaps.min()
            even = np.abs(times - np.rint(times)).max() < MAX_MULTIPLE_ERROR and times.mean() < MAX_SAMPLES_PER_KEY
            rate = fps / (gaps.sum() / np.rint(times).sum() if even else float(np.median(gaps)))
            rates[bool(even)].append(
                float(round(rate)) if abs(rate - round(rate)) < MAX_ROUND_RATE_ERROR * rate else rate
            )
    of_recordings = [[rate for rate in some if MIN_KEYS_PER_S <= rate <= MAX_KEYS_PER_S] for some in rates.values()]
    return max(of_recordings[0] or of_recordings[1], default=None)


def distances_to_nearest(frames: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return the distance of each frame to the nearest of `others`, which are increasing; shape of the frames."""
    return np.abs(frames - others[nearest(others, frames)]) if len(others) else np.full(len(frames), np.inf)


@dataclass(frozen=True, eq=False)
class Sampled:
    """Samples of a motion, and the problems found in the gaps between them."""

    frames: np.ndarray
    """Shape (n,), increasing."""

    poses: Poses
    """Poses in the world, shape (joints, n)."""

    added: int = 0
    """Number of samples added by halving gaps."""

    off: float = 0.0
    """Largest error between two samples where halving does not help, in the unit of the poses; else 0."""

    gaps: tuple[float, ...] = ()
    """The first frames of these gaps."""

    flips: int = 0
    """Number of gaps in which a joint turns over and back."""

    def as_body(
        self,
        name: str,
        moments: Moments,
        metres: float,
        rest_body: RestBody,
        metres_per_unit: float = 1.0,
        remark: str = "",
    ) -> Trajectory:
        """Return the joints as a whole body, each in its parent's space, with rate and remarks as in `described`."""
        with np.errstate(invalid="ignore", over="ignore"):
            local = in_parents(filled(self.poses), rest_body.parents)
        poses = Poses(local.positions, align_signs(local.quaternions))
        body = Trajectory(name, moments.times(self.frames), poses, metres_per_unit, remark, rest_body=rest_body)
        return self.described(body, moments, metres)

    def as_singles(self, names: Sequence[str], moments: Moments, metres: float, remark: str = "") -> list[Trajectory]:
        """Return a trajectory in the world for each joint or object; the remarks are on the first."""
        times, poses, rate = moments.times(self.frames), filled(self.poses), moments.fps / moments.step
        first, *others = (
            Trajectory(name, times, growing(own), rate=rate) for name, own in zip(names, poses, strict=True)
        )
        return [self.described(replace(first, remark=remark), moments, metres), *others]

    def described(self, trajectory: Trajectory, moments: Moments, metres: float) -> Trajectory:
        """Return a trajectory of these samples with rate, remarks and warnings; `metres` is the metres per unit."""
        remarks, warnings = [trajectory.remark], trajectory.warnings
        if self.added:
            remarks.append(f"added {self.added} samples between frames, where it bends by more than a millimetre")
        if self.flips:
            remarks.append(
                f"between {self.flips} pairs of samples a joint turns over and back, as angles do that jump by a turn; "
                "taken to go the short way"
            )
        if self.gaps:
            first, count = moments.times(np.array(self.gaps[:1]))[0], len(self.gaps)
            text = (
                f"it jumps, or swings too fast, in {count} gap{'s' * (count > 1)} between samples, first at "
                f"{first:.4g} s: what lies there is up to {1e3 * metres * self.off:.3g} mm off a straight way"
            )
            warnings += (ClipWarning(text, "give it keys at such moments, or smooth the curves", float(first)),)
        rate = moments.fps / moments.step
        return replace(trajectory, remark="; ".join(filter(None, remarks)), warnings=warnings, rate=rate)


def sampled(
    moments: Moments, look: Callable[[np.ndarray], Poses], parents: np.ndarray, radius: float, metres: float
) -> Sampled:
    """Sample a motion, and again between samples where interpolation is inaccurate.

    Parameters
    ----------
    moments : Moments
    look : callable
        Given frames (n,), increasing: the poses in the world, shape (joints, n). Non-finite poses are ignored.
    parents : array of int, shape (joints,)
        Joints are interpolated in the space of their parents.
    radius : float
        Metres: the radius of the ball around each joint within which errors of all points count.
    metres : float
        The length of the poses' unit.
    """
    gaps = _Gaps(look, Skeleton(parents), radius / metres, moments.straight)
    frames, poses = moments.frames, look(moments.frames)
    allowed, most = (
        HALVING_ERROR_RATIO * MAX_GAP_ERROR_M / metres,
        min((1 + MOST_ADDED) * len(frames), MOST_POSES // len(parents)),
    )
    closest, longest = MIN_KEY_GAP_STEPS * moments.step, moments.step * (1.0 + MAX_SAME_GAP_STEPS)
    unsure, before, flips = np.arange(len(frames) - 1), len(frames), 0
    left: dict[float, float] = {}
    for halving in range(MAX_GAP_HALVINGS + 1):
        errors, turned = gaps.errors(frames, poses, unsure)
        lengths = np.diff(frames)[unsure]
        over = (turned > MIN_FLIP_RAD) & (lengths <= longest) if halving == 0 else np.zeros(len(unsure), dtype=bool)
        flips += int(np.count_nonzero(over))
        off = (errors > allowed) & ~over
        halved = off & (lengths > 2.1 * closest) & (halving < MAX_GAP_HALVINGS)
        if len(frames) + np.count_nonzero(halved) > most:
            halved[:] = False
        left |= dict(zip(frames[unsure[off & ~halved]].tolist(), errors[off & ~halved].tolist(), strict=True))
        split = unsure[halved]
        if not len(split):
            break
        middles = (frames[split] + frames[split + 1]) / 2.0
        poses = _inserted(poses, split + 1, look(middles))
        frames = np.insert(frames, split + 1, middles)
        begins = split + np.arange(len(split))
        unsure = np.ravel((begins, begins + 1), order="F")
    off = {frame: error for frame, error in left.items() if error > MAX_GAP_ERROR_M / metres}
    return Sampled(frames, poses, len(frames) - before, max(off.values(), default=0.0), tuple(sorted(off)), flips)


@dataclass(frozen=True, eq=False)
class _Gaps:
    """Interpolation errors in the gaps between samples."""

    look: Callable[[np.ndarray], Poses]
    skeleton: Skeleton
    radius: float
    straight: bool

    def errors(self, frames: np.ndarray, poses: Poses, gaps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the largest error in distance and angle of any joint in these gaps (n,), shape (n,) each."""
        errors, angles = np.zeros(len(gaps)), np.zeros(len(gaps))
        for first in range(0, len(gaps), BLOCK_GAPS):
            rows = np.arange(first, min(first + BLOCK_GAPS, len(gaps)))
            begin, end = poses[:, gaps[rows]], poses[:, gaps[rows] + 1]
            with np.errstate(invalid="ignore", over="ignore"):
                turns = angle_between(begin.quaternions, end.quaternions)
            eased = ~(np.nan_to_num(turns).max(axis=0) < MAX_LINE_TURN_RAD) | (not self.straight)
            for some, looks in ((eased, LOOK_PLACES), (~eased, HALF_WAY)):
                if some.any():
                    places = frames[gaps[rows[some]]], frames[gaps[rows[some]] + 1]
                    result = self._gap_errors(*places, begin[:, some], end[:, some], looks)
                    errors[rows[some]], angles[rows[some]] = result
        return errors, angles

    def _gap_errors(
        self, first: np.ndarray, last: np.ndarray, begin: Poses, end: Poses, looks: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the errors of gaps between the first and last frames (n,), with poses (joints, n) at both ends."""
        seen = self.look((first[:, None] + (last - first)[:, None] * looks).ravel())
        # Damaged poses, and ones without a direction, do not require more samples.
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            begin, end = (in_parents(some, self.skeleton.parents) for some in (begin, end))
            straight = self.skeleton.in_root_space(_between(begin, end, looks))
            angle = angle_between(seen.quaternions, straight.quaternions)
            error = np.linalg.norm(seen.positions - straight.positions, axis=-1)
            error += 2.0 * self.radius * np.sin(angle / 2.0)
            if seen.scales is not None or straight.scales is not None:
                error += self.radius * np.abs(_scales(seen) - _scales(straight))
        error, angle = (np.where(np.isfinite(some), some, 0.0).max(axis=0) for some in (error, angle))
        return error.reshape(-1, len(looks)).max(axis=1), angle.reshape(-1, len(looks)).max(axis=1)


def _between(a: Poses, b: Poses, looks: np.ndarray) -> Poses:
    """Return poses (joints, n k) interpolated by lines and even turns between poses (joints, n), at the places (k,)."""
    turned = align_signs(np.stack((a.quaternions, b.quaternions), axis=-2))[..., 1, :]
    straight = lerp_slerp(a[..., None], Poses(b.positions, turned, b.scales)[..., None], looks)
    return reshaped(straight, len(a), -1)


def _scales(poses: Poses) -> np.ndarray:
    return np.ones(poses.shape) if poses.scales is None else poses.scales


def _inserted(poses: Poses, places: np.ndarray, more: Poses) -> Poses:
    """Return poses (joints, n) with `more` poses (joints, k) inserted before these places (k,)."""
    scales = None
    if poses.scales is not None or more.scales is not None:
        scales = np.insert(_scales(poses), places, _scales(more), axis=1)
    return Poses(
        np.insert(poses.positions, places, more.positions, axis=1),
        np.insert(poses.quaternions, places, more.quaternions, axis=1),
        scales,
    )
