"""Forward kinematics of rigs by Blender's rules: the poses of bones from their channels, for many frames at once.

A bone follows its parent according to *Inherit Rotation*, *Inherit Scale*, *Local Location* and *Connected*, including
uneven and negative scale and any resulting shear. Constraints and drivers are ignored.

Source of the rules: `BKE_bone_parent_transform_calc_from_matrices` in Blender's `armature.cc`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import bpy
import numpy as np

from ...motion.affine import AffineMaps, turned

SOME_SHEAR = 1e-4
"""Smaller cosines between axes do not count as shear in Blender."""


class Hierarchy:
    """All bones of a rig at rest, numbered in the given order, and their parents."""

    def __init__(self, bones: Sequence[bpy.types.PoseBone]) -> None:
        self.bones = [bone.bone for bone in bones]
        numbers = {bone.name: number for number, bone in enumerate(bones)}
        self.parents = np.array([numbers[bone.parent.name] if bone.parent else -1 for bone in bones], dtype=np.int64)
        self.order = sorted(range(len(bones)), key=lambda number: len(bones[number].parent_recursive))
        """The numbers of the bones, parents before children."""
        rest = np.array([bone.matrix_local for bone in self.bones], dtype=np.float64).reshape(-1, 4, 4)
        self.rest = AffineMaps(rest[:, :3, :3], rest[:, :3, 3])
        """The rest poses of bones, shape (bones,)."""
        inverse = np.linalg.inv(rest)
        offsets = np.where((self.parents >= 0)[:, None, None], inverse[self.parents] @ rest, rest)
        self.offsets = AffineMaps(offsets[:, :3, :3], offsets[:, :3, 3])
        """The rest poses of bones in the spaces of their parents."""

    def pose(self, numbers: Iterable[int], channels: AffineMaps, placed: AffineMaps) -> None:
        """Update the poses of these bones, and of all bones below them, in `placed`, shape (bones, n)."""
        changed = set(numbers)
        for number in self.order:
            if number in changed or self.parents[number] in changed:
                changed.add(number)
                parent = self.parents[number]
                placed[number] = self.placed(number, channels[number], placed[parent] if parent >= 0 else None)

    def placed(self, number: int, channels: AffineMaps, above: AffineMaps | None) -> AffineMaps:
        """Return the poses of a bone with channels (n,); `above` (n,) are its parent's poses, None without a parent."""
        bone, offset, parent = self.bones[number], self.offsets[number], int(self.parents[number])
        if above is None:
            along = offset.axes if bone.use_local_location else np.eye(3)
            return AffineMaps(offset.axes @ channels.axes, offset.origins + turned(along, channels.origins))
        along = above.axes @ offset.axes if bone.use_local_location else above.axes
        origins = above.at(offset.origins)
        # Blender keeps a connected bone at the tail of its parent.
        if not bone.use_connect:
            origins = origins + turned(along, channels.origins)
        axes, growth = _inherited(bone, above.axes, self.rest.axes[parent], offset.axes)
        return AffineMaps(axes @ channels.axes * growth, origins)


def _inherited(
    bone: bpy.types.Bone, above: np.ndarray, above_at_rest: np.ndarray, offset: np.ndarray
) -> tuple[np.ndarray, np.ndarray | float]:
    """Return the axes in which a bone's rotation and scale apply, (n, 3, 3), and the final scale of its axes.

    `above` are the axes (n, 3, 3) of its parent, `above_at_rest` (3, 3) the parent's at rest, `offset` (3, 3) its own
    at rest relative to the parent.
    """
    growth: np.ndarray | float = 1.0
    mode = bone.inherit_scale
    if bone.use_inherit_rotation:
        axes = above
        if mode in ("NONE", "AVERAGE"):
            axes = without_shear(above, normalise=True)
        elif mode == "ALIGNED":
            axes, growth = _unit(without_shear(above), 1)
        elif mode == "NONE_LEGACY":
            axes = _unit(above, 1)[0]
    else:
        axes = np.broadcast_to(above_at_rest, above.shape)
        if mode == "FULL":
            axes = axes * _unit(above, 1)[1]
        elif mode == "FIX_SHEAR":
            axes = axes * _lengths_by_volume(above)
        elif mode == "ALIGNED":
            growth = _lengths_by_volume(above)
    if mode == "AVERAGE":
        axes = axes * np.cbrt(np.abs(np.linalg.det(above)))[:, None, None]
    axes = axes @ offset
    if mode == "FIX_SHEAR":
        axes = without_shear(axes)
    return axes, growth


def without_shear(axes: np.ndarray, *, normalise: bool = False) -> np.ndarray:
    """Return axes (n, 3, 3) made orthogonal around Y as Blender does it: X and Z each turn by half of the deviation.

    The volume is kept, unless axes are normalised to length 1.
    """
    x, y, z = np.moveaxis(axes, -1, 0)
    unit_y = _unit(y)[0]
    (unit_x, length_x), (unit_z, length_z) = (_unit(axis - unit_y * _dot(axis, unit_y)) for axis in (x, z))
    cosine = _dot(unit_x, unit_z)
    sheared = (np.abs(cosine) > SOME_SHEAR) & (np.abs(cosine) < 1.0 - np.finfo(np.float32).eps)
    between, across = _unit(unit_x + unit_z)[0], _unit(unit_x - unit_z)[0]
    unit_x = np.where(sheared, (between + across) * np.sqrt(0.5), unit_x)
    unit_z = np.where(sheared, (between - across) * np.sqrt(0.5), unit_z)
    if normalise:
        return np.stack((unit_x, unit_y, unit_z), axis=-1)
    shrink = (1.0 - np.where(sheared, cosine, 0.0) ** 2) ** 0.25
    return np.stack((unit_x * length_x * shrink, y, unit_z * length_z * shrink), axis=-1)


def _lengths_by_volume(axes: np.ndarray) -> np.ndarray:
    """Return the lengths of axes (n, 3, 3) as rows (n, 1, 3), whose product is the volume, even with shear."""
    lengths = _unit(axes, 1)[1]
    product = lengths.prod(axis=-1, keepdims=True)
    return lengths * np.cbrt(np.abs(np.linalg.det(axes))[:, None, None] / np.where(product > 0.0, product, 1.0))


def _unit(vectors: np.ndarray, axis: int = -1) -> tuple[np.ndarray, np.ndarray]:
    """Return vectors normalised to length 1, and their former lengths. Zero vectors stay zero."""
    lengths = np.linalg.norm(vectors, axis=axis, keepdims=True)
    return vectors / np.where(lengths > 0.0, lengths, 1.0), lengths


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the dot products of vectors (n, 3), shape (n, 1)."""
    return np.einsum("ni,ni->n", a, b)[:, None]
