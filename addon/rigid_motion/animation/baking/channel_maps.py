"""What the channels of transforms say on many frames: poses for the search for keys, and affine maps for its proof."""

from __future__ import annotations

from collections.abc import Mapping

import bpy
import numpy as np
from mathutils import Euler, Quaternion

from ...motion import Poses
from ...motion.affine import AffineMaps
from ...motion.eulers import ORDERS
from ...motion.quaternions import matrices, multiply
from ..compute.bodies import turn_into_quaternions
from ..compute.components import LOCATION, ROTATION, ROWS, SCALE
from ..compute.differences import in_betweens
from ..compute.sources import Source
from ..curves import LARGEST
from ..transforms import Channel, Transform


def shown(transform: Transform, source: Source, frames: np.ndarray) -> tuple[Poses, AffineMaps]:
    """Return how a source is seen on these frames (n,), with the object's own delta transforms, and what is not keyed.

    Returns
    -------
    poses : Poses, shape (n,)
        Along the axes of the body at rest. Where the scale is uneven, its geometric mean.
    maps : AffineMaps, shape (n,)
        Of the channels as Blender has them: location runs along its own axes, and scale may be uneven or negative.
    """
    desired = in_betweens(source, frames).desired
    delta, rest, along, count = source.original, transform.components(), source.location_axes, len(frames)
    positions, quaternions = desired.positions, desired.quaternions
    if LOCATION not in source.keyed:
        position = rest[ROWS[LOCATION]] + delta[ROWS[LOCATION]]
        positions = np.tile(position if along is None else along @ position, (count, 1))
    if ROTATION not in source.keyed:
        column = rest[:, None].copy()
        turn_into_quaternions(column, source.order)
        quaternions = np.tile(multiply(delta[ROWS[ROTATION]], column[ROWS[ROTATION], 0]), (count, 1))
    if desired.scales is not None:
        return Poses(positions, quaternions, desired.scales), _maps(
            positions, quaternions, desired.scales[:, None], along
        )
    scale = np.tile(rest[ROWS[SCALE]] * delta[ROWS[SCALE]], (count, 1))
    if SCALE in source.keyed:
        scale = (source.values_at(frames)[ROWS[SCALE]] * delta[ROWS[SCALE], None]).T
    mean = np.cbrt(np.abs(scale.prod(axis=1)))
    return Poses(positions, quaternions, mean), _maps(positions, quaternions, scale, along)


def evaluated(
    transform: Transform, curves: Mapping[Channel, bpy.types.FCurve], frames: np.ndarray
) -> tuple[Poses, AffineMaps]:
    """Return what `shown` does, for a bone that makes no source: by its F-curves as Blender evaluates them,
    or as it stands.
    """
    bone, frame_list = transform.carrier, frames.tolist()

    def values(name: str) -> np.ndarray:
        stands = getattr(bone, name)
        columns = []
        for index, value in enumerate(stands):
            fcurve = curves.get((transform.prefix + name, index))
            has_say = fcurve is not None and not fcurve.mute and not fcurve.is_empty
            columns.append([fcurve.evaluate(frame) for frame in frame_list] if has_say else [value] * len(frame_list))
        result = np.array(columns, dtype=np.float64).T
        return result if (np.abs(result) < LARGEST).all() else np.tile(np.array(stands), (len(frame_list), 1))

    mode = bone.rotation_mode
    if mode in ORDERS:
        turns = [Euler(angles, mode).to_quaternion() for angles in values("rotation_euler").tolist()]
    elif mode == "AXIS_ANGLE":
        turns = [Quaternion(axis, angle) for angle, *axis in values("rotation_axis_angle").tolist()]
    else:
        turns = [Quaternion(turn).normalized() for turn in values("rotation_quaternion").tolist()]
    along, scale = transform.location_axes, values("scale")
    positions = values("location") if along is None else values("location") @ along.T
    quaternions = np.array(turns, dtype=np.float64)
    mean = np.cbrt(np.abs(scale.prod(axis=1)))
    return Poses(positions, quaternions, mean), _maps(positions, quaternions, scale, along)


def _maps(positions: np.ndarray, quaternions: np.ndarray, scale: np.ndarray, along: np.ndarray | None) -> AffineMaps:
    """Return the maps with positions (n, 3) along the body's axes, quaternions (n, 4) and scales (n, 3) or (n, 1)."""
    axes = np.moveaxis(matrices(quaternions), -1, 0) * scale[:, None, :]
    return AffineMaps(axes, positions if along is None else positions @ along)
