"""Menus: entries of Rigid Motion in Blender's menus, and its own menus and pie menus.

In the Dope Sheet and the Graph Editor, modes apply to the selected keys, like Blender's interpolation. In the viewport
they apply to the whole object, or in Pose Mode to the whole bone. The mode of the active target is ticked.
"""

from __future__ import annotations

from typing import Any

import bpy
from bpy.app.translations import pgettext_iface as iface_

from ..animation.actions.slots import active_fcurves
from ..animation.evaluation.components import SCALE
from ..animation.transforms import OWN_WORDS, Transform
from ..blender import Menu, existing
from .gltf_export import RIGID_MOTION_OT_export_gltf
from .holding import RIGID_MOTION_MT_hold
from .targets import CURRENT, SELECTED, WHOLE, active_target, modes_meant
from .wording import LABELS, twin_of


def _draw_modes(context: bpy.types.Context, layout: Any, scope: str) -> None:
    """Draw all modes. A mode with the same motion as another one also shows the name of that one."""
    active = active_target(context)
    present, grows = modes_meant(context, active, scope), _has_scale_keys(active)
    for mode, label in LABELS.items():
        text = iface_(label, OWN_WORDS)
        if twin := twin_of(mode, grows=grows):
            text += f" (= {iface_(LABELS[twin], OWN_WORDS)})"
        _draw_mode(layout, mode, scope, text, present, "BLANK1")


def _draw_mode(layout: Any, mode: str, scope: str, text: str, present: set[str], no_icon: str = "NONE") -> None:
    # A tick for a single mode, dots for mixed modes.
    icon = no_icon if mode not in present else "CHECKMARK" if len(present) == 1 else "DOT"
    properties = layout.operator("rigid_motion.set_mode", text=text, icon=icon, translate=False)
    properties.mode, properties.on = mode, scope


def _has_scale_keys(target: Transform | None) -> bool:
    """Return whether a target has keys of its scale."""
    path = "" if target is None else target.prefix + SCALE
    return target is not None and any(fcurve.data_path == path for fcurve in active_fcurves(target.animated))


def _draw_breakdowns(self: Menu, _context: bpy.types.Context) -> None:
    self.layout.separator()
    for name in ("push", "relax", "breakdown"):
        self.layout.operator(f"rigid_motion.{name}")


class _Menu(Menu):
    """All entries for one scope, and a submenu for the other scope."""

    bl_label = "Rigid Motion"
    scope: str
    other_menu: str
    """The name of the menu of modes for the other scope."""

    pie: str

    def draw(self, context: Any) -> None:
        layout = self.layout
        layout.operator_context = "INVOKE_REGION_WIN"
        _draw_modes(context, layout, self.scope)
        layout.separator()
        layout.menu(self.other_menu)
        layout.menu(RIGID_MOTION_MT_hold.__name__)
        layout.separator()
        layout.operator("rigid_motion.set_turns", text="Set Turns...")
        layout.operator_menu_enum("rigid_motion.add_cycles", "mode")
        layout.operator("rigid_motion.copy_mode")
        layout.operator("rigid_motion.equalise_speed")
        layout.operator("rigid_motion.add_layer")
        layout.operator("rigid_motion.merge_layer")
        _draw_breakdowns(self, context)
        layout.separator()
        layout.menu(RIGID_MOTION_MT_other_keys.__name__)
        layout.operator("rigid_motion.clear")
        layout.operator("rigid_motion.refresh")
        layout.separator()
        layout.operator("rigid_motion.edit_path")
        existing(layout.operator("wm.call_menu_pie", text="Pie Menu")).name = self.pie


class RIGID_MOTION_MT_view(_Menu):
    bl_description = "How the selected objects or bones move from key to key"
    scope, other_menu, pie = WHOLE, "RIGID_MOTION_MT_current", "RIGID_MOTION_MT_pie_view"


class RIGID_MOTION_MT_keys(_Menu):
    bl_description = "How objects and bones move from the selected keys to the next"
    scope, other_menu, pie = SELECTED, "RIGID_MOTION_MT_whole", "RIGID_MOTION_MT_pie_keys"


class RIGID_MOTION_MT_other_keys(Menu):
    bl_label = "Bake and Reduce"
    bl_description = "More keys for the same motion, or fewer, and back"

    def draw(self, _context: Any) -> None:
        layout = self.layout
        layout.operator_context = "INVOKE_REGION_WIN"
        layout.operator("rigid_motion.bake", text="Bake to Keys...")
        layout.operator("rigid_motion.unbake")
        layout.separator()
        for name in ("clean_motion", "reduce_keys", "restore_keys", "discard_dense_keys"):
            layout.operator(f"rigid_motion.{name}")


class RIGID_MOTION_MT_current(Menu):
    bl_label = "Current Segment"
    bl_description = "How the selected objects or bones move between the two keys around the playhead"

    def draw(self, context: Any) -> None:
        _draw_modes(context, self.layout, CURRENT)


class RIGID_MOTION_MT_whole(Menu):
    bl_label = "All Segments"
    bl_description = "One mode for all segments of the visible objects and bones"

    def draw(self, context: Any) -> None:
        _draw_modes(context, self.layout, WHOLE)


MORE_LABEL, HOLD_LABEL = "More", "Hold"

SLICES = (
    "BLENDER",
    "dq_sclerp",
    MORE_LABEL,
    "motor_spline",
    "lerp_slerp",
    HOLD_LABEL,
    "cga_slerp",
    "pga_lerp",
)
"""The slices in the order of Blender's pie menus: W, E, S, N, NW, NE, SW, SE."""


class _Pie(Menu):
    """One slice for each motion: Blender's own in-betweens on the left, the screw on the right, the smooth one on top.

    Where nothing grows, the slice of a mode that differs from another only by that is empty; the blend that does is in
    the whole menu alone, which is below. In the north-east is what holds the selection.
    """

    scope: str
    menu: str

    def draw(self, context: Any) -> None:
        active, pie = active_target(context), self.layout.menu_pie()
        present, grows = modes_meant(context, active, self.scope), _has_scale_keys(active)
        for mode in SLICES:
            if mode == MORE_LABEL:
                existing(pie.operator("wm.call_menu", text="More...")).name = self.menu
            elif mode == HOLD_LABEL:
                existing(pie.operator("wm.call_menu", text="Hold...")).name = RIGID_MOTION_MT_hold.__name__
            elif twin_of(mode, grows=grows):
                pie.separator()
            else:
                _draw_mode(pie, mode, self.scope, iface_(LABELS[mode], OWN_WORDS), present)


class RIGID_MOTION_MT_pie_view(_Pie):
    bl_label = "Rigid Motion"
    scope, menu = WHOLE, RIGID_MOTION_MT_view.__name__


class RIGID_MOTION_MT_pie_keys(_Pie):
    bl_label = "Rigid Motion of Keys"
    scope, menu = SELECTED, RIGID_MOTION_MT_keys.__name__


def _draw_in_view(self: Menu, _context: bpy.types.Context) -> None:
    self.layout.separator()
    self.layout.menu(RIGID_MOTION_MT_view.__name__)


def _draw_keys(self: Menu, _context: bpy.types.Context) -> None:
    self.layout.separator()
    self.layout.menu(RIGID_MOTION_MT_keys.__name__)


def _draw_clean(self: Menu, _context: bpy.types.Context) -> None:
    self.layout.separator()
    self.layout.operator("rigid_motion.clean_motion")
    self.layout.operator("rigid_motion.equalise_speed")


def _draw_export(self: Menu, _context: bpy.types.Context) -> None:
    self.layout.operator(RIGID_MOTION_OT_export_gltf.bl_idname, text="glTF, Reduced (.glb)")


ENTRIES = {
    "DOPESHEET_MT_key": _draw_keys,
    "DOPESHEET_MT_context_menu": _draw_keys,
    "GRAPH_MT_key": _draw_keys,
    "GRAPH_MT_key_smoothing": _draw_clean,
    "GRAPH_MT_context_menu": _draw_keys,
    "VIEW3D_MT_object_animation": _draw_in_view,
    "VIEW3D_MT_object_context_menu": _draw_in_view,
    "VIEW3D_MT_pose_context_menu": _draw_in_view,
    "VIEW3D_MT_pose_slide": _draw_breakdowns,
    "TOPBAR_MT_file_export": _draw_export,
}
"""The function appended to each menu of Blender. Pose > Animation is the same menu as Object > Animation."""


def register() -> None:
    for menu, draw in ENTRIES.items():
        getattr(bpy.types, menu).append(draw)


def unregister() -> None:
    for menu, draw in ENTRIES.items():
        getattr(bpy.types, menu).remove(draw)
