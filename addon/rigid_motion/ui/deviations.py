"""*Show Deviations*: finds and marks the frames with pops and kinks on paths, and steps from one to the next.

A pop or a kink is a jump of the velocity of any point of a body, many times as large as the jumps around it.
"""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_

from ..animation.transforms import Transform
from ..blender import IntProperty, Operator, Returned, existing, view_layer, with_properties
from ..motion.speeds import jumps
from .overlay.cache import drawn_paths
from .overlay.drawing import Pen, batch_of, path_drawers
from .overlay.held import motion_now
from .overlay.kinds import axis_length_of
from .overlay.points import DrawnPath
from .overlay.settings import RigidMotionOverlay, overlay_settings
from .targets import targets_of
from .wording import labelled

MARK_COLOR = (1.0, 0.15, 0.75, 1.0)
"""The color of a mark on the path; nothing else there has it."""

MARK_DIAMETER_PX, MARK_BORDER_PX = 16.0, 3.0

MAX_NAMED_FRAMES = 6
"""The most frames listed in the sidebar."""

_deviations_by_path: WeakKeyDictionary[DrawnPath, tuple[float, np.ndarray]] = WeakKeyDictionary()
"""Cache by path, a new object after every edit: the threshold, and the frames (d,) that deviate."""


def deviations_on(path: DrawnPath, target: Transform, settings: RigidMotionOverlay) -> np.ndarray:
    """Return the whole frames (d,) of the Action on which a target deviates, in the mode that its path shows."""
    threshold, mode = settings.deviation_threshold, settings.mode
    if (known := _deviations_by_path.get(path)) is None or known[0] != threshold:
        motion = motion_now(target, existing(view_layer().depsgraph))
        frames = motion.frames()
        maps = motion.space @ motion.at_point(frames, None if mode == "CHOSEN" else mode)
        measured = jumps(maps, axis_length_of(target) * float(np.linalg.norm(maps.axes[0], axis=0).max()))
        # One pop makes several adjacent jumps: only the largest counts.
        near = np.pad(measured, 2)
        largest = np.max([near[:-4], near[1:-3], near[3:-1], near[4:]], axis=0)
        _deviations_by_path[path] = threshold, frames[(measured > threshold) & (measured >= largest)]
    return _deviations_by_path[path][1]


def draw(pen: Pen, target: Transform, path: DrawnPath, _now: float, settings: RigidMotionOverlay) -> None:
    """Draw rings around the deviations on a path, in its space."""
    if settings.show_deviations and settings.show_paths:
        frames = deviations_on(path, target, settings)
        places = np.stack([np.interp(frames, path.frames, column) for column in path.line.T], axis=1)
        ring = (*MARK_COLOR[:3], 0.0)
        pen.dot(batch_of("POINTS", places), ring, MARK_DIAMETER_PX, MARK_COLOR, MARK_BORDER_PX)


def frames_of(context: Any) -> np.ndarray:
    """Return the rising frames (d,) of the scene on which any target deviates."""
    targets, settings = targets_of(context), overlay_settings(context.scene)
    found = [np.empty(0)]
    for target, path in zip(targets, drawn_paths(targets, context), strict=True):
        if path is not None:
            to_scene = existing(target.animated.animation_data).nla_tweak_strip_time_to_scene
            found.append(np.array([to_scene(frame) for frame in deviations_on(path[1], target, settings).tolist()]))
    return np.unique(np.concatenate(found))


def draw_settings(context: Any, layout: bpy.types.UILayout) -> None:
    """Draw the settings, and buttons that step from one deviation to the next, in a panel."""
    settings = overlay_settings(context.scene)
    row = labelled(layout)
    row.active = settings.show_paths
    row.prop(settings, "show_deviations")
    if not settings.show_deviations:
        return
    labelled(layout).prop(settings, "deviation_threshold")
    row = labelled(layout).row(align=True)
    before: Any = row.operator(RIGID_MOTION_OT_go_to_deviation.bl_idname, text="", icon="TRIA_LEFT")
    before.step = -1
    row.operator(RIGID_MOTION_OT_go_to_deviation.bl_idname, text="", icon="TRIA_RIGHT")
    frames = frames_of(context)
    row.label(text=", ".join(f"{frame:g}" for frame in frames[:MAX_NAMED_FRAMES]) or "0", translate=False)


@with_properties
class RIGID_MOTION_OT_go_to_deviation(Operator):
    bl_idname = "rigid_motion.go_to_deviation"
    bl_label = "Go to Deviation"
    bl_description = "Go to the next or previous frame with a pop or a kink of the selection"

    step: int = IntProperty(
        name="Step", description="1 for the next one, -1 for the previous one", default=1, min=-1, max=1
    )

    def execute(self, context: bpy.types.Context) -> Returned:
        scene = existing(context.scene)
        ways = (frames_of(context) - scene.frame_current) * self.step
        if not (ways > 0.5).any():
            self.report({"INFO"}, rpt_(NO_MORE))
            return {"CANCELLED"}
        scene.frame_set(scene.frame_current + self.step * round(float(ways[ways > 0.5].min())))
        return {"FINISHED"}


NO_MORE = n_("No more deviations in this direction")


def register() -> None:
    path_drawers.append(draw)


def unregister() -> None:
    path_drawers.remove(draw)
    _deviations_by_path.clear()
