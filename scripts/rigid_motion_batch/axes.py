"""Axis conventions, and conversion of poses to Blender's axes: right-handed, z up, y forward, x right.

Each convention is a matrix C of shape (3, 3) that takes a point of the recording to Blender. A rotation R becomes
C R C^T: the body's own axes change convention together with the world's. So the direction that a device or a camera
faces becomes y of the object in Blender, and its up direction becomes z.
"""

from __future__ import annotations

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.motion.poses import in_other_axes
from rigid_motion.motion.quaternions import conjugate, multiply

AXES: dict[str, np.ndarray] = {
    # Right-handed, z up, y forward: nothing to do.
    "blender": np.eye(3),
    # Right-handed, y up, -z forward: OpenGL, OpenXR, WebXR, A-Frame, Motive, most BVH.
    "opengl": np.array(((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0))),
    # Left-handed, y up, z forward.
    "unity": np.array(((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0))),
    # Right-handed, z up, x forward (REP 103).
    "ros": np.array(((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))),
    # Left-handed, z up, x forward, y right; its lengths are centimetres.
    "unreal": np.array(((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))),
    # Right-handed, y down, z forward: cameras of OpenCV, COLMAP, KITTI.
    "opencv": np.array(((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0))),
}

NERF = "nerf"
"""The axes of NeRF's transforms.json: Blender's axes for the world, OpenGL's axes for its cameras."""

DESCRIBED = {
    "blender": "z up, y forward",
    "opengl": "y up, -z forward",
    "unity": "left-handed, y up, z forward",
    "ros": "z up, x forward",
    "unreal": "left-handed, z up, x forward",
    "opencv": "y down, z forward",
    NERF: "z up; cameras y up, -z forward",
}
"""Descriptions of the conventions."""

_Z_UP_TO_OPENGL = np.sqrt(0.5) * np.array((1.0, -1.0, 0.0, 0.0))
"""The rotation from a body with z up and y forward to one with OpenGL's axes."""


def to_blender(poses: Poses, axes: str) -> Poses:
    """Return the poses in Blender's axes.

    Parameters
    ----------
    poses : Poses, shape (..., n)
    axes : str
        The convention of `poses`: a name in `AXES`; or `NERF`, for poses in the world.

    Raises
    ------
    ValueError
        If there is no such convention.
    """
    if axes == NERF:
        return Poses(poses.positions, multiply(poses.quaternions, _Z_UP_TO_OPENGL), poses.scales)
    if axes not in AXES:
        raise ValueError(f"there are no axes named {axes!r}; known are {', '.join(AXES)}")
    return in_other_axes(poses, AXES[axes])


def from_blender(poses: Poses, axes: str) -> Poses:
    """Return the opposite of `to_blender`."""
    if axes == NERF:
        return Poses(poses.positions, multiply(poses.quaternions, conjugate(_Z_UP_TO_OPENGL)), poses.scales)
    return in_other_axes(poses, AXES[axes].T)
