"""Whole bodies under few keys: what each mode makes of the keys of all joints, and how far off that is.

Every joint is interpolated in its parent's space, as a rig has its keys, and measured where that puts it: in the root's
space, through the hierarchy, in metres. What is as long as the recording is worked on a block of samples at a time.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rigid_motion.motion import Poses, Skeleton, interpolate, measure, shell_error
from rigid_motion.motion.contacts import slide, standing
from rigid_motion_batch.axes import to_blender
from rigid_motion_batch.recordings.clips import Clip

from .choices import Choice
from .modes import REFERENCE, single_modes
from .reconstructions import FEWEST_PROBED, NO_KEYS, Groups, alike, probing

BLOCK = 4096
"""Samples of all joints that are worked on at once."""

STILL = 1e-6
"""A joint none of whose numbers changes by more, in its parent's space, needs one key."""

COMPARED = 512
"""Samples, evenly spread, that tell whether two modes are one motion."""

JointKeys = tuple[np.ndarray, ...]
"""The samples that are keys of each joint, rising; a joint that stays as it is has a single one."""


@dataclass(frozen=True, eq=False)
class BodyReconstruction:
    """A whole body under one choice of keys. All modes begin and end with the same samples."""

    clip: Clip
    """With a figure."""

    choice: Choice

    keys: dict[str, JointKeys]
    """Mode id to the keys of the joints; none of somebody else's motion, which comes last."""

    shared: bool
    """Whether the keys are key poses: the same samples for all joints that move."""

    @property
    def samples(self) -> slice:
        """The samples of the clip between the first and the last key, both included."""
        keys = [own for own in next(iter(self.keys.values())) if len(own) > 1]
        first, last = (keys[0][0], keys[0][-1]) if keys else (0, len(self.clip.times) - 1)
        return slice(int(first), int(last) + 1)

    @property
    def times(self) -> np.ndarray:
        """The times of `samples`."""
        return self.clip.times[self.samples]

    @cached_property
    def skeleton(self) -> Skeleton:
        return self.clip.whole_body.skeleton

    @property
    def best_mode(self) -> str:
        """The one with the fewest keys; where all have as many, the reference or the first."""
        counts = {mode: count for mode, keys in self.keys.items() if (count := sum(map(len, keys)))}
        fewest = [mode for mode, count in counts.items() if count == min(counts.values())]
        return REFERENCE if REFERENCE in fewest else fewest[0]

    def filled_in(self, mode: str, times: np.ndarray) -> Poses:
        """Return what a mode makes of its keys: joints in their parents' space, shape (joints, m), at any times (m,).

        In the unit of the recording.
        """
        clip = self.clip
        if not len(self.keys[mode][0]):
            assert clip.against is not None  # it alone has no keys
            return clip.against.at(times)
        poses = Poses(np.empty((len(self.skeleton), len(times), 3)), np.empty((len(self.skeleton), len(times), 4)))
        for joints, own in self._alike(mode):
            poses[joints] = interpolate(clip.times[own], clip.poses[joints][:, own], times, mode)
        return poses

    def shown(self, mode: str, times: np.ndarray) -> Poses:
        """Where that puts the joints, in metres."""
        return self.clip.in_metres(self.skeleton.in_root_space(self.filled_in(mode, times)))

    def truth(self, samples: slice | np.ndarray) -> Poses:
        """Where the joints were in the recording, in metres, shape (joints, m)."""
        return self.clip.in_metres(self.skeleton.in_root_space(self.clip.poses[:, samples]))

    def _alike(self, mode: str) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return the joints that have keys at the same samples, with these."""
        groups: dict[bytes, tuple[list[int], np.ndarray]] = {}
        for joint, own in enumerate(self.keys[mode]):
            groups.setdefault(own.tobytes(), ([], own))[0].append(joint)
        return [(np.array(joints), own) for joints, own in groups.values()]


@dataclass(frozen=True, eq=False)
class BodyErrors:
    """How far off a mode is, in metres and radians."""

    shell: np.ndarray
    """Shape (joints, n), at each sample from the first key to the last."""

    position: np.ndarray
    """RMS over the samples, shape (joints,); and so the following."""

    rotation: np.ndarray
    velocity: np.ndarray

    slide: float
    """The farthest that a joint which stands on the ground in the recording gets from where it began to stand."""

    largest: np.ndarray
    """The largest error of any joint in position, in metres, and in rotation, in degrees, shape (2, n)."""

    places: np.ndarray
    """Where the mode puts the joints, in metres with z up, single precision, shape (joints, n, 3)."""

    @property
    def worst(self) -> tuple[int, int]:
        """The joint and the sample of the largest error."""
        joint, sample = np.unravel_index(np.argmax(self.shell), self.shell.shape)
        return int(joint), int(sample)


@dataclass(frozen=True, eq=False)
class Ground:
    """What stands on the ground in a recording, from the first key to the last."""

    joints: np.ndarray
    """Those that stand at any time."""

    stands: np.ndarray
    """When, shape (those joints, n)."""

    slide: float
    """The farthest that one of them slides in the recording itself, in metres."""

    @classmethod
    def of(cls, made: BodyReconstruction) -> Ground:
        places = np.concatenate([_upright(made, made.truth(block)) for block in _blocks(made.samples)], axis=1)
        stands = standing(made.times, places)
        joints = np.flatnonzero(stands.any(axis=1))
        return cls(joints, stands[joints], slide(places[joints], stands[joints]))


def reconstruct_body(
    clip: Clip, choice: Choice, modes: Sequence[str], radius: float | np.ndarray, *, shared: bool = False
) -> BodyReconstruction | None:
    """Choose keys of all joints for every mode.

    Parameters
    ----------
    clip : Clip
        With a figure.
    choice : Choice
    modes : sequence of str
        Of `rigid_motion.motion.MODES`.
    radius : float or array, shape (joints,)
        Of the ball at every joint, in metres.
    shared : bool
        Whether keys that the motion chooses are key poses; evenly spaced ones always are.

    Returns
    -------
    BodyReconstruction or None
        None where the clip is too short for two keys.
    """
    modes = single_modes(modes)
    if choice.ends(clip.times) is None:
        return None
    uniform = choice.decimation == "uniform"
    still = ~moving(clip)
    keys: dict[str, JointKeys] = {}
    for group in [modes] if uniform else same_body_motions(clip, modes):
        result = choice.body_keys(clip, group[0], radius, shared=shared)
        keys |= dict.fromkeys(group, tuple(own[:1] if rests else own for own, rests in zip(result, still, strict=True)))
    keys = {mode: keys[mode] for mode in modes}
    if clip.against:
        keys[clip.against.name] = (NO_KEYS,) * len(still)
    return BodyReconstruction(clip, choice, keys, shared or uniform)


def measure_body(made: BodyReconstruction, mode: str, radius: float | np.ndarray, ground: Ground) -> BodyErrors:
    """How far off a mode is, joint by joint; the radius of the balls in metres, one or shape (joints,)."""
    radius = np.broadcast_to(radius, (len(made.skeleton),))[:, None]
    start, stop = made.samples.start, made.samples.stop
    shell = np.empty((len(made.skeleton), stop - start))
    squares = np.zeros((3, len(made.skeleton)))
    feet = np.empty((len(ground.joints), stop - start, 3))
    largest = np.empty((2, stop - start))
    places = np.empty((len(made.skeleton), stop - start, 3), dtype=np.float32)
    for block in _blocks(made.samples, overlap=1):
        times = made.clip.times[block]
        shown = made.shown(mode, times)
        errors = measure(times, shown, made.truth(block), radius)
        own = slice(block.start - start, block.stop - start)
        places[:, own] = upright = _upright(made, shown)
        shell[:, own], feet[:, own] = errors.shell, upright[ground.joints]
        largest[:, own] = errors.position.max(axis=0), np.degrees(errors.rotation).max(axis=0)
        # The first sample of a block is the last of the one before, where velocities begin.
        new = slice(int(block.start > start), None)
        squares += [
            np.square(some).sum(axis=-1) for some in (errors.position[:, new], errors.rotation[:, new], errors.velocity)
        ]
    counts = np.array([stop - start, stop - start, stop - start - 1.0])
    position, rotation, velocity = np.sqrt(squares / counts[:, None])
    return BodyErrors(shell, position, rotation, velocity, slide(feet, ground.stands), largest, places)


def moving(clip: Clip) -> np.ndarray:
    """Which joints do not stay as they are in their parents' space, shape (joints,)."""
    poses = clip.poses
    ranges = np.ptp(poses.positions, axis=1).max(axis=1) * clip.metres_per_unit, np.ptp(poses.quaternions, axis=1)
    return (ranges[0] > STILL) | (ranges[1].max(axis=1) > STILL)


def same_body_motions(clip: Clip, modes: Sequence[str]) -> Groups:
    """Return the modes in groups that are one motion of a body, seen with about every `PROBE`th sample as a key pose.

    Each is on its own where there are too few samples to see it.
    """
    probe = reconstruct_body(replace(clip, against=None), probing(clip), modes, 0.0)
    if probe is None or 1 < max(map(len, probe.keys[modes[0]])) < FEWEST_PROBED:
        return tuple((mode,) for mode in modes)
    return identical_body_modes(probe)


def identical_body_modes(made: BodyReconstruction) -> Groups:
    """Return the modes in groups that put every joint at the same place, but for rounding: as `identical_modes`."""
    samples = np.unique(np.linspace(made.samples.start, made.samples.stop - 1, COMPARED).astype(int))
    truth = made.truth(samples)
    shown = {mode: made.shown(mode, made.clip.times[samples]) for mode in made.keys}
    return alike(shown, {mode: float(shell_error(poses, truth).max()) for mode, poses in shown.items()})


def rms_of_body(made: BodyReconstruction, mode: str, radii: np.ndarray) -> float:
    """Return the RMS shell error over all joints and samples, in metres; of balls of these radii (joints,)."""
    radius = radii[:, None]
    totals = [
        np.square(shell_error(made.shown(mode, made.clip.times[block]), made.truth(block), radius)).mean(axis=0)
        for block in _blocks(made.samples)
    ]
    return float(np.sqrt(np.concatenate(totals).mean()))


def _upright(made: BodyReconstruction, poses: Poses) -> np.ndarray:
    """Positions with the third axis upwards."""
    return to_blender(poses, made.clip.axes).positions


def _blocks(samples: slice, overlap: int = 0) -> Iterator[slice]:
    for first in range(samples.start, samples.stop, BLOCK):
        yield slice(max(samples.start, first - overlap), min(first + BLOCK, samples.stop))
