"""What a comparison finds of a clip, as arrays and tables: all that a report shows, and what a film is made of.

Poses are in metres with z up; errors in metres and degrees. Numbers that belong together are in one dataclass, and a
report measures nothing.
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
    """What one or several modes make of a clip under a choice of keys: a line of the chart, a lane of the film."""

    modes: tuple[str, ...]
    """Those that give the same motion; the first names it."""

    metrics: tuple[Metrics, ...]
    """A row for each of the modes."""

    keys: np.ndarray
    """The samples of the clip that are keys, shape (k,); of a body those that are a key of any joint."""

    poses: Poses
    """At the samples that are compared, shape (n,); of a body shape (joints, n), where quaternions are the identity."""

    errors: np.ndarray
    """Shell and position in metres, rotation in degrees, shape (3, n); of a body the largest of all joints."""

    joint_errors: np.ndarray | None = None
    """The shell errors of a body's joints, shape (joints, n)."""


@dataclass(frozen=True)
class ChoiceNumbers:
    """A clip under one choice of keys without its arrays: what many clips are compared by."""

    choice: Choice
    groups: tuple[tuple[str, ...], ...]
    """The modes, those together that give the same motion."""

    rows: tuple[Metrics, ...]
    """One for each mode."""


@dataclass(frozen=True, eq=False)
class ChoiceResult:
    """A clip under one choice of keys."""

    choice: Choice

    first: int
    """The sample of the clip with which those begin that are compared."""

    motions: tuple[MotionResult, ...]

    keys: Mapping[str, Keys]
    """The keys of every mode."""

    joints: tuple[JointMetrics, ...] = ()
    """A row of each joint of a body under each mode."""

    @property
    def rows(self) -> list[Metrics]:
        """The rows of all modes, in the order of these."""
        rows = {row.mode: row for motion in self.motions for row in motion.metrics}
        return [rows[mode] for mode in self.keys]

    @property
    def numbers(self) -> ChoiceNumbers:
        """The result without its arrays."""
        return ChoiceNumbers(self.choice, tuple(motion.modes for motion in self.motions), tuple(self.rows))


@dataclass(frozen=True, eq=False)
class ClipResult:
    """All that was found of a clip."""

    facts: ClipFacts

    times: np.ndarray
    """Seconds, of all samples of the clip."""

    truth: Poses
    """The recording, shape (n,); of a body shape (joints, n), where quaternions are the identity."""

    parents: np.ndarray | None
    """Of each joint of a body; -1 for a root."""

    choices: tuple[ChoiceResult, ...]
    needed: KeysNeeded | None = None
    """The keys that are needed, where that was looked for."""


def made_again(clip: Clip, result: ChoiceResult, radii: Radii, *, shared: bool) -> Reconstruction:
    """Return the same by the keys that were chosen before."""
    return Reconstruction(clip, result.choice, dict(result.keys), radii.of(clip), shared)


def measured(made: Reconstruction) -> ChoiceResult:
    """Measure what was made. Of modes that are one motion what is as long as the recording is kept for the first."""
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
    """Gather what was found of a clip."""
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
    """Poses of which only the positions count."""
    return Poses(positions, np.broadcast_to((1.0, 0.0, 0.0, 0.0), (*positions.shape[:-1], 4)))
