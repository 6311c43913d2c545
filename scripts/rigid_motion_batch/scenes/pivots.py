"""Pivot markers: crosses at a body point that stays in a recording, one for the recording and one for the mode.

They are in front of everything else in a lane, facing the camera.
"""

from __future__ import annotations

import math

import bpy
import numpy as np

from rigid_motion.animation import bake_poses
from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import multiply
from rigid_motion_batch.analysis.reconstructions import Ground, Reconstruction
from rigid_motion_batch.palette import colour_on

from . import layout
from .lanes import Cast, Lane
from .materials import ink

MODE_CROSS_RATIO = 0.6
"""The size of a mode's cross, relative to the recording's."""

ARM_RATIO, HALF_THICKNESS_RATIO = 0.017, 0.0022
"""The length of a cross's arms and half their thickness, in units of the frame's height."""


class Pivot:
    """Makes crosses in the lanes, for a recording at the frames (n,), whose point of shape (3,) stays."""

    def __init__(self, cast: Cast, recording: Poses, point: np.ndarray) -> None:
        self._cast, self._point = cast, point
        self._recorded = layout.swept_points(recording, point[None])
        self._recorded_mesh = _cross("Pivot of the recording", cast.layout.metres)
        self._recorded_mesh.materials.append(cast.ink)

    @classmethod
    def of(cls, made: Reconstruction, cast: Cast, recording: Poses, enlarged: float) -> Pivot | None:
        """Return the pivot of a reconstruction; None if no point stays, or the point is outside the view."""
        point = Ground.of(made).still_point
        # In an enlarged body, the point would not stay.
        if point is None or enlarged > 1.0:
            return None
        seen = layout.project(cast.seen_from_focus(layout.swept_points(recording, point[None])))[:, :2]
        low, high = cast.extent.low[:2], cast.extent.high[:2]
        return cls(cast, recording, point) if ((seen > low) & (seen < high)).all() else None

    def enter(self, lane: Lane, shown: Poses) -> None:
        """Add the recording's cross, and the mode's from its poses (n,) at the frames."""
        own = _cross(f"Pivot {lane.mode}", MODE_CROSS_RATIO * self._cast.layout.metres)
        own.materials.append(ink(f"Pivot {lane.mode}", colour_on(self._cast.theme, lane.mode)))
        for name, mesh, places, before in (
            (f"{lane.mode} recording pivot", self._recorded_mesh, self._recorded, 1.0),
            (f"{lane.mode} pivot", own, layout.swept_points(shown, self._point[None]), 1.05),
        ):
            cross = lane.child(name, mesh)
            cross.rotation_mode = "QUATERNION"
            cross.delta_location = (-before * self._cast.behind).tolist()
            bake_poses(cross, self._cast.timeline.frames, Poses(places, np.tile(self._upright, (len(places), 1))))

    @property
    def _upright(self) -> np.ndarray:
        """The rotation, in the space of a lane, that turns a cross to the camera."""
        half = (math.pi / 2.0 - layout.ELEVATION_RAD) / 2.0
        return multiply(
            layout.yaw_quaternion(-self._cast.framing.yaw), np.array((np.cos(half), np.sin(half), 0.0, 0.0))
        )


def _cross(name: str, metres: float) -> bpy.types.Mesh:
    """Return a cross centred on the origin; `metres` is the height of the picture."""
    long, short = ARM_RATIO * metres, HALF_THICKNESS_RATIO * metres
    corners = [(x, y, 0.0) for w, h in ((long, short), (short, long)) for x, y in ((-w, -h), (w, -h), (w, h), (-w, h))]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], [[0, 1, 2, 3], [4, 5, 6, 7]])
    return mesh
