"""What Blender shows of objects and bones, frame by frame."""

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
"""Last frame that Blender has; a damaged file could, and would keep it at work for hours."""

BLOCK_FRAMES = 256
"""Frames whose matrices are kept at once."""


def single_motions(
    path: Path,
    rig: bpy.types.Object,
    bones: Sequence[str],
    names: Sequence[str],
    moments: Moments,
    radius: float,
    metres: float,
) -> list[Trajectory]:
    """Return the motions of bones in the world, or without any of an object, a trajectory each under these names.

    `radius` is that of the balls in which all points count, in metres; `metres` is the length of the unit.
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
    """Look at bones of a rig in the world, or without any at objects, with everything that moves them.

    Objects are evaluated beside bones, too.
    """
    with probe() as obj:
        if rig and bones:
            # The bones are evaluated that something depends on.
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
    """Yield an object that is shown in the current scene, which is new; whatever its constraints follow is evaluated.

    Blender evaluates what is hidden only for the sake of what is shown. Both are gone afterwards.
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
    """Look at bones of an armature, or at objects."""

    path: Path
    objects: Sequence[bpy.types.Object]
    rig: bpy.types.Object | None
    bones: Sequence[str]
    first: dict[bpy.types.Object, np.ndarray] = field(default_factory=dict)
    """Matrices of the armature and of the objects, as they were at first, shape (4, 4) each."""

    def __call__(self, frames: np.ndarray) -> Poses:
        """Return them on some frames (n,), shape (bones, n) or (objects, n), with scales.

        NaN is the quaternion of one that has no direction.

        Raises
        ------
        TrajectoryError
            Where that is too much, or beyond where Blender goes, or where the pose of the armature lacks a bone.
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
        """Return where Blender has all of them now, shape (bones, 4, 4) or (objects, 4, 4)."""
        if not self.rig or not self.bones:
            return np.array([matrix_of(other.evaluated_get(depsgraph)) for other in self.objects])
        seen, rows = self.rig.evaluated_get(depsgraph), self._rows
        pose = cast("bpy.types.Pose", seen.pose)  # Where there is none, `_rows` says so.
        raw = np.empty(16 * len(pose.bones), dtype=np.float32)
        pose.bones.foreach_get("matrix", raw)
        # They come column by column.
        columns = raw.reshape(-1, 4, 4)[rows].astype(np.float64)
        with np.errstate(invalid="ignore", over="ignore"):
            return matrix_of(seen) @ columns.transpose(0, 2, 1)

    @cached_property
    def _rows(self) -> np.ndarray:
        """Where the bones are in the list of the pose, which has an order of its own."""
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
    """Return where an object is in the world, shape (4, 4), in double precision: NumPy takes it as Blender has it."""
    return np.array(obj.matrix_world, dtype=np.float64)


def refuse_far_frames(path: Path, name: str, frames: np.ndarray) -> None:
    """Raise TrajectoryError for frames where Blender does not go, at which an object of that name is to be seen."""
    if not (np.abs(frames) <= LAST_FRAME).all():
        problem = f"{shown(name)} moves from frame {frames.min():g} to {frames.max():g}, where Blender does not go"
        raise TrajectoryError(path, problem, "delete the keys that are far off")
