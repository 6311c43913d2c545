"""Rigid objects in lanes: each moved by its mode, with the recording as a ghost, trails, key marks and a pivot."""

from __future__ import annotations

import bpy
import numpy as np

from rigid_motion.animation import bake_poses
from rigid_motion.blender import action_of, assign
from rigid_motion.motion import Poses
from rigid_motion_batch.palette import colour_on

from . import layout, trails
from .lanes import Cast, Lane
from .materials import ghost, ink, surface
from .nodes import apply_group
from .pivots import Pivot
from .subject import tinted_slots
from .timeline import ShownMotion

TRAIL_SECONDS = 0.8
PATH_BEHIND_SECONDS = 1.2
PATH_AHEAD_SECONDS = 0.5
MARKS_SHOWN = 14
"""The approximate number of marks shown at once: the nearest in time, if keys are dense."""

# In units of the frame's height.
TRAIL_RADIUS = 0.0036
PATH_RADIUS = 0.0014
MARK_RADIUS = 0.0052


class Solids:
    """Adds rigid objects to the lanes, with shared materials, node groups and meshes.

    Parameters
    ----------
    cast : Cast
    motion : ShownMotion
    deviated : dict of Poses
        Mode id to poses at the fine frames, with deviations from the recording magnified as shown.
    mesh : bpy.types.Mesh
    traced : array, shape (3,)
        The point of the object whose path is drawn.
    pivot : Pivot, optional
    """

    def __init__(
        self,
        cast: Cast,
        motion: ShownMotion,
        deviated: dict[str, Poses],
        mesh: bpy.types.Mesh,
        traced: np.ndarray,
        pivot: Pivot | None,
    ) -> None:
        self.cast, self.motion, self.deviated, self.mesh, self.traced = cast, motion, deviated, mesh, traced
        self.pivot = pivot
        self.ghost = ghost(cast.theme)
        self.ghost_action: bpy.types.Action | None = None
        self.cut_group = trails.cut_group() if cast.extent.cut else None
        self.trail_group, self.marks_group = trails.trail_group(), trails.marks_group()
        recording = self._path_of(motion.recording)
        self.path = trails.polyline("Recording path", cast.timeline.fine_frames, recording)

    def _path_of(self, poses: Poses) -> np.ndarray:
        """Return the path of the traced point, shape (n, 3)."""
        return layout.swept_points(poses, self.traced[None])

    def enter(self, lane: Lane) -> None:
        """Add the object, its ghost, trails and marks."""
        self.window = lane.window(self.cast.layout.metres)
        self._add_actors(lane)
        self._add_trails(lane)
        if self.pivot:
            self.pivot.enter(lane, self.deviated[lane.mode][:: self.cast.timeline.steps])

    def _add_actors(self, lane: Lane) -> None:
        mode, motion = lane.mode, self.motion
        frames, steps = self.cast.timeline.frames, self.cast.timeline.steps
        material = surface(f"Mode {mode}", colour_on(self.cast.theme, mode))
        self._add_actor(mode, lane, motion.modes[mode][::steps], material)
        if self.deviated[mode] is not motion.modes[mode]:
            # The true motion is kept for users who open the file; only the magnified one is visible.
            bpy.data.objects[mode].hide_render = bpy.data.objects[mode].hide_viewport = True
            self._add_actor(f"{mode} deviating", lane, self.deviated[mode][::steps], material)

        ghost = lane.child(f"{mode} recording", self.mesh)
        ghost.rotation_mode = "QUATERNION"
        ghost.delta_location = self.cast.behind.tolist()
        _paint(ghost, range(len(ghost.material_slots)), self.ghost)
        if self.ghost_action is None:
            bake_poses(ghost, frames, motion.recording[::steps])
            self.ghost_action = action_of(ghost)
            self.ghost_action.name = "recording"
        else:
            assign(ghost, self.ghost_action)

    def _add_actor(self, name: str, lane: Lane, poses: Poses, material: bpy.types.Material) -> None:
        actor = lane.child(name, self.mesh)
        actor.rotation_mode = "QUATERNION"
        _paint(actor, tinted_slots(self.mesh), material)
        bake_poses(actor, self.cast.timeline.frames, poses)
        action_of(actor).name = name
        if self.cut_group:
            apply_group(actor, self.cut_group, **self.window)

    def _add_trails(self, lane: Lane) -> None:
        mode, motion = lane.mode, self.motion
        cast, rate, metres = self.cast, self.cast.timeline.rate, self.cast.layout.metres
        trail = trails.polyline(f"{mode} trail", cast.timeline.fine_frames, self._path_of(self.deviated[mode]))
        window = {"Past": PATH_BEHIND_SECONDS * rate, "Ahead": PATH_AHEAD_SECONDS * rate}
        keys = motion.keys[mode]
        marks = trails.polyline(f"{mode} keys", motion.key_frames[mode], self._path_of(keys), joined=False)
        crowded = max(1.0, sum(window.values()) / (MARKS_SHOWN * cast.timeline.frames_per_key(len(keys))))
        apply_group(
            lane.child(f"{mode} trail", trail),
            self.trail_group,
            Past=TRAIL_SECONDS * rate,
            Ahead=0.0,
            Radius=TRAIL_RADIUS * metres,
            Taper=0.9,
            Material=ink(f"Trail {mode}", colour_on(cast.theme, mode)),
            **self.window,
        )
        apply_group(
            lane.child(f"{mode} recording path", self.path),
            self.trail_group,
            **window,
            Radius=PATH_RADIUS * metres,
            Taper=0.0,
            Material=cast.faint,
            **self.window,
        )
        apply_group(
            lane.child(f"{mode} keys", marks),
            self.marks_group,
            **{side: frames / crowded for side, frames in window.items()},
            Radius=MARK_RADIUS * metres,
            Material=cast.ink,
            **self.window,
        )


def _paint(obj: bpy.types.Object, slots: list[int] | range, material: bpy.types.Material) -> None:
    """Set a material for this object only, in slots of its shared mesh."""
    for slot in slots:
        obj.material_slots[slot].link = "OBJECT"
        obj.material_slots[slot].material = material
