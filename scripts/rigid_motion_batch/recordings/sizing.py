"""Size of a body, and the unit and the up axis that it makes likely if the file does not state them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.motion.humanoid import humanoid_bones
from rigid_motion.motion.repair import MAX_MEASURE
from rigid_motion_batch.axes import AXES

from .clips import ClipWarning
from .recordings import Trajectory, shown
from .rest_bodies import (
    LOOKED_AT,
    MAX_SAME_NUMBER_RATIO,
    PLAUSIBLE_HEIGHTS_M,
    ZERO_SIZE,
    RestBody,
    certainty,
    part_of_body,
    unit_above_floor,
)

MIN_UPRIGHT_RATIO = 1.5
"""Smallest ratio of the extent along the up axis to the other extents of a body."""


def sized(path: Path, trajectory: Trajectory, axes: str, *, unit_given: bool) -> Trajectory:
    """Return a whole body in the likely unit for its size, if its unit is not given or cannot be right.

    `axes` are those of the file: a name in `axes.AXES`.
    """
    body = trajectory.rest_body
    if body is None or (places := whole_places(body, trajectory.poses)) is None:
        return trajectory
    places = places[part_of_body(body.parents, places), 0] * trajectory.metres_per_unit
    size, heights = float(np.ptp(places, axis=0).max()), places @ AXES[axes][2]
    unit, length, why = unit_above_floor(size, float(heights.min()), float(heights.max()))
    metres = size * length
    if size < ZERO_SIZE or (unit_given and length == 1.0):
        return trajectory
    remark, warnings = trajectory.remark, trajectory.warnings
    if length != 1.0:
        taken = f"{shown(path.name)} is {size:.4g} units large, which are taken for {unit}: {metres:.3g} m"
        taken += f", {why or certainty(size, length)} (otherwise: --scale METRES)"
        remark = "; ".join(filter(None, (taken, remark)))
    if not PLAUSIBLE_HEIGHTS_M[0] <= metres <= PLAUSIBLE_HEIGHTS_M[1]:
        doubt = f"it is {metres:.3g} m large if its unit, which the file does not tell, is that of {unit}"
        warnings += (ClipWarning(doubt, "if not, say how long it is: --scale METRES"),)
    return replace(trajectory, metres_per_unit=trajectory.metres_per_unit * length, remark=remark, warnings=warnings)


def whole_places(body: RestBody, poses: Poses) -> np.ndarray | None:
    """Return joint positions of a body at a few undamaged moments, shape (joints, m, 3), or None if there are none."""
    every = -(-poses.shape[1] // LOOKED_AT)
    with np.errstate(invalid="ignore", over="ignore"):
        places = body.skeleton.in_root_space(poses[:, ::every]).positions
    whole = (np.abs(places) < MAX_MEASURE).all(axis=(0, 2))
    return places[:, whole] if whole.any() else None


def axis_up(body: RestBody, poses: Poses) -> str:
    """Return which of x, y and z points up for a body in the first of these poses (joints, n); empty if unclear.

    The head is above the hips, and the hips above the feet. For unknown joint names, the longest extent is vertical.
    """
    places, bones = body.skeleton.in_root_space(poses[:, :1]).positions[:, 0], humanoid_bones(body.joints)
    feet = [bones[name] for name in ("LeftFoot", "RightFoot") if name in bones]
    if "Hips" in bones and "Head" in bones:
        hips = places[bones["Hips"]]
        along = [places[bones["Head"]] - hips, *([hips - places[feet].mean(axis=0)] if feet else [])]
        best = {int(np.argmax(vector)) for vector in along}
        return "xyz"[best.pop()] if len(best) == 1 else ""
    extents = np.ptp(places[part_of_body(body.parents, whole_places(body, poses))], axis=0)
    largest = int(np.argmax(extents))
    return "xyz"[largest] if extents[largest] > MIN_UPRIGHT_RATIO * np.delete(extents, largest).max() else ""


def leading(body: RestBody, poses: Poses) -> Poses:
    """Return the motion (n,) of the joint that leads a body: its first root, or a descendant if the root stands still.

    Among children, the one with the most joints is followed, but moving branches take precedence. `poses` are those of
    the joints (joints, n) in their parents' space.
    """
    joint, sizes, stands = 0, body.skeleton.sizes, np.array([_stands_still(own) for own in poses])
    moves = ~stands
    for child in range(len(moves) - 1, 0, -1):
        if body.parents[child] >= 0:
            moves[body.parents[child]] |= moves[child]
    while stands[joint] and len(children := np.flatnonzero(body.parents == joint)):
        joint = int(max(children, key=lambda child: (moves[child], sizes[child])))
    return body.skeleton.in_root_space(poses)[0 if stands[joint] else joint]


def _stands_still(poses: Poses) -> bool:
    parts = poses.positions, poses.quaternions
    return all(np.ptp(part, axis=0).max() <= MAX_SAME_NUMBER_RATIO * np.abs(part).max(initial=1.0) for part in parts)
