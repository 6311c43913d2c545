"""Results of a comparison for the tests of the report: measured by the program itself, or made up."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigid_motion.motion import KEYFRAME_MODES
from rigid_motion_batch.analysis.results import ChoiceResult, ClipResult, ClipWarning, Motion
from rigid_motion_batch.axes import to_blender
from rigid_motion_batch.comparison.study.bodies import measure_body, reconstruct_body
from rigid_motion_batch.comparison.study.body_metrics import key_samples, measure_modes
from rigid_motion_batch.comparison.study.choices import Choice, Uniform
from rigid_motion_batch.comparison.study.clips import Clip
from rigid_motion_batch.comparison.study.metrics import measure_reconstruction
from rigid_motion_batch.comparison.study.needed import OfRigidBody, keys_needed
from rigid_motion_batch.comparison.study.reconstructions import identical_modes, reconstruct
from rigid_motion_batch.comparison.study.results import ClipFacts, SegmentModes

MODES = tuple(KEYFRAME_MODES)
RATES = tuple(map(Uniform, ("5", "10", "15", "20")))


def result_of(
    clip: Clip,
    choices: Sequence[Choice] = RATES,
    modes: Sequence[str] = MODES,
    *,
    warnings: Sequence[ClipWarning] = (),
    needed: bool = False,
) -> ClipResult:
    """A clip under some choices of keys, as the analysis hands it over."""
    single = clip.figure is None
    if single:
        truth = clip.in_metres(clip.poses)
        found = [_single(clip, choice, modes) for choice in choices]
    else:
        truth = clip.in_metres(clip.figure.skeleton.in_root_space(clip.poses))
        found = [_body(clip, choice, modes) for choice in choices]
    return ClipResult(
        ClipFacts.of(clip),
        clip.times,
        to_blender(truth, clip.axes),
        () if single else clip.figure.joints,
        None if single else clip.figure.parents,
        tuple(result for result in found if result),
        keys_needed(OfRigidBody(clip, 0.1), modes) if needed else None,
        tuple(warnings),
    )


def _single(clip: Clip, choice: Choice, modes: Sequence[str]) -> ChoiceResult | None:
    made = reconstruct(clip, choice, modes, 0.1)
    if made is None:
        return None
    rows = {row.mode: row for row in measure_reconstruction(made)}
    motions = []
    for group in identical_modes([made]):
        errors = made.errors[group[0]]
        curves = np.stack((errors.shell, errors.position, np.degrees(errors.rotation)))
        poses = to_blender(clip.in_metres(made.poses[group[0]]), clip.axes)
        motions.append(Motion(group, tuple(rows[mode] for mode in group), made.keys[group[0]], poses, curves))
    return ChoiceResult(choice, made.samples.start, tuple(motions), SegmentModes.of(made))


def _body(clip: Clip, choice: Choice, modes: Sequence[str]) -> ChoiceResult | None:
    made = reconstruct_body(clip, choice, modes, 0.03)
    if made is None:
        return None
    measured = measure_modes(made, 0.03)
    rows = {row.mode: row for row in measured.rows}
    truth = made.truth(made.samples)
    motions = []
    for group in measured.groups:
        shown = made.shown(group[0], made.times)
        shell = _shell(made, group[0])
        apart = np.linalg.norm(shown.positions - truth.positions, axis=-1).max(axis=0)
        dots = np.abs((shown.quaternions * truth.quaternions).sum(axis=-1)).clip(0.0, 1.0)
        curves = np.stack((shell.max(axis=0), apart, np.degrees(2.0 * np.arccos(dots)).max(axis=0)))
        keys = key_samples(made.keys[group[0]])
        metrics = tuple(rows[mode] for mode in group)
        motions.append(Motion(group, metrics, keys, to_blender(shown, clip.axes), curves, shell))
    return ChoiceResult(choice, made.samples.start, tuple(motions), None)


def _shell(made, mode):
    from rigid_motion_batch.comparison.study.bodies import Ground

    return measure_body(made, mode, 0.03, Ground.of(made)).shell
