"""Settings of the overlay, stored on scenes, and their place in Blender's interface."""

from __future__ import annotations

from functools import partial
from typing import Any

import bpy
from bpy.app.translations import pgettext_iface as iface_
from bpy.app.translations import pgettext_n as n_

from ...animation.properties import MODE_ITEMS
from ...animation.transforms import OWN_WORDS, transform_of
from ...blender import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    Operator,
    PointerProperty,
    Returned,
    existing,
    with_properties,
)
from ..targets import selected_in_view
from ..wording import draw_text, labelled
from . import cache

MODE_CHOICES = [("CHOSEN", "As Keyed", "The mode that each segment has", 0), *MODE_ITEMS[1:]]

HIDDEN_LABEL = n_("Hidden by Viewport Overlays")


_bool, _int, _float = (partial(kind, options=set()) for kind in (BoolProperty, IntProperty, FloatProperty))
_enum = partial(EnumProperty, options=set(), translation_context=OWN_WORDS)
"""Property types of the scene's settings, which cannot be animated."""


@with_properties
class RigidMotionOverlay(bpy.types.PropertyGroup):
    show_paths: bool = _bool(
        name="Rigid Motion Paths",
        description="Draw the paths of the selected objects or bones: Blender's own, and that of a rigid-motion "
        "mode. For a bone it is the path of its head, or of its tail where the bone only turns. "
        "Parents that move by keys are followed; by constraints they are taken as they are on the current frame, "
        "and what holds something as it was when its frames were last played",
    )
    mode: str = _enum(
        name="Mode",
        description="The mode to draw. A mode other than the keyed one is a preview, and changes nothing",
        items=MODE_CHOICES,
    )
    show_native: bool = _bool(
        name="Blender's Path",
        description="Also draw Blender's own path, in its own color",
        default=True,
    )
    show_axes: bool = _bool(
        name="Axes",
        description="Draw its orientation along the path, by its local axes at some of the ticks",
        default=True,
    )
    axes_size: float = _float(
        name="Size",
        description="Length of the axes. At 1 they are half as long as the object or bone",
        default=1.0,
        min=0.01,
        soft_max=5.0,
    )
    tick_step: int = _int(
        name="Frame Step",
        description="Frames between ticks. At 0, as many as are distinguishable on the screen",
        min=0,
        soft_max=100,
    )
    show_ghosts: bool = _bool(
        name="Ghosts",
        description="Draw the selected objects or bones on frames before and after the current one, in the mode of "
        "the path",
    )
    ghosts_on: str = _enum(
        name="Ghosts on",
        description="The frames that have ghosts",
        items=[
            ("STEP", "Frames", "On every so many frames"),
            ("KEYS", "Keys", "On keys alone"),
        ],
    )
    ghosts_before: int = _int(
        name="Before",
        description="The most ghosts before the current frame. Those that would cover the view are left out",
        default=5,
        min=0,
        soft_max=20,
        max=200,
    )
    ghosts_after: int = _int(
        name="After",
        description="The most ghosts after the current frame. Those that would cover the view are left out",
        default=5,
        min=0,
        soft_max=20,
        max=200,
    )
    show_bodies: bool = _bool(
        name="Skinned Meshes",
        description="For armatures and bones show the meshes that they deform, on frames shown since the last edit:"
        " play them, or press Update Ghosts",
        default=True,
    )
    ghost_step: int = _int(
        name="Ghost Step",
        description="Frames between ghosts",
        default=5,
        min=1,
        soft_max=50,
    )
    show_deviations: bool = _bool(
        name="Deviations",
        description="Mark frames on the path where the motion has a pop or a kink: its velocity jumps there, many "
        "times as much as it changes around them",
    )
    deviation_threshold: float = _float(
        name="Threshold",
        description="How many times more than around it the velocity must change to be marked",
        default=8.0,
        min=1.5,
        soft_max=50.0,
        step=50,
        precision=1,
    )
    show_speed: bool = _bool(
        name="Speed in Graph Editor",
        description="Draw the speed and the rotation speed of the active object or bone below its F-curves, each "
        "with its own scale: the largest value is on the right",
    )

    @property
    def frames_between_ghosts(self) -> int:
        """Frames between ghosts, -1 for ghosts on keys."""
        return self.ghost_step if self.ghosts_on == "STEP" else -1


def overlay_settings(scene: bpy.types.Scene | None) -> RigidMotionOverlay:
    return getattr(scene, cache.OVERLAY)


class RIGID_MOTION_OT_update_path(Operator):
    bl_idname = "rigid_motion.update_path"
    bl_label = "Update Path"
    bl_description = (
        "Play all frames of the scene once, to find hands that follow constraints for the paths. A pose without a "
        "key is lost, as in any playback"
    )

    def execute(self, context: bpy.types.Context) -> Returned:
        scene = existing(context.scene)
        before, subframe = scene.frame_current, scene.frame_subframe
        for frame in range(scene.frame_start, scene.frame_end + 1):
            scene.frame_set(frame)
        scene.frame_set(before, subframe=subframe)
        return {"FINISHED"}


def draw_settings(layout: bpy.types.UILayout, context: Any) -> None:
    """Draw the settings of the overlay in a panel."""
    settings = overlay_settings(context.scene)
    if (settings.show_paths or settings.show_ghosts) and not is_shown(context):
        draw_text(context, layout, HIDDEN_LABEL, "INFO")
    if cache.know_from_seeing(map(transform_of, selected_in_view(context))):
        layout.operator(RIGID_MOTION_OT_update_path.bl_idname)
    row = layout.row(align=True)
    row.operator("rigid_motion.edit_path")
    row.operator_menu_enum("rigid_motion.set_path_point", "point")
    row = labelled(layout, iface_("Mode", OWN_WORDS))
    row.active = settings.show_paths or settings.show_ghosts
    row.prop(settings, "mode", text="")
    ghosts = labelled(layout)
    ghosts.prop(settings, "show_ghosts")
    step = ghosts.row()
    step.active = settings.show_ghosts
    step.prop(settings, "ghosts_on", text="")
    if settings.show_ghosts:
        _draw_ghost_settings(layout, settings)
    column = layout.column()
    column.active = settings.show_paths
    labelled(column, iface_("Step", OWN_WORDS)).prop(settings, "tick_step", text="")
    labelled(column).prop(settings, "show_native")
    axes = labelled(column)
    axes.prop(settings, "show_axes")
    size = axes.row()
    size.active = settings.show_axes
    size.prop(settings, "axes_size", text="")


def _draw_ghost_settings(layout: bpy.types.UILayout, settings: RigidMotionOverlay) -> None:
    if settings.ghosts_on == "STEP":
        labelled(layout).prop(settings, "ghost_step")
    row = labelled(layout).row(align=True)
    row.prop(settings, "ghosts_before")
    row.prop(settings, "ghosts_after")
    labelled(layout).prop(settings, "show_bodies")
    if settings.show_bodies:
        labelled(layout).operator(RIGID_MOTION_OT_update_path.bl_idname, text="Update Ghosts")


def draw_toggle(panel: Any, context: Any) -> None:
    """Draw the overlay's checkboxes in the Overlays pop-over of the viewport."""
    column = panel.layout.column()
    column.active = context.space_data.overlay.show_overlays and context.space_data.overlay.show_motion_paths
    settings = overlay_settings(context.scene)
    column.prop(settings, "show_paths")
    column.prop(settings, "show_ghosts", text="Rigid Motion Ghosts")


def is_shown(context: Any) -> bool:
    """Return whether paths or ghosts are shown in the scene, and in the viewport if the context has one."""
    overlay, settings = getattr(context.space_data, "overlay", None), overlay_settings(context.scene)
    in_view = not isinstance(overlay, bpy.types.View3DOverlay) or (overlay.show_overlays and overlay.show_motion_paths)
    return in_view and (settings.show_paths or settings.show_ghosts)


POPOVER = "VIEW3D_PT_overlay_object"


def register() -> None:
    setattr(bpy.types.Scene, cache.OVERLAY, PointerProperty(type=RigidMotionOverlay))
    getattr(bpy.types, POPOVER).append(draw_toggle)


def unregister() -> None:
    getattr(bpy.types, POPOVER).remove(draw_toggle)
    delattr(bpy.types.Scene, cache.OVERLAY)
