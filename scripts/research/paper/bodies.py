"""The same study on whole bodies: key poses needed, errors, and what there is of a screw in a joint's own motion.

A body is studied three times. As a rig has it: every joint is interpolated in its parent's space. As trackers have it:
hands, feet and head alone, each a single rigid body in the space of the roots, which is that of the recording. And both
beside each other at the same keys. Errors are in metres, measured in the space of the roots.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rigid_motion.motion import Poses, decimate, interpolate, rms, shell_error
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
from rigid_motion_batch.recordings.reading import FORMATS, files_of

from .bows import SCREW
from .table import RADIUS, SAMPLES_AN_UPDATE

MODES = (REFERENCE, SCREW, "pga_lerp", "motor_spline")

ERROR_RATES = (5, 10)
"""Key poses a second at which errors are measured."""

BODY = "body"
"""What is said of a whole body, beside `LIMBS`."""

LIMBS = {"hands": ("hand", True), "feet": ("foot", True), "heads": ("head", False)}
"""Kinds of joints that a tracker may be on: what their names say, and whether there is one on either side."""

SIDES = ("left", "right")

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

MAY_HOLD_BODIES = ("BVH", "FBX", "glTF", "Blender file")
"""Formats that are looked at for a whole body among the recordings."""


# -- what there is to study --------------------------------------------------------------------------------------------


def body_files(paths: Iterable[Path]) -> list[Path]:
    """Return the files that are given, and in folders those that may hold a body, each once.

    Raises
    ------
    TrajectoryError
        Where there is no such file, or no such recording in a folder.
    """
    extensions = {extension for known in FORMATS if known.label in MAY_HOLD_BODIES for extension in known.extensions}
    result: dict[Path, None] = {}
    for path in paths:
        if not path.exists():
            raise TrajectoryError(str(path), "no such file or folder", "check the path")
        inside = [file for file in map(Path, files_of(str(path))) if file.suffix.lower() in extensions]
        files = inside if path.is_dir() else [path]
        if not files:
            known = ", ".join(sorted(extensions))
            raise TrajectoryError(str(path), "no recording in this folder that may hold a body", f"known are {known}")
        result |= dict.fromkeys(files)
    return list(result)


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
    if len(speeds) < 2 or speeds[0] <= JUMP * speeds[1:].max():
        return clip, 0
    return part_of(clip, 1, len(clip.times) - 1), 1


@dataclass(frozen=True)
class Limb:
    """A joint that was taken for one that a tracker may be on."""

    kind: str
    """Of `LIMBS`."""

    joint: int

    chain: int
    """How many joints that move carry it, itself among them."""


def limbs_of(clip: Clip) -> list[Limb]:
    """Return the joints that move and are hands, feet and head by their names.

    Of several it is the one of the plainest name, and of such the first.
    """
    words = [_words(joint) for joint in clip.rest_body.joints]
    moves = moving(clip)
    result = []
    for kind, (part, sided) in LIMBS.items():
        for side in SIDES if sided else ("",):
            named = [number for number, own in enumerate(words) if _is(own, part, side)]
            if named:
                joint = min(named, key=lambda number: len(words[number]))
                chain = int(sum(moves[one] for one in _chain(clip.rest_body.parents, joint)))
                result += [Limb(kind, joint, chain)] if chain else []
    return result


def _words(name: str) -> list[str]:
    """Return what a name is made of: "mixamorig:LeftHand" of mixamorig, left and hand."""
    parts = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", re.sub(r"[^0-9A-Za-z]+", " ", name))
    return [part.lower() for part in parts]


def _is(words: Sequence[str], part: str, side: str) -> bool:
    """Return whether these words end in a limb: "left hand", "lefthand", "hand l" and, without sides, "head"."""
    requested = {f"{a}{b}" for one in ((side, side[0]) if side else ("",)) for a, b in ((one, part), (part, one))}
    return "".join(words[-1:]) in requested or (len(words) > 1 and bool(side) and "".join(words[-2:]) in requested)


def _chain(parents: np.ndarray, joint: int) -> list[int]:
    chain = []
    while joint >= 0:
        chain.append(joint)
        joint = int(parents[joint])
    return chain


def alone(clip: Clip, joint: int) -> Clip:
    """Return a joint as a single rigid body in the space of the roots, as a tracker on it would have it."""
    return replace(clip, poses=clip.rest_body.skeleton.in_root_space(clip.poses)[joint], rest_body=None)


# -- what comes of it --------------------------------------------------------------------------------------------------

Shares = dict[str, dict[str, dict[str, list[float]]]]
"""By what it is of, mode and decimation: of each of `RATES` the keys needed as a share of the reference's; NaN where a
clip has no two samples to a key, infinite where it takes all samples."""


def has_samples_for(clip: Clip, rate: float) -> bool:
    """Return whether a body has two samples to a key pose."""
    return rate <= clip.samples_a_second * (1.0 + NEVER_EXACT) / SAMPLES_AN_UPDATE


def needed_of(clip: Clip, limbs: Iterable[Limb]) -> list[tuple[str, dict[str, dict[str, list[float]]]]]:
    """Return the keys that every mode needs, of the whole body and of each limb alone: what it is of, and shares."""
    radii = np.full(len(clip.rest_body.joints), JOINT)
    searched = part_of(clip, 0, int(np.searchsorted(clip.times, clip.times[0] + SEARCHED, side="right")) - 1)
    result = [(BODY, keys_needed(OfBody(searched, radii), MODES))]
    result += [(limb.kind, keys_needed(OfRigidBody(alone(clip, limb.joint), RADIUS), MODES)) for limb in limbs]
    return [(of, _shares(clip, keys)) for of, keys in result]


def _shares(clip: Clip, result: KeysNeeded) -> dict[str, dict[str, list[float]]]:
    counted = [has_samples_for(clip, float(rate)) for rate in result.rates]
    shares = np.where(counted, result.shares, np.nan)
    return {
        mode: {DECIMATIONS[way]: shares[row, way].tolist() for way in range(shares.shape[1])}
        for row, group in enumerate(result.groups)
        for mode in group
    }


def errors_of(clip: Clip, limbs: Sequence[Limb]) -> list[tuple[str, str, str, int, float, float]]:
    """Return the errors of all modes at `ERROR_RATES`: of the body, and of each limb in both ways at the same keys.

    What it is of, the way, the mode, the rate, the RMS shell error, and the RMS velocity error of the body.
    """
    rows = []
    for rate in ERROR_RATES:
        if not (made := _with_key_poses(clip, rate)):
            continue
        rows += [
            (BODY, THROUGH, row.mode, rate, row.rms_shell_m, row.rms_velocity_m_s)
            for row in measure_modes(made, JOINT).rows
        ]
        keys, truth = decimate(clip.times, rate), made.truth(made.samples)
        for mode in MODES:
            shown = made.shown(mode, made.times)
            for limb in limbs:
                single = alone(clip, limb.joint)
                filled = clip.in_metres(interpolate(clip.times[keys], single.poses[keys], made.times, mode))
                for way, poses in ((THROUGH, shown[limb.joint]), (ALONE, filled)):
                    error = rms(shell_error(poses, truth[limb.joint], RADIUS))
                    rows.append((limb.kind, way, mode, rate, error, float("nan")))
    return rows


def apart_of(clip: Clip) -> dict[int, dict[str, float]]:
    """Return how far a screw gets from `lerp_slerp` at most, in metres, at `ERROR_RATES`.

    "parents" is of all joints but the roots in their parents' spaces; "carried" of the same in the space of the roots,
    where these are held still: what adds up along a chain; "roots" of the roots; "all" of all joints in that space;
    "error" is how far `lerp_slerp` is from the recording there.
    """
    result, roots, skeleton = {}, clip.rest_body.parents < 0, clip.rest_body.skeleton
    for rate in ERROR_RATES:
        if not (made := _with_key_poses(clip, rate)):
            continue
        straight, screw = (made.filled_in(mode, made.times) for mode in (REFERENCE, SCREW))
        held = screw.copy()
        held[np.flatnonzero(roots)] = straight[roots]
        shown, carried, whole = (skeleton.in_root_space(poses) for poses in (straight, held, screw))
        truth = skeleton.in_root_space(clip.poses[:, made.samples])
        own = _distances(clip, straight, screw)
        result[rate] = {
            "parents": own[~roots].max(initial=0.0),
            "carried": _distances(clip, shown, carried)[~roots].max(initial=0.0),
            "roots": own[roots].max(),
            "all": _distances(clip, shown, whole).max(),
            "error": _distances(clip, shown, truth).max(),
        }
    return result


def _with_key_poses(clip: Clip, rate: int) -> BodyReconstruction | None:
    """Return it with evenly spaced ones; None where the clip has no two samples to each."""
    return reconstruct_body(clip, Uniform(str(rate)), MODES, JOINT) if has_samples_for(clip, rate) else None


def _distances(clip: Clip, first: Poses, second: Poses) -> np.ndarray:
    """Return how far the origins of joints get from one another, at most, in metres: shape (joints,)."""
    apart = np.linalg.norm(first.positions - second.positions, axis=-1)
    return apart.max(axis=-1) * clip.metres_per_unit


# -- over all bodies ---------------------------------------------------------------------------------------------------


def study(clips: Sequence[tuple[Clip, int]]) -> dict[str, Any]:
    """Return all of it in numbers, with geometric means over bodies, and over limbs of a kind."""
    limbs = {clip.name: limbs_of(clip) for clip, _ in clips}
    needed = {clip.name: needed_of(clip, limbs[clip.name]) for clip, _ in clips}
    errors = {clip.name: errors_of(clip, limbs[clip.name]) for clip, _ in clips}
    kinds = [kind for kind in (BODY, *LIMBS) if any(of == kind for own in needed.values() for of, _ in own)]
    every = [row for own in errors.values() for row in own]
    return {
        "bodies": {clip.name: _told(clip, skipped, limbs[clip.name]) for clip, skipped in clips},
        "rates": [int(rate) for rate in RATES],
        "needed": {
            kind: {
                mode: {
                    way: _mean([shares[mode][way] for own in needed.values() for of, shares in own if of == kind])
                    for way in DECIMATIONS[:2]
                }
                for mode in MODES
            }
            for kind in kinds
        },
        "chains": {
            kind: [limb.chain for own in limbs.values() for limb in own if limb.kind == kind] for kind in kinds[1:]
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
                mode: {rate: _mean_error(own, BODY, THROUGH, mode, rate)["shell"] for rate in ERROR_RATES}
                for mode in MODES
            }
            for name, own in errors.items()
        },
        "apart": {clip.name: apart_of(clip) for clip, _ in clips},
    }


def _told(clip: Clip, skipped: int, limbs: Iterable[Limb]) -> dict[str, Any]:
    """Return what is said of a body; "moved" is the farthest that any joint but the roots moves in its parent's space.

    That is from corner to corner of what it fills.
    """
    widths = np.ptp(clip.poses.positions, axis=1)[clip.rest_body.parents >= 0] * clip.metres_per_unit
    return {
        "joints": len(clip.rest_body.joints),
        "seconds": float(clip.times[-1] - clip.times[0]),
        "samples_per_s": clip.samples_a_second,
        "skipped": skipped,
        "moved": np.linalg.norm(widths, axis=-1).max(initial=0.0),
        "limbs": [clip.rest_body.joints[limb.joint] for limb in limbs],
    }


def _mean(shares: Sequence[Sequence[float]]) -> dict[str, list[Any]]:
    """Return for each of `RATES` the mean share saved, on how many it was reached, and of how many."""
    table = np.array(shares)
    return {
        "saved": 1.0 - geometric_mean(table),
        "reached": np.isfinite(table).sum(axis=0),
        "asked": (~np.isnan(table)).sum(axis=0),
    }


def _mean_error(rows: Iterable[tuple], of: str, way: str, mode: str, rate: int) -> dict[str, float]:
    """Return geometric means of the RMS shell error, and of the RMS velocity error where there is one."""
    errors = np.array([row[4:] for row in rows if row[:4] == (of, way, mode, rate)]).reshape(-1, 2)
    return dict(zip(("shell", "velocity"), geometric_mean(errors).tolist(), strict=True))
