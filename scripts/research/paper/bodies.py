"""What the paper asks, of whole bodies: key poses needed, errors, and what there is of a screw in a joint's motion.

A body is measured three times. As a rig has it: every joint is interpolated in its parent's space. As trackers have it:
hands, feet and head alone, each a single rigid body in the space of the roots, which is that of the recording. And both
beside each other at the same keys. Errors are in metres, measured in the space of the roots.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rigid_motion.motion import Poses, decimate, interpolate, rms, shell_error
from rigid_motion.motion.humanoid import humanoid_bones
from rigid_motion_batch.analysis.bodies import BodyReconstruction, moving, reconstruct_body
from rigid_motion_batch.analysis.body_metrics import measure_modes
from rigid_motion_batch.analysis.body_needed import OfBody
from rigid_motion_batch.analysis.choices import Uniform
from rigid_motion_batch.analysis.metrics import geometric_mean
from rigid_motion_batch.analysis.modes import REFERENCE
from rigid_motion_batch.analysis.needed import DECIMATIONS, RATES, KeysNeeded, OfRigidBody, keys_needed, part_of
from rigid_motion_batch.analysis.radii import JOINT
from rigid_motion_batch.recordings import TrajectoryError
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.recordings.options import ReadingOptions

from .table import RADIUS, SAMPLES_AN_UPDATE, SCREW, means

MODES = (REFERENCE, SCREW, "pga_lerp", "motor_spline")
ERROR_RATES = (5, 10)  # key poses a second at which errors are measured

BODY = "body"
"""What is said of a whole body, beside `LIMBS`."""

LIMBS = {"LeftHand": "hands", "RightHand": "hands", "LeftFoot": "feet", "RightFoot": "feet", "Head": "heads"}
"""Humanoid bones that a tracker may be on, and their kinds."""

KINDS = (BODY, *dict.fromkeys(LIMBS.values()))

THROUGH, ALONE = "through", "alone"
"""The ways to interpolate a limb: through the joints that it hangs on, or as a single body."""

NEVER_EXACT = 1e-3
"""Files round the time of a frame: so much, as a share, may be missing to two samples an update."""

SEARCHED = 10.0
"""Seconds of a whole body, from its first sample on, for which key poses are searched: every try reduces keys anew."""

JUMP = 3.0
"""A first sample is no motion from which the body gets away so many times faster than it ever moves afterwards: files
of motion capture may begin with a pose to calibrate by."""

WHOLE = ReadingOptions(start=0.0)
"""A first sample that is no motion is looked for here, in all bodies alike."""

EXTENSIONS = (".bvh", ".fbx", ".glb", ".gltf", ".blend")  # of files that may hold a body


# -- what there is to measure ------------------------------------------------------------------------------------------


def read_body(path: Path) -> tuple[Clip, int]:
    """Read and repair the first whole body of a file, without a first sample that is no motion, and how many that were.

    Raises
    ------
    TrajectoryError
        Where there is none, or nothing of it moves.
    """
    whole = [clip for clip in read_clips([str(path)], None, WHOLE)[0] if clip.rest_body is not None]
    if not whole:
        raise TrajectoryError(path, "it is no whole body", "leave it out")
    clip = replace(whole[0], name=path.stem)
    if not moving(clip).any():
        raise TrajectoryError(path, "at rest: none of its joints moves", "leave it out")
    places = clip.rest_body.skeleton.in_root_space(clip.poses).positions
    speeds = np.linalg.norm(np.diff(places, axis=1), axis=-1).max(axis=0) / np.diff(clip.times)
    skipped = int(len(speeds) >= 2 and speeds[0] > JUMP * speeds[1:].max())
    return part_of(clip, skipped, len(clip.times) - 1) if skipped else clip, skipped


@dataclass(frozen=True)
class Limb:
    """A joint that a tracker may be on, of a kind of `LIMBS`, and how many joints that move carry it, and are it."""

    kind: str
    joint: int
    chain: int


def limbs_of(clip: Clip) -> list[Limb]:
    """Return the joints that move and are hands, feet and head by their names."""
    moves, parents, result = moving(clip), clip.rest_body.parents, []
    bones = humanoid_bones(clip.rest_body.joints)
    for bone, kind in LIMBS.items():
        joint, chain = bones.get(bone, -1), 0
        while joint >= 0:
            chain, joint = chain + int(moves[joint]), int(parents[joint])
        if chain:
            result.append(Limb(kind, bones[bone], chain))
    return result


def alone(clip: Clip, joint: int) -> Clip:
    """Return a joint as a single rigid body in the space of the roots, as a tracker on it would have it."""
    return replace(clip, poses=clip.rest_body.skeleton.in_root_space(clip.poses)[joint], rest_body=None)


# -- what comes of it --------------------------------------------------------------------------------------------------


def has_samples_for(clip: Clip, rate: float) -> bool:
    """Return whether a body has two samples to a key pose."""
    return rate <= clip.samples_a_second * (1.0 + NEVER_EXACT) / SAMPLES_AN_UPDATE


def needed_of(clip: Clip, limbs: Iterable[Limb]) -> list[tuple[str, dict[str, dict[str, list[float]]]]]:
    """Return the keys that every mode needs, of the whole body and of each limb alone: what it is of, and shares.

    The shares are by mode and decimation: of each of `RATES` the keys needed as a share of the reference's; NaN where
    the clip has no two samples to a key, infinite where it takes all samples.
    """
    radii = np.full(len(clip.rest_body.joints), JOINT)
    searched = part_of(clip, 0, int(np.searchsorted(clip.times, clip.times[0] + SEARCHED, side="right")) - 1)
    result = [(BODY, keys_needed(OfBody(searched, radii), MODES))]
    result += [(limb.kind, keys_needed(OfRigidBody(alone(clip, limb.joint), RADIUS), MODES)) for limb in limbs]
    return [(kind, _shares(clip, keys)) for kind, keys in result]


def _shares(clip: Clip, result: KeysNeeded) -> dict[str, dict[str, list[float]]]:
    counted = [has_samples_for(clip, float(rate)) for rate in result.rates]
    shares = np.where(counted, result.shares, np.nan).tolist()
    groups = zip(result.groups, shares, strict=True)
    return {mode: dict(zip(DECIMATIONS, row, strict=False)) for group, row in groups for mode in group}


def errors_of(clip: Clip, limbs: Sequence[Limb]) -> list[tuple[str, str, str, int, float, float]]:
    """Return the errors of all modes at `ERROR_RATES`: of the body, and of each limb in both ways at the same keys.

    What it is of, the way, the mode, the rate, the RMS shell error, and the RMS velocity error of the body.
    """
    rows = []
    for rate, keyed in _with_key_poses(clip):
        rows += [
            (BODY, THROUGH, row.mode, rate, row.rms_shell_m, row.rms_velocity_m_s)
            for row in measure_modes(keyed, JOINT).rows
        ]
        keys, truth = decimate(clip.times, rate), keyed.truth(keyed.samples)
        for mode in MODES:
            shown = keyed.shown(mode, keyed.times)
            for limb in limbs:
                single = alone(clip, limb.joint)
                filled = clip.in_metres(interpolate(clip.times[keys], single.poses[keys], keyed.times, mode))
                for way, poses in ((THROUGH, shown[limb.joint]), (ALONE, filled)):
                    error = rms(shell_error(poses, truth[limb.joint], RADIUS))
                    rows.append((limb.kind, way, mode, rate, error, np.nan))
    return rows


def apart_of(clip: Clip) -> dict[int, dict[str, float]]:
    """Return how far a screw gets from `lerp_slerp` at most, in metres, at `ERROR_RATES`.

    "parents" is of all joints but the roots in their parents' spaces; "carried" of the same in the space of the roots,
    where these are held still: what adds up along a chain; "roots" of the roots; "all" of all joints in that space;
    "error" is how far `lerp_slerp` is from the recording there.
    """
    result, roots, in_root_space = {}, clip.rest_body.parents < 0, clip.rest_body.skeleton.in_root_space

    def distances(first: Poses, second: Poses) -> np.ndarray:
        return np.linalg.norm(first.positions - second.positions, axis=-1).max(axis=-1) * clip.metres_per_unit

    for rate, keyed in _with_key_poses(clip):
        straight, screw = (keyed.filled_in(mode, keyed.times) for mode in (REFERENCE, SCREW))
        held = screw.copy()
        held[np.flatnonzero(roots)] = straight[roots]
        shown = in_root_space(straight)
        local = distances(straight, screw)
        result[rate] = {
            "parents": local[~roots].max(initial=0.0),
            "carried": distances(shown, in_root_space(held))[~roots].max(initial=0.0),
            "roots": local[roots].max(),
            "all": distances(shown, in_root_space(screw)).max(),
            "error": distances(shown, in_root_space(clip.poses[:, keyed.samples])).max(),
        }
    return result


def _with_key_poses(clip: Clip) -> list[tuple[int, BodyReconstruction]]:
    """Return it with evenly spaced ones at `ERROR_RATES`, where the clip has two samples to each."""
    rates = [rate for rate in ERROR_RATES if has_samples_for(clip, rate)]
    bodies = [(rate, reconstruct_body(clip, Uniform(str(rate)), MODES, JOINT)) for rate in rates]
    return [(rate, body) for rate, body in bodies if body]


# -- over all bodies ---------------------------------------------------------------------------------------------------


def measure(clips: Sequence[tuple[Clip, int]]) -> dict[str, Any]:
    """Return all of it in numbers, with geometric means over bodies, and over limbs of a kind."""
    limbs = {clip.name: limbs_of(clip) for clip, _ in clips}
    needed = [row for clip, _ in clips for row in needed_of(clip, limbs[clip.name])]
    errors = {clip.name: errors_of(clip, limbs[clip.name]) for clip, _ in clips}
    kinds = [kind for kind in KINDS if any(of == kind for of, _ in needed)]
    every = [row for rows in errors.values() for row in rows]
    return {
        "bodies": {clip.name: _about(clip, skipped, limbs[clip.name]) for clip, skipped in clips},
        "rates": [int(rate) for rate in RATES],
        "needed": {
            kind: {
                mode: {
                    way: means([shares[mode][way] for of, shares in needed if of == kind]) for way in DECIMATIONS[:2]
                }
                for mode in MODES
            }
            for kind in kinds
        },
        "chains": {
            kind: [limb.chain for of_body in limbs.values() for limb in of_body if limb.kind == kind]
            for kind in kinds[1:]
        },
        "errors": {
            kind: {
                way: {mode: {rate: _mean_error(every, kind, way, mode, rate) for rate in ERROR_RATES} for mode in MODES}
                for way in ((THROUGH,) if kind == BODY else (THROUGH, ALONE))
            }
            for kind in kinds
        },
        "by_body": {
            name: {
                mode: {rate: _mean_error(rows, BODY, THROUGH, mode, rate)["shell"] for rate in ERROR_RATES}
                for mode in MODES
            }
            for name, rows in errors.items()
        },
        "apart": {clip.name: apart_of(clip) for clip, _ in clips},
    }


def _about(clip: Clip, skipped: int, limbs: Iterable[Limb]) -> dict[str, Any]:
    """Return what is said of a body; "moved" is the farthest that any joint but the roots moves in its parent's space.

    That is from corner to corner of what it fills.
    """
    joints = np.flatnonzero(clip.rest_body.parents >= 0)
    widths = np.ptp(clip.poses.positions[joints], axis=1) * clip.metres_per_unit
    return {
        "joints": len(clip.rest_body.joints),
        "seconds": float(clip.times[-1] - clip.times[0]),
        "samples_per_s": clip.samples_a_second,
        "skipped": skipped,
        "moved": np.linalg.norm(widths, axis=-1).max(initial=0.0),
        "limbs": [clip.rest_body.joints[limb.joint] for limb in limbs],
    }


def _mean_error(rows: Iterable[tuple], kind: str, way: str, mode: str, rate: int) -> dict[str, float]:
    """Return geometric means of the RMS shell error, and of the RMS velocity error where there is one."""
    errors = np.array([row[4:] for row in rows if row[:4] == (kind, way, mode, rate)]).reshape(-1, 2)
    return dict(zip(("shell", "velocity"), geometric_mean(errors).tolist(), strict=True))
