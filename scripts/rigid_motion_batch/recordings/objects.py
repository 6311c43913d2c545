"""Objects of the open Blender, where it shows them: alone, or as the joints of a body that has no armature.

And what it takes to look at anything there, frame by frame.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.motion.poses import joined

from .matrices import filled, rigid, scales_of
from .recordings import Trajectory, TrajectoryError, refuse_too_many, shown
from .rest_bodies import RestBody, likely_metres, tails_of
from .sampling import OF_JOINTS, OF_OBJECTS, Moments, sampled

if TYPE_CHECKING:
    import bpy


LAST_FRAME = 1048574
"""Last frame that Blender has; a damaged file could, and would keep it at work for hours."""

BLOCK_FRAMES = 256
"""Frames whose matrices are kept at once."""


def single_object(path: Path, obj: bpy.types.Object, name: str, moments: Moments, scale: float | None) -> Trajectory:
    """Return the motion of an object in the world. `scale` is the length of the unit in metres, if the user says so."""
    with _looking(path, [obj]) as look:
        seen = sampled(moments, look, np.array([-1]), OF_OBJECTS, scale or 1.0)
    return seen.as_singles([name], moments, scale or 1.0)[0]


def body_of_objects(
    path: Path,
    objects: Sequence[bpy.types.Object],
    parents: np.ndarray,
    names: Sequence[str],
    title: str,
    moments: Moments,
    scale: float | None,
) -> Trajectory:
    """Return objects as the joints of a whole body, which rests where they are at first.

    `parents` has the number of what each hangs on among them, -1 for nothing, shape (objects,).
    """
    with _looking(path, objects) as look:
        first = look(moments.frames[:1])
        rest = filled(Poses(first.positions, first.quaternions))[:, 0]
        metres = scale or likely_metres(parents, rest.positions)
        seen = sampled(moments, lambda frames: _unscaled(look(frames)), parents, OF_JOINTS, metres)
    rest_body = RestBody(tuple(names), parents, rest, tails_of(rest, parents))
    return seen.as_body(title, moments, metres, rest_body)


def _unscaled(poses: Poses) -> Poses:
    return Poses(poses.positions, poses.quaternions)


@contextmanager
def _looking(path: Path, objects: Sequence[bpy.types.Object]) -> Iterator[Callable[[np.ndarray], Poses]]:
    """Yield what returns objects in the world on frames (n,), shape (objects, n)."""

    def matrices_at(depsgraph: bpy.types.Depsgraph) -> np.ndarray:
        return np.array([matrix_of(other.evaluated_get(depsgraph)) for other in objects])

    with probe() as obj:
        for other in objects:
            copying = cast("bpy.types.CopyTransformsConstraint", obj.constraints.new("COPY_TRANSFORMS"))
            copying.target = other
        yield lambda frames: poses_on(path, objects[0].name, len(objects), frames, matrices_at)


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


def poses_on(
    path: Path,
    name: str,
    count: int,
    frames: np.ndarray,
    matrices_at: Callable[[bpy.types.Depsgraph], np.ndarray],
) -> Poses:
    """Return what some matrices (count, 4, 4) are on frames (n,) of the scene, shape (count, n), with scales.

    Raises
    ------
    TrajectoryError
        Where that is too much, or beyond where Blender goes.
    """
    import bpy

    refuse_far_frames(path, name, frames)
    refuse_too_many(path, count, len(frames))
    scene, depsgraph, parts = cast("bpy.types.Scene", bpy.context.scene), bpy.context.evaluated_depsgraph_get(), []
    for first in range(0, len(frames), BLOCK_FRAMES):
        block = []
        for frame in frames[first : first + BLOCK_FRAMES].tolist():
            whole = int(np.floor(frame))
            scene.frame_set(whole, subframe=frame - whole)
            block.append(matrices_at(depsgraph))
        matrices = np.stack(block, axis=1)
        poses = rigid(matrices)
        parts.append(Poses(poses.positions, poses.quaternions, scales_of(matrices[..., :3, :3])))
    return joined(parts, axis=1)


def matrix_of(obj: bpy.types.Object) -> np.ndarray:
    """Return where an object is in the world, shape (4, 4), in double precision: NumPy takes it as Blender has it."""
    return np.array(obj.matrix_world, dtype=np.float64)


def refuse_far_frames(path: Path, name: str, frames: np.ndarray) -> None:
    """Raise TrajectoryError for frames where Blender does not go, at which an object of that name is to be seen."""
    if not (np.abs(frames) <= LAST_FRAME).all():
        problem = f"{shown(name)} moves from frame {frames.min():g} to {frames.max():g}, where Blender does not go"
        raise TrajectoryError(path, problem, "delete the keys that are far off")
