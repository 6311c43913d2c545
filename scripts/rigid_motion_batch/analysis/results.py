"""Results of a comparison of a clip, as arrays and tables: all that a report shows and that a film is made of.

Poses are in metres with z up; errors in metres and degrees. Numbers that belong together are in one dataclass. A
report measures nothing itself.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion_batch.recordings.clips import Clip, ClipFacts

from .choices import Choice, Keys, Radii
from .metrics import JointMetrics, Metrics, key_samples, row_of, rows_of_joints
from .needed import KeysNeeded
from .reconstructions import Ground, MotionErrors, Reconstruction, errors_of, identical_modes


@dataclass(frozen=True, eq=False)
class MotionResult:
    """The motion of one or more equal modes on a clip and choice of keys: a line of the chart, a lane of the film."""

    modes: tuple[str, ...]
    """The modes that give this motion; the first names it."""

    metrics: tuple[Metrics, ...]
    """A row for each of the modes."""

    keys: np.ndarray
    """The samples of the clip that are keys, shape (k,); for a body, the samples that are a key of any joint."""

    poses: Poses
    """The poses at the compared samples, shape (n,); for a body (joints, n), with identity quaternions."""

    errors: np.ndarray
    """Shell and position in metres, rotation in degrees, shape (3, n); for a body, the largest of all joints."""

    joint_errors: np.ndarray | None = None
    """The shell errors of a body's joints, shape (joints, n)."""


@dataclass(frozen=True)
class ChoiceNumbers:
    """A clip under one choice of keys, without arrays: the numbers for comparing many clips."""

    choice: Choice
    groups: tuple[tuple[str, ...], ...]
    """The modes, grouped by the motion that they give."""

    rows: tuple[Metrics, ...]
    """One for each mode."""


@dataclass(frozen=True, eq=False)
class ChoiceResult:
    """A clip under one choice of keys."""

    choice: Choice

    first: int
    """The first compared sample of the clip."""

    motions: tuple[MotionResult, ...]

    keys: Mapping[str, Keys]
    """The keys of every mode."""

    joints: tuple[JointMetrics, ...] = ()
    """A row of each joint of a body under each mode."""

    @property
    def rows(self) -> list[Metrics]:
        """The rows of all modes, in the order of `keys`."""
        rows = {row.mode: row for motion in self.motions for row in motion.metrics}
        return [rows[mode] for mode in self.keys]

    @property
    def numbers(self) -> ChoiceNumbers:
        """The result without its arrays."""
        return ChoiceNumbers(self.choice, tuple(motion.modes for motion in self.motions), tuple(self.rows))


@dataclass(frozen=True, eq=False)
class ClipResult:
    """All results of a clip."""

    facts: ClipFacts

    times: np.ndarray
    """The times of all samples of the clip, in seconds."""

    truth: Poses
    """The recording, shape (n,); for a body (joints, n), with identity quaternions."""

    parents: np.ndarray | None
    """The parent of each joint of a body; -1 for a root."""

    choices: tuple[ChoiceResult, ...]
    needed: KeysNeeded | None = None
    """The keys needed, if they were counted."""


def made_again(clip: Clip, result: ChoiceResult, radii: Radii, *, shared: bool) -> Reconstruction:
    """Return the reconstruction of a result, with the keys that were chosen before."""
    return Reconstruction(clip, result.choice, dict(result.keys), radii.of(clip), shared)


def measured(made: Reconstruction) -> ChoiceResult:
    """Measure a reconstruction. Of modes that are one motion, arrays over all samples are kept for the first only."""
    clip, ground, groups = made.clip, Ground.of(made), identical_modes(made)
    rows: dict[str, Metrics] = {}
    joints: list[JointMetrics] = []
    kept: dict[str, MotionErrors] = {}
    for mode in made.keys:
        errors = errors_of(made, mode, ground)
        rows[mode] = row_of(made, mode, errors, ground)
        joints += rows_of_joints(made, mode, errors) if clip.rest_body else ()
        if any(mode == group[0] for group in groups):
            kept[mode] = errors
    motions = []
    for group in groups:
        errors = kept[group[0]]
        poses = _places(errors.places) if clip.rest_body else clip.in_blender(made.filled_in(group[0], made.times))
        motions.append(
            MotionResult(
                group,
                tuple(rows[mode] for mode in group),
                key_samples(made.keys[group[0]]),
                poses,
                np.stack([errors.shell.max(axis=0), *errors.largest]),
                errors.shell if clip.rest_body else None,
            )
        )
    return ChoiceResult(made.choice, made.samples.start, tuple(motions), made.keys, tuple(joints))


def clip_result(clip: Clip, choices: Sequence[ChoiceResult], needed: KeysNeeded | None = None) -> ClipResult:
    """Gather the results of a clip."""
    rest_body = clip.rest_body
    if rest_body is None:
        truth = clip.in_blender(clip.poses)
    else:
        truth = _places(clip.in_blender(rest_body.skeleton.in_root_space(clip.poses)).positions)
    return ClipResult(
        ClipFacts.of(clip),
        clip.times,
        truth,
        rest_body.parents if rest_body else None,
        tuple(choices),
        needed,
    )


def _places(positions: np.ndarray) -> Poses:
    """Return poses of which only the positions matter."""
    return Poses(positions, np.broadcast_to((1.0, 0.0, 0.0, 0.0), (*positions.shape[:-1], 4)))
