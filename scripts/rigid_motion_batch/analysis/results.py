"""What a comparison finds of a clip, as arrays and tables: all that a report shows, and what a film is made of.

Poses are in metres with z up; errors in metres and degrees. Numbers that belong together are in one dataclass, and a
report measures nothing.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion_batch.axes import to_blender
from rigid_motion_batch.recordings.clips import Clip, ClipFacts

from .bodies import BodyReconstruction, reconstruct_body
from .body_decimated import KeysOfBody
from .body_metrics import JointMetrics, key_samples, measure_modes, write_key_tables
from .choices import Choice
from .metrics import Metrics, measure_reconstruction, write_reconstruction
from .modes import BEST_OF
from .needed import KeysNeeded
from .radii import Radii
from .reconstructions import Reconstruction, fill_in, identical_modes, reconstruct

Keys = tuple[np.ndarray, ...]
"""The samples that are keys, rising: of a rigid body one array, of a whole body one for each joint."""

Made = Reconstruction | BodyReconstruction


@dataclass(frozen=True)
class SegmentModes:
    """Which modes were best in how many segments, under `best_of`."""

    counts: Mapping[str, int]
    changes: int
    """At how many keys the mode changes."""

    best_single: str
    """The best mode for all segments alike."""

    @classmethod
    def of(cls, made: Reconstruction) -> SegmentModes | None:
        """Return None where the run does without `best_of`."""
        if BEST_OF not in made.keys:
            return None
        changes = sum(mode != following for mode, following in pairwise(made.segment_modes))
        return cls(dict(Counter(made.segment_modes)), changes, made.best_mode)


@dataclass(frozen=True, eq=False)
class Motion:
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

    motions: tuple[Motion, ...]

    keys: Mapping[str, Keys]
    """The keys of every mode."""

    segment_modes: SegmentModes | None = None

    mode_of_segments: tuple[str, ...] = ()
    """The mode of each segment under `best_of`; none where the run does without."""

    joints: tuple[JointMetrics, ...] = ()
    """A row of each joint of a body under each mode."""

    decimated: tuple[KeysOfBody, ...] = ()
    """The keys of a body beside those of Blender's Decimate, where that was asked for."""

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


def compare_clip(
    clip: Clip, choice: Choice, modes: Sequence[str], radii: Radii, *, shared: bool
) -> ChoiceResult | None:
    """Keep keys of a clip, let the modes fill them in, and measure what was lost.

    Parameters
    ----------
    clip : Clip
    choice : Choice
    modes : sequence of str
        Of `rigid_motion.motion.MODES`, and `best_of`, which is left out of whole bodies.
    radii : Radii
        Of the shells.
    shared : bool
        Whether the joints of a body have their keys at the same samples, where the motion chooses them.

    Returns
    -------
    ChoiceResult or None
        None where the clip is too short for two keys.
    """
    made = made_of(clip, choice, modes, radii, shared=shared)
    return None if made is None else measured(made, radii)


def made_of(clip: Clip, choice: Choice, modes: Sequence[str], radii: Radii, *, shared: bool) -> Made | None:
    """Return what modes make of a clip: the first half of `compare_clip`."""
    if clip.rest_body is None:
        return reconstruct(clip, choice, modes, radii.rigid)
    return reconstruct_body(clip, choice, modes, radii.of(clip.rest_body.joints), shared=shared)


def made_again(clip: Clip, result: ChoiceResult, radii: Radii, *, shared: bool) -> Made:
    """Return the same by the keys that were chosen before."""
    if clip.rest_body is None:
        keys = {mode: keys[0] for mode, keys in result.keys.items()}
        return fill_in(clip, result.choice, keys, radii.rigid, result.mode_of_segments)
    return BodyReconstruction(clip, result.choice, dict(result.keys), shared)


def measured(made: Made, radii: Radii) -> ChoiceResult:
    """Measure what was made: the second half of `compare_clip`."""
    return _of_body(made, radii) if isinstance(made, BodyReconstruction) else _of_rigid_body(made)


def write_tables(folder: Path, made: Made, form: str) -> None:
    """Write the keys, and of a rigid body the poses, as `table_names` says."""
    if isinstance(made, BodyReconstruction):
        write_key_tables(folder, made)
    else:
        write_reconstruction(folder, made, form)


def clip_result(clip: Clip, choices: Sequence[ChoiceResult], needed: KeysNeeded | None = None) -> ClipResult:
    """Gather what was found of a clip."""
    rest_body = clip.rest_body
    if rest_body is None:
        truth = to_blender(clip.in_metres(clip.poses), clip.axes)
    else:
        truth = _places(to_blender(clip.in_metres(rest_body.skeleton.in_root_space(clip.poses)), clip.axes).positions)
    return ClipResult(
        ClipFacts.of(clip),
        clip.times,
        truth,
        rest_body.parents if rest_body else None,
        tuple(choices),
        needed,
    )


def _of_rigid_body(made: Reconstruction) -> ChoiceResult:
    rows = {row.mode: row for row in measure_reconstruction(made)}
    motions = []
    for group in identical_modes([made]):
        mode = group[0]
        errors = made.errors[mode]
        motions.append(
            Motion(
                group,
                tuple(rows[item] for item in group),
                made.keys[mode],
                to_blender(made.clip.in_metres(made.poses[mode]), made.clip.axes),
                np.stack([errors.shell, errors.position, np.degrees(errors.rotation)]),
            )
        )
    return ChoiceResult(
        made.choice,
        made.samples.start,
        tuple(motions),
        {mode: (keys,) for mode, keys in made.keys.items()},
        SegmentModes.of(made),
        made.segment_modes,
    )


def _of_body(made: BodyReconstruction, radii: Radii) -> ChoiceResult:
    result = measure_modes(made, radii.of(made.clip.whole_body.joints))
    rows = {row.mode: row for row in result.rows}
    motions = [
        Motion(
            group,
            tuple(rows[mode] for mode in group),
            key_samples(made.keys[group[0]]),
            _places(errors.places),
            np.stack([errors.shell.max(axis=0), *errors.largest]),
            errors.shell,
        )
        for group, errors in zip(result.groups, result.errors.values(), strict=True)
    ]
    return ChoiceResult(made.choice, made.samples.start, tuple(motions), made.keys, joints=result.joints)


def _places(positions: np.ndarray) -> Poses:
    """Poses of which only the positions count."""
    return Poses(positions, np.broadcast_to((1.0, 0.0, 0.0, 0.0), (*positions.shape[:-1], 4)))
