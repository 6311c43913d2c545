"""Poses of objects and bones as evaluated by Blender, frame by frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.motion.poses import joined

from .matrices import rigid, scales_of
from .recordings import Trajectory, TrajectoryError, refuse_too_many, shown
from .sampling import Moments, sampled

if TYPE_CHECKING:
    import bpy

LAST_FRAME = 1048574
"""Blender's last frame. A damaged file could name a later one, and keep Blender busy for hours."""

BLOCK_FRAMES = 256
"""Frames whose matrices are kept in memory at once."""


def single_motions(
    path: Path,
    rig: bpy.types.Object,
    bones: Sequence[str],
    names: Sequence[str],
    moments: Moments,
    radius: float,
    metres: float,
) -> list[Trajectory]:
    """Return the motions of bones in the world (or of an object, if there are no bones), one trajectory per name.

    `radius`, in metres, is that of the ball in which errors of all points count; `metres` is the length of the unit.
    """
    with looking(path, [rig], rig, bones) as look:
        seen = sampled(moments, look, np.full(len(names), -1), radius, metres)
    return seen.as_singles(names, moments, metres)


@contextmanager
def looking(
    path: Path,
    objects: Sequence[bpy.types.Object],
    rig: bpy.types.Object | None = None,
    bones: Sequence[str] = (),
) -> Iterator[Look]:
    """Yield a function that evaluates bones of a rig in the world, or objects if there are no bones.

    If there are bones, the objects are evaluated too.
    """
    with probe() as obj:
        if rig and bones:
            # Blender evaluates only bones that something depends on.
            held = cast("bpy.types.ArmatureConstraint", obj.constraints.new("ARMATURE"))
            for bone in bones:
                target = held.targets.new()
                target.target, target.subtarget = rig, bone
        for other in objects:
            copying = cast("bpy.types.CopyTransformsConstraint", obj.constraints.new("COPY_TRANSFORMS"))
            copying.target = other
        yield Look(path, objects, rig, bones)


@contextmanager
def probe() -> Iterator[bpy.types.Object]:
    """Yield an object in a new current scene, where everything that its constraints follow is evaluated.

    Blender evaluates hidden objects only if visible ones depend on them. The object and the scene are removed
    afterwards.
    """
    import bpy

    stage, obj = bpy.data.scenes.new("Reading"), bpy.data.objects.new("Probe", None)
    try:
        stage.collection.objects.link(obj)
        with bpy.context.temp_override(scene=stage, view_layer=stage.view_layers[0]):
            yield obj
    finally:
        bpy.data.objects.remove(obj)
        bpy.data.scenes.remove(stage)


@dataclass(eq=False)
class Look:
    """Evaluator of bones of an armature, or of objects."""

    path: Path
    objects: Sequence[bpy.types.Object]
    rig: bpy.types.Object | None
    bones: Sequence[str]
    first: dict[bpy.types.Object, np.ndarray] = field(default_factory=dict)
    """World matrices of the armature and the objects at the first evaluation, shape (4, 4) each."""

    def __call__(self, frames: np.ndarray) -> Poses:
        """Return the poses on frames (n,), with scales, shape (bones, n) or (objects, n).

        The quaternion of a matrix without a direction is NaN.

        Raises
        ------
        TrajectoryError
            If there are too many poses or frames beyond Blender's limit, or the pose of the armature lacks a bone.
        """
        import bpy

        count = len(self.bones or self.objects)
        refuse_far_frames(self.path, (self.rig or self.objects[0]).name, frames)
        refuse_too_many(self.path, count, len(frames))
        scene, depsgraph, parts = cast("bpy.types.Scene", bpy.context.scene), bpy.context.evaluated_depsgraph_get(), []
        for first in range(0, len(frames), BLOCK_FRAMES):
            block = []
            for frame in frames[first : first + BLOCK_FRAMES].tolist():
                whole = int(np.floor(frame))
                scene.frame_set(whole, subframe=frame - whole)
                block.append(self._matrices(depsgraph))
            matrices = np.stack(block, axis=1)
            poses = rigid(matrices)
            parts.append(Poses(poses.positions, poses.quaternions, scales_of(matrices[..., :3, :3])))
        return joined(parts, axis=1)

    def _matrices(self, depsgraph: bpy.types.Depsgraph) -> np.ndarray:
        """Return the current world matrices of the bones or objects, shape (bones, 4, 4) or (objects, 4, 4)."""
        if not self.rig or not self.bones:
            return np.array([matrix_of(other.evaluated_get(depsgraph)) for other in self.objects])
        seen, rows = self.rig.evaluated_get(depsgraph), self._bone_rows
        pose = cast("bpy.types.Pose", seen.pose)  # Without a pose, `_bone_rows` raised an error.
        raw = np.empty(16 * len(pose.bones), dtype=np.float32)
        pose.bones.foreach_get("matrix", raw)
        # Blender returns matrices column by column.
        columns = raw.reshape(-1, 4, 4)[rows].astype(np.float64)
        with np.errstate(invalid="ignore", over="ignore"):
            return matrix_of(seen) @ columns.transpose(0, 2, 1)

    @cached_property
    def _bone_rows(self) -> np.ndarray:
        """Indices of the bones in the list of pose bones, which has its own order."""
        import bpy

        depsgraph, rig = bpy.context.evaluated_depsgraph_get(), cast("bpy.types.Object", self.rig)
        for item in (rig, *self.objects):
            self.first[item] = matrix_of(item.evaluated_get(depsgraph))
        seen = rig.evaluated_get(depsgraph)
        places = {bone.name: row for row, bone in enumerate(seen.pose.bones)} if seen.pose else {}
        if missing := [bone for bone in self.bones if bone not in places]:
            problem = f"the pose of {shown(seen.name)} lacks the bone {shown(missing[0])}"
            raise TrajectoryError(self.path, problem, "save the file again from Blender")
        return np.array([places[bone] for bone in self.bones])


def unscaled(poses: Poses) -> Poses:
    return Poses(poses.positions, poses.quaternions)


def matrix_of(obj: bpy.types.Object) -> np.ndarray:
    """Return the world matrix of an object, shape (4, 4), converted from Blender's single to double precision."""
    return np.array(obj.matrix_world, dtype=np.float64)


def refuse_far_frames(path: Path, name: str, frames: np.ndarray) -> None:
    """Raise TrajectoryError if the object or body of that name has frames beyond Blender's limit."""
    if not (np.abs(frames) <= LAST_FRAME).all():
        problem = f"{shown(name)} moves from frame {frames.min():g} to {frames.max():g}, where Blender does not go"
        raise TrajectoryError(path, problem, "delete the keys that are far off")
