"""Reconstructions: the motion that each mode makes from the few keys that are kept of a clip.

A single rigid body has the keys of one joint without a parent. Every joint of a whole body is interpolated in its
parent's space, where a rig has its keys, and shown in the root's space, through the hierarchy. Times and poses are
those of the clip; shown poses and errors are in metres.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rigid_motion.motion import (
    Poses,
    Skeleton,
    interpolate,
    measure,
    shell_error,
)
from rigid_motion.motion.contacts import slide, standing
from rigid_motion.motion.quaternions import rotate
from rigid_motion_batch.axes import to_blender
from rigid_motion_batch.recordings.clips import Clip

from .choices import RIGID_RADIUS_M, Choice, Keys, Uniform

Groups = tuple[tuple[str, ...], ...]
"""Modes, grouped by the motion that they give."""

BLOCK_SAMPLES = 4096
"""Samples that are processed at once, for all joints."""

MAX_STILL_CHANGE = 1e-6
"""A joint whose numbers all change by at most this, in its parent's space, needs only one key."""

COMPARED_SAMPLES = 512
"""Number of evenly spaced samples that decide whether two modes are one motion."""

PROBE_KEY_STRIDE = 4
"""Every n-th sample is a key in the test for modes that are one motion."""

FEWEST_PROBED = 4
"""Fewest keys that can show which modes are one motion: between two keys, a spline is a screw like any other."""

NO_KEYS = np.array([], dtype=int)
"""The keys of a motion from --against: they are unknown."""


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """A clip under one choice of keys: the keys that each mode kept, and the motion that it fills in between them.

    All modes begin and end with the same samples.
    """

    clip: Clip

    choice: Choice
    """How the keys were chosen."""

    keys: dict[str, Keys]
    """Mode id to the keys of the joints. A motion from --against comes last, without keys."""

    radii: np.ndarray
    """Radii of the balls around the joints, or of the shell of a rigid body, in metres, shape (joints,)."""

    shared: bool = False
    """Whether the keys are key poses: the same samples for all moving joints."""

    @cached_property
    def samples(self) -> slice:
        """The samples of the clip from the first key to the last, both included."""
        keys = [own for own in next(iter(self.keys.values())) if len(own) > 1]
        first, last = (keys[0][0], keys[0][-1]) if keys else (0, len(self.clip.times) - 1)
        return slice(int(first), int(last) + 1)

    @property
    def times(self) -> np.ndarray:
        """The times of `samples`."""
        return self.clip.times[self.samples]

    @cached_property
    def skeleton(self) -> Skeleton:
        return self.clip.rest_body.skeleton if self.clip.rest_body else Skeleton([-1])

    def filled_in(self, mode: str, times: np.ndarray) -> Poses:
        """Return the motion of a mode at any times (m,), in the form of the clip's poses.

        In the unit of the recording: shape (m,), or (joints, m) in the spaces of the parents.
        """
        clip, keys = self.clip, self.keys[mode]
        if not len(keys[0]):
            assert clip.against is not None  #  the only motion without keys
            return clip.against.at(times)
        if clip.rest_body is None:
            return interpolate(clip.times[keys[0]], clip.poses[keys[0]], times, mode)
        alike: dict[bytes, tuple[list[int], np.ndarray]] = {}
        for joint, own in enumerate(keys):
            alike.setdefault(own.tobytes(), ([], own))[0].append(joint)
        filled = Poses(np.empty((len(keys), len(times), 3)), np.empty((len(keys), len(times), 4)))
        for joints, own in alike.values():
            filled[joints] = interpolate(clip.times[own], clip.poses[joints][:, own], times, mode)
        return filled

    def shown(self, mode: str, times: np.ndarray) -> Poses:
        """Return the poses of the joints under a mode at any times (m,), in metres, shape (joints, m)."""
        return self._in_root_space(self.filled_in(mode, times))

    def truth(self, samples: slice | np.ndarray) -> Poses:
        """Return the recorded poses of the joints, in metres, shape (joints, m)."""
        return self._in_root_space(self.clip.poses[..., samples])

    def _in_root_space(self, poses: Poses) -> Poses:
        return self.clip.in_metres(self.skeleton.in_root_space(poses) if self.clip.rest_body else poses[None])

    def shell(self, mode: str) -> np.ndarray:
        """Return the shell errors of a mode at `samples`, in metres, shape (joints, n)."""
        times, radii = self.clip.times, self.radii[:, None]
        parts = [shell_error(self.shown(mode, times[part]), self.truth(part), radii) for part in self.blocks()]
        return np.concatenate(parts, axis=1)

    def blocks(self, overlap: int = 0) -> Iterator[slice]:
        """Yield `samples` in blocks, each extended by `overlap` samples of the block before."""
        for first in range(self.samples.start, self.samples.stop, BLOCK_SAMPLES):
            yield slice(max(self.samples.start, first - overlap), min(first + BLOCK_SAMPLES, self.samples.stop))


def reconstruct(
    clip: Clip, choice: Choice, modes: Sequence[str], radius: float | np.ndarray, *, shared: bool = False
) -> Reconstruction | None:
    """Choose keys of all joints of the clip, for every mode.

    Parameters
    ----------
    clip : Clip
        A motion in `clip.against` comes after the modes.
    choice : Choice
    modes : sequence of str
        Of `rigid_motion.motion.MODES`.
    radius : float or array, shape (joints,)
        Radius of the shell, or of the balls at the joints, in metres.
    shared : bool
        Whether adaptive keys are key poses; evenly spaced keys always are.

    Returns
    -------
    Reconstruction or None
        None if the clip is too short for two keys.

    Notes
    -----
    Modes that are one motion get the same keys, chosen for the first of them: adaptive choices take time, and rounding
    must not make the modes look different.
    """
    if choice.ends(clip.times) is None:
        return None
    uniform, still = choice.decimation == "uniform", ~moving(clip)
    radii = np.broadcast_to(np.asarray(radius, dtype=float), still.shape)
    keys: dict[str, Keys] = {}
    for group in [modes] if uniform else same_motions(clip, modes):
        chosen = choice.keys(clip, group[0], radii, shared=shared)
        result = tuple(own[:1] if rests else own for own, rests in zip(chosen, still, strict=True))
        keys |= dict.fromkeys(group, result)
    other = {clip.against.name: (NO_KEYS,) * len(still)} if clip.against else {}
    return Reconstruction(clip, choice, {mode: keys[mode] for mode in modes} | other, radii, shared or uniform)


def moving(clip: Clip) -> np.ndarray:
    """Return which joints change in their parents' space, shape (joints,); a rigid body always counts as moving."""
    if clip.rest_body is None:
        return np.array([True])
    poses = clip.poses
    ranges = np.ptp(poses.positions, axis=1).max(axis=1) * clip.metres_per_unit, np.ptp(poses.quaternions, axis=1)
    return (ranges[0] > MAX_STILL_CHANGE) | (ranges[1].max(axis=1) > MAX_STILL_CHANGE)


# -- modes that are one motion ----------------------------------------------------------------------------------------


def same_motions(clip: Clip, modes: Sequence[str]) -> Groups:
    """Return the modes, grouped by the motion that they give on this clip.

    About every `PROBE_KEY_STRIDE`th sample is a key in this test. With too few keys, each mode is a group of its own.
    """
    probe = reconstruct(replace(clip, against=None), probing(clip), modes, 0.0)
    if probe is None or 1 < max(map(len, probe.keys[modes[0]])) < FEWEST_PROBED:
        return tuple((mode,) for mode in modes)
    return identical_modes(probe)


def probing(clip: Clip) -> Uniform:
    """Return the choice of about every `PROBE_KEY_STRIDE`th sample as a key."""
    rate = (len(clip.times) - 1) / float(clip.times[-1] - clip.times[0]) / PROBE_KEY_STRIDE
    return Uniform(f"{max(rate, 1e-6):.6f}")


def identical_modes(made: Reconstruction) -> Groups:
    """Return the modes, grouped by equal poses of every joint.

    Equal means that the shell error between two modes is below a millionth of their error, or within rounding. Some
    modes are one curve in theory (ScLERP and the SLERP of motors); this checks whether they were in practice.
    """
    samples = np.unique(np.linspace(made.samples.start, made.samples.stop - 1, COMPARED_SAMPLES).astype(int))
    truth = made.truth(samples)
    shown = {mode: made.shown(mode, made.clip.times[samples]) for mode in made.keys}
    return alike(shown, {mode: float(shell_error(poses, truth).max()) for mode, poses in shown.items()})


def joint_groups(groupings: Iterable[Groups]) -> Groups:
    """Return groups of the modes that are together in all of these groupings of the same modes."""
    places: dict[str, list[int]] = {}
    for groups in groupings:
        for place, group in enumerate(groups):
            for mode in group:
                places.setdefault(mode, []).append(place)
    joint: dict[tuple[int, ...], list[str]] = {}
    for mode, where in places.items():
        joint.setdefault(tuple(where), []).append(mode)
    return tuple(map(tuple, joint.values()))


def alike(poses: Mapping[str, Poses], largest: Mapping[str, float]) -> Groups:
    """Return modes grouped by equal poses, up to a millionth of their largest error in metres and to rounding."""
    groups: list[list[str]] = []
    for mode, own in poses.items():
        for group in groups:
            rounding = 1e-12 * (1.0 + np.abs(poses[group[0]].positions).max())
            if shell_error(poses[group[0]], own).max() <= 1e-6 * largest[group[0]] + rounding:
                group.append(mode)
                break
        else:
            groups.append([mode])
    return tuple(map(tuple, groups))


@dataclass(frozen=True, eq=False)
class MotionErrors:
    """The errors of a mode, in metres and radians."""

    shell: np.ndarray
    """Shape (joints, n), at each sample from the first key to the last."""

    position: np.ndarray
    """RMS over the samples, shape (joints,), as are `rotation` and `velocity`."""

    rotation: np.ndarray
    velocity: np.ndarray

    slide: float
    """The farthest that a joint gets from where it began to stand, while it stands on the ground in the recording."""

    still_point: float
    """The farthest that a point of a rigid body which stays put in the recording gets from its place, in metres."""

    largest: np.ndarray
    """The largest error of any joint in position, in metres, and in rotation, in degrees, shape (2, n)."""

    places: np.ndarray
    """The positions of the joints under the mode, in metres with z up, single precision, shape (joints, n, 3)."""

    @property
    def worst(self) -> tuple[int, int]:
        """The joint and the sample of the largest shell error."""
        joint, sample = np.unravel_index(np.argmax(self.shell), self.shell.shape)
        return int(joint), int(sample)


@dataclass(frozen=True, eq=False)
class Ground:
    """The joints that stand on the ground in a recording, or its point that stays put, from first key to last."""

    joints: np.ndarray
    """The joints that stand at any time; empty for a rigid body."""

    stands: np.ndarray
    """Which samples each of these joints stands at, shape (standing joints, n)."""

    slide: float
    """The farthest that a standing joint slides in the recording itself, in metres."""

    still_point: np.ndarray | None = None
    """The offset from a rigid body's origin to its point that stays put, along its axes and in metres, shape (3,)."""

    @classmethod
    def of(cls, made: Reconstruction) -> Ground:
        if made.clip.rest_body is None:
            still = still_point(made.truth(made.samples)[0])
            return cls(np.empty(0, dtype=int), np.empty((0, len(made.times)), dtype=bool), 0.0, still)
        places = np.concatenate([_upright(made, made.truth(block)) for block in made.blocks()], axis=1)
        stands = standing(made.times, places)
        joints = np.flatnonzero(stands.any(axis=1))
        return cls(joints, stands[joints], slide(places[joints], stands[joints]))


def errors_of(made: Reconstruction, mode: str, ground: Ground) -> MotionErrors:
    """Return the errors of a mode, joint by joint."""
    joints, start, count = len(made.skeleton), made.samples.start, len(made.times)
    shell, places = np.empty((joints, count)), np.empty((joints, count, 3), dtype=np.float32)
    feet, largest = np.empty((len(ground.joints), count, 3)), np.empty((2, count))
    squares, still = np.zeros((3, joints)), 0.0
    for block in made.blocks(overlap=1):
        times, truth = made.clip.times[block], made.truth(block)
        shown = made.shown(mode, times)
        errors = measure(times, shown, truth, made.radii[:, None])
        if ground.still_point is not None:
            off = point_at(shown[0], ground.still_point) - point_at(truth[0], ground.still_point)
            still = max(still, float(np.linalg.norm(off, axis=-1).max()))
        own = slice(block.start - start, block.stop - start)
        places[:, own] = upright = _upright(made, shown)
        shell[:, own], feet[:, own] = errors.shell, upright[ground.joints]
        largest[:, own] = errors.position.max(axis=0), np.degrees(errors.rotation).max(axis=0)
        # The first sample of a block is the last of the block before: its velocity starts there.
        new = slice(int(block.start > start), None)
        squares += [
            np.square(some).sum(axis=-1) for some in (errors.position[:, new], errors.rotation[:, new], errors.velocity)
        ]
    position, rotation, velocity = np.sqrt(squares / np.array([count, count, count - 1.0])[:, None])
    slid = slide(feet, ground.stands)
    return MotionErrors(shell, position, rotation, velocity, slid, still, largest, places)


MAX_PIVOT_DRIFT_M = 0.01
"""How far a point that stays put may be from its mean place, in metres: as a pivot is that is held by hand."""

MAX_PIVOT_DISTANCE_M = 1.0
"""The largest distance from a body's origin to its pivot, in metres."""

MIN_MOVE_PER_DRIFT = 10.0
"""How many times farther than the pivot the origin or the shell must move: otherwise the whole body stays put."""


def still_point(poses: Poses) -> np.ndarray | None:
    """Return the point of a rigid body that stays put while the body moves, a pivot or a hinge; None without one.

    `poses`, (n,), are in metres. The point is given from the body's origin along its axes, shape (3,). If a line of
    points qualifies, the point nearest to the origin is returned.
    """
    turns, ways = rotate(poses.quaternions[:, None], np.eye(3)), poses.positions - poses.positions.mean(axis=0)
    matrices = np.swapaxes(turns - turns.mean(axis=0), 1, 2).reshape(-1, 3)
    point = np.linalg.lstsq(matrices, -ways.ravel(), rcond=1e-3)[0]
    moved = np.max(np.linalg.norm(matrices.reshape(-1, 3, 3) @ point + ways, axis=1))
    arms = np.max(np.linalg.norm(matrices.reshape(-1, 3, 3), axis=(1, 2))) * RIGID_RADIUS_M
    farthest = max(np.max(np.linalg.norm(ways, axis=1)), arms)
    return (
        point
        if moved < MAX_PIVOT_DRIFT_M
        and np.linalg.norm(point) < MAX_PIVOT_DISTANCE_M
        and farthest > MIN_MOVE_PER_DRIFT * moved
        else None
    )


def point_at(poses: Poses, point: np.ndarray) -> np.ndarray:
    """Return the positions of a point of a body, (n, 3)."""
    return poses.positions + rotate(poses.quaternions, point)


def _upright(made: Reconstruction, poses: Poses) -> np.ndarray:
    """Return positions with z up."""
    return to_blender(poses, made.clip.axes).positions
