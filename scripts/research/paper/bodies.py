"""What the paper asks, of whole bodies: key poses needed, and errors.

A body is measured as a rig has it: every joint is interpolated in its parent's space. And as trackers have it: hands,
feet and head alone, each a single rigid body in the space of the roots, which is that of the recording. Errors are in
metres, measured in the space of the roots.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rigid_motion.streams.humanoid import humanoid_bones
from rigid_motion_batch.analysis.bodies import moving, reconstruct_body
from rigid_motion_batch.analysis.body_metrics import measure_modes
from rigid_motion_batch.analysis.body_needed import OfBody
from rigid_motion_batch.analysis.choices import Uniform
from rigid_motion_batch.analysis.metrics import geometric_mean
from rigid_motion_batch.analysis.modes import REFERENCE
from rigid_motion_batch.analysis.needed import DECIMATIONS, RATES, OfRigidBody, keys_needed, part_of
from rigid_motion_batch.analysis.radii import JOINT
from rigid_motion_batch.recordings import TrajectoryError
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.recordings.clips import Clip

from .motions import spread
from .table import RADIUS, SCREW, has_samples_for, means, shares_of

MODES = (REFERENCE, SCREW, "pga_lerp", "motor_spline")
ERROR_RATES = (5, 10)  # key poses a second at which errors are measured

BODY = "body"
"""What is said of a whole body, beside `LIMBS`."""

LIMBS = {"LeftHand": "hands", "RightHand": "hands", "LeftFoot": "feet", "RightFoot": "feet", "Head": "heads"}
"""Humanoid bones that a tracker may be on, and their kinds."""

KINDS = (BODY, *dict.fromkeys(LIMBS.values()))

SEARCHED = 10.0
"""Seconds of a whole body, from its first sample on, for which key poses are searched: every try reduces keys anew."""

EXTENSIONS = (".bvh", ".fbx", ".glb", ".gltf", ".blend")  # of files that may hold a body


# -- what there is to measure ------------------------------------------------------------------------------------------


def read_body(path: Path) -> Clip:
    """Read and repair the first whole body of a file.

    Raises
    ------
    TrajectoryError
        Where there is none, or nothing of it moves.
    """
    whole = [clip for clip in read_clips([str(path)])[0] if clip.rest_body is not None]
    if not whole:
        raise TrajectoryError(path, "it is no whole body", "leave it out")
    if not moving(whole[0]).any():
        raise TrajectoryError(path, "at rest: none of its joints moves", "leave it out")
    return replace(whole[0], name=path.stem)


def limbs_of(clip: Clip) -> list[tuple[str, int]]:
    """Return the joints that are hands, feet and head by their names, and move, each with its kind."""
    bones, skeleton = humanoid_bones(clip.rest_body.joints), clip.rest_body.skeleton
    places = skeleton.in_root_space(clip.poses)
    found = [(kind, bones[bone]) for bone, kind in LIMBS.items() if bone in bones]
    return [(kind, joint) for kind, joint in found if spread(clip.in_metres(places[joint])) > 1e-6]


def alone(clip: Clip, joint: int) -> Clip:
    """Return a joint as a single rigid body in the space of the roots, as a tracker on it would have it."""
    return replace(clip, poses=clip.rest_body.skeleton.in_root_space(clip.poses)[joint], rest_body=None)


# -- what comes of it --------------------------------------------------------------------------------------------------


def needed_of(clip: Clip) -> list[tuple[str, dict[str, dict[str, list[float]]]]]:
    """Return the keys that every mode needs, of the whole body and of each limb alone: what it is of, and shares.

    The shares are by mode and decimation: of each of `RATES` the keys needed as a share of the reference's; NaN where
    the clip has no two samples to a key, infinite where it takes all samples.
    """
    radii = np.full(len(clip.rest_body.joints), JOINT)
    searched = part_of(clip, 0, int(np.searchsorted(clip.times, clip.times[0] + SEARCHED, side="right")) - 1)
    result = [(BODY, keys_needed(OfBody(searched, radii), MODES))]
    result += [(kind, keys_needed(OfRigidBody(alone(clip, joint), RADIUS), MODES)) for kind, joint in limbs_of(clip)]
    return [(kind, shares_of(clip, keys)) for kind, keys in result]


def errors_of(clip: Clip) -> dict[str, dict[int, tuple[float, float]]]:
    """Return by mode and rate, of `ERROR_RATES`, the RMS shell error of the body and its RMS velocity error.

    NaN where the clip has no two samples to a key pose.
    """
    result = {mode: dict.fromkeys(ERROR_RATES, (np.nan, np.nan)) for mode in MODES}
    for rate in ERROR_RATES:
        made = reconstruct_body(clip, Uniform(str(rate)), MODES, JOINT) if has_samples_for(clip, rate) else None
        for row in measure_modes(made, JOINT).rows if made else ():
            result[row.mode][rate] = row.rms_shell_m, row.rms_velocity_m_s
    return result


# -- over all bodies ---------------------------------------------------------------------------------------------------


def measure(clips: Sequence[Clip]) -> dict[str, Any]:
    """Return all of it in numbers, with geometric means over bodies, and over limbs of a kind."""
    needed = [row for clip in clips for row in needed_of(clip)]
    errors = {clip.name: errors_of(clip) for clip in clips}
    return {
        "bodies": {clip.name: _about(clip) for clip in clips},
        "rates": [int(rate) for rate in RATES],
        "needed": {
            kind: {
                mode: {
                    way: means([shares[mode][way] for of, shares in needed if of == kind]) for way in DECIMATIONS[:2]
                }
                for mode in MODES
            }
            for kind in KINDS
            if any(of == kind for of, _ in needed)
        },
        "errors": {
            mode: {
                rate: dict(zip(("shell", "velocity"), geometric_mean(_of_all(errors, mode, rate)), strict=True))
                for rate in ERROR_RATES
            }
            for mode in MODES
        },
        "by_body": {
            name: {mode: {rate: shell for rate, (shell, _) in rates.items()} for mode, rates in own.items()}
            for name, own in errors.items()
        },
    }


def _of_all(errors: Mapping[str, Mapping[str, Mapping[int, tuple[float, float]]]], mode: str, rate: int) -> np.ndarray:
    return np.array([own[mode][rate] for own in errors.values()])


def _about(clip: Clip) -> dict[str, Any]:
    return {
        "joints": len(clip.rest_body.joints),
        "seconds": float(clip.times[-1] - clip.times[0]),
        "samples_per_s": clip.samples_a_second,
        "skipped": clip.calibration,
        "limbs": [clip.rest_body.joints[joint] for _, joint in limbs_of(clip)],
    }
