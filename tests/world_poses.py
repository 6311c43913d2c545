"""World poses of objects, frame by frame, as Blender evaluates them."""

from __future__ import annotations

import bpy
import numpy as np

from rigid_motion.motion import Poses


def read_poses(obj: bpy.types.Object, frames: np.ndarray) -> Poses:
    """Return the world poses of `obj` as the scene evaluates them, with parents, constraints, drivers and deltas.

    The scene steps through `frames` (shape (n,), sub-frames allowed) and returns to its previous frame. Scales are kept
    if the object is scaled; they are the mean of the three axes.
    """
    scene = bpy.context.scene
    assert scene is not None
    depsgraph = bpy.context.evaluated_depsgraph_get()
    before, subframe = scene.frame_current, scene.frame_subframe
    rows = np.empty((len(frames), 8))
    try:
        for row, frame in enumerate(frames):
            whole = int(np.floor(frame))
            scene.frame_set(whole, subframe=float(frame - whole))
            location, rotation, scale = obj.evaluated_get(depsgraph).matrix_world.decompose()
            rows[row] = np.concatenate((np.array(location), np.array(rotation), [np.array(scale).mean()]))
    finally:
        scene.frame_set(before, subframe=subframe)
    return Poses(rows[:, :3], rows[:, 3:7], None if np.allclose(rows[:, 7], 1.0, atol=1e-6) else rows[:, 7])
