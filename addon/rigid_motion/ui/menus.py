"""Rigid Motion in Blender's menus, and its pie menus.

In the Dope Sheet and the Graph Editor modes are for the selected keys, as interpolation is; in the viewport for the
whole object, or in Pose Mode for the whole bone. The mode that is chosen at present is ticked, for the active one.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import bpy
from bpy.app.translations import pgettext_iface as iface_

from ..animation.transforms import OWN_WORDS
from .gltf_export import RIGID_MOTION_OT_export_gltf
from .pose_operators import RIGID_MOTION_OT_copy_pose, RIGID_MOTION_OT_create_pose_asset, draw_parent_switch
from .targets import CURRENT, SELECTED, WHOLE, active_target, is_posing, modes_meant
from .wording import LABELS, SHORT_LABELS


def _draw_modes(
    context: bpy.types.Context,
    layout: bpy.types.UILayout,
    scope: str,
    modes: Iterable[str] = LABELS,
    labels: Mapping[str, str] = LABELS,
    no_icon: str = "BLANK1",
) -> None:
    present = modes_meant(context, active_target(context), scope)
    for mode in modes:
        # One tick where all is one; dots where modes are mixed.
        icon = no_icon if mode not in present else "CHECKMARK" if len(present) == 1 else "DOT"
        text = iface_(labels[mode], OWN_WORDS) if labels is SHORT_LABELS else iface_(labels[mode])
        properties = layout.operator("rigid_motion.set_mode", text=text, icon=icon, translate=False)
        properties.mode, properties.on = mode, scope


def _draw_breakdowns(self: bpy.types.Menu, _context: bpy.types.Context) -> None:
    self.layout.separator()
    for name in ("push", "relax", "breakdown"):
        self.layout.operator(f"rigid_motion.{name}")


def _draw_rest(self: bpy.types.Menu, context: bpy.types.Context, pie: str) -> None:
    layout = self.layout
    layout.operator("rigid_motion.set_turns", text="Set Turns...")
    _draw_breakdowns(self, context)
    layout.separator()
    layout.operator("rigid_motion.bake", text="Bake to Keys...")
    layout.operator("rigid_motion.unbake")
    layout.separator()
    for name in ("reduce_keys", "restore_keys", "discard_dense_keys"):
        layout.operator(f"rigid_motion.{name}")
    layout.separator()
    layout.operator("rigid_motion.clear")
    layout.operator("rigid_motion.refresh")
    layout.operator("rigid_motion.mend" if is_posing(context) else "rigid_motion.exact")
    layout.separator()
    layout.operator("wm.call_menu_pie", text="Pie Menu").name = pie


class _InView:
    """For all that is selected in a viewport."""

    bl_label = "Rigid Motion"
    pie: str

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.operator_context = "INVOKE_REGION_WIN"
        _draw_modes(context, layout, WHOLE)
        layout.separator()
        layout.menu(RIGID_MOTION_MT_current.__name__)
        _draw_rest(self, context, self.pie)


class RIGID_MOTION_MT_object(_InView, bpy.types.Menu):
    bl_description = "How the selected objects move from key to key"
    pie = "RIGID_MOTION_MT_pie_object"


class RIGID_MOTION_MT_pose(_InView, bpy.types.Menu):
    bl_description = "How the selected bones move from key to key"
    pie = "RIGID_MOTION_MT_pie_pose"


class RIGID_MOTION_MT_keys(bpy.types.Menu):
    bl_label = "Rigid Motion"
    bl_description = "How objects and bones move on from the selected keys"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.operator_context = "INVOKE_REGION_WIN"
        _draw_modes(context, layout, SELECTED)
        layout.separator()
        text = iface_("Whole Bone") if is_posing(context) else iface_("Whole Object")
        layout.menu(RIGID_MOTION_MT_whole.__name__, text=text, translate=False)
        _draw_rest(self, context, RIGID_MOTION_MT_pie_keys.__name__)


class RIGID_MOTION_MT_current(bpy.types.Menu):
    bl_label = "Current Segment"
    bl_description = "How the selected objects or bones move between the two keys that the playhead is between"

    def draw(self, context: bpy.types.Context) -> None:
        _draw_modes(context, self.layout, CURRENT)


class RIGID_MOTION_MT_whole(bpy.types.Menu):
    bl_label = "Whole Object"
    bl_description = "One mode for all segments of the objects and bones that are shown"

    def draw(self, context: bpy.types.Context) -> None:
        _draw_modes(context, self.layout, WHOLE)


SLICES = (
    "BLENDER",
    "dq_sclerp",
    "cga_lerp",
    "motor_spline",
    "lerp_slerp",
    "pga_slerp",
    "cga_slerp",
    "pga_lerp",
)
"""In the order of Blender's pies: west, east, south, north, north-west, north-east, south-west, south-east."""


class _Pie:
    """One slice for each mode: Blender's own in-betweens on the left, the screw on the right, the smooth one on top.

    Around them, what is alike is side by side: the screws, the blends, those that grow, those that go straight.
    """

    scope: str

    def draw(self, context: bpy.types.Context) -> None:
        # Entries of a menu are aligned, those of a pie stand alone.
        _draw_modes(context, self.layout.menu_pie(), self.scope, SLICES, SHORT_LABELS, "NONE")


class RIGID_MOTION_MT_pie_object(_Pie, bpy.types.Menu):
    bl_label = "Rigid Motion of Object"
    scope = WHOLE


class RIGID_MOTION_MT_pie_pose(_Pie, bpy.types.Menu):
    bl_label = "Rigid Motion of Bones"
    scope = WHOLE


class RIGID_MOTION_MT_pie_keys(_Pie, bpy.types.Menu):
    bl_label = "Rigid Motion of Keys"
    scope = SELECTED


CLASSES = (
    RIGID_MOTION_MT_object,
    RIGID_MOTION_MT_pose,
    RIGID_MOTION_MT_keys,
    RIGID_MOTION_MT_current,
    RIGID_MOTION_MT_whole,
    RIGID_MOTION_MT_pie_object,
    RIGID_MOTION_MT_pie_pose,
    RIGID_MOTION_MT_pie_keys,
)


def _draw_in_view(self: bpy.types.Menu, context: bpy.types.Context) -> None:
    self.layout.separator()
    self.layout.menu((RIGID_MOTION_MT_pose if is_posing(context) else RIGID_MOTION_MT_object).__name__)


def _draw_keys(self: bpy.types.Menu, _context: bpy.types.Context) -> None:
    self.layout.separator()
    self.layout.menu(RIGID_MOTION_MT_keys.__name__)


def _draw_copy(self: bpy.types.Menu, context: bpy.types.Context) -> None:
    self.layout.separator()
    self.layout.operator(RIGID_MOTION_OT_copy_pose.bl_idname, icon="COPYDOWN")
    self.layout.operator(RIGID_MOTION_OT_create_pose_asset.bl_idname)
    draw_parent_switch(self.layout, context)


def _draw_copy_and_view(self: bpy.types.Menu, context: bpy.types.Context) -> None:
    _draw_copy(self, context)
    _draw_in_view(self, context)


def _draw_export(self: bpy.types.Menu, _context: bpy.types.Context) -> None:
    self.layout.operator(RIGID_MOTION_OT_export_gltf.bl_idname, text="glTF, Reduced (.glb)")


ENTRIES = {
    "DOPESHEET_MT_key": _draw_keys,
    "DOPESHEET_MT_context_menu": _draw_keys,
    "GRAPH_MT_key": _draw_keys,
    "GRAPH_MT_context_menu": _draw_keys,
    "VIEW3D_MT_object_animation": _draw_in_view,
    "VIEW3D_MT_object_context_menu": _draw_in_view,
    "VIEW3D_MT_pose": _draw_copy,
    "VIEW3D_MT_pose_context_menu": _draw_copy_and_view,
    "VIEW3D_MT_pose_slide": _draw_breakdowns,
    "TOPBAR_MT_file_export": _draw_export,
}
"""Blender's menus, and what is appended to each. That of Object > Animation is the one of Pose > Animation too."""


def register() -> None:
    for menu, draw in ENTRIES.items():
        getattr(bpy.types, menu).append(draw)


def unregister() -> None:
    for menu, draw in ENTRIES.items():
        getattr(bpy.types, menu).remove(draw)
