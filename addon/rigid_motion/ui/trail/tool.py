"""The tool *Edit Path* in the viewport's toolbar, in Object Mode and Pose Mode, with its keymap.

Events that hit no path are left to Blender: this tool selects objects and bones, too.
"""

from __future__ import annotations

from typing import Any

import bpy
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_tip as tip_

from ...blender import Operator, Returned
from ..overlay.settings import overlay_settings

TOOL = "rigid_motion.edit_path"
"""The id of the tool, and of the operator that activates it."""

ANOTHER_TOOL = "builtin.select_box"
"""The tool that is activated when this one is switched off."""

NO_MODE = n_("Paths are edited in the viewport, in Object Mode or Pose Mode")

CLICK, DRAG = ({"type": "LEFTMOUSE", "value": value} for value in ("CLICK", "CLICK_DRAG"))
EXTEND = {"properties": [("extend", True)]}


def _pressed(key: str, **modifiers: bool) -> dict[str, Any]:
    return {"type": key, "value": "PRESS", **modifiers}


KEYMAP = (
    ("rigid_motion.select_path_keys", CLICK, None),
    ("rigid_motion.select_path_keys", CLICK | {"shift": True}, EXTEND),
    ("rigid_motion.insert_path_key", CLICK | {"ctrl": True}, None),
    # The mouse may drag a tangent, a key or a box.
    ("rigid_motion.drag_path_tangent", DRAG, None),
    ("rigid_motion.move_path_keys", DRAG, None),
    ("rigid_motion.box_path_keys", DRAG, None),
    ("rigid_motion.box_path_keys", DRAG | {"shift": True}, EXTEND),
    ("rigid_motion.retime_path_keys", DRAG | {"alt": True}, None),
    ("rigid_motion.box_path_keys", _pressed("B"), None),
    ("rigid_motion.select_all_path_keys", _pressed("A"), None),
    ("rigid_motion.select_all_path_keys", _pressed("A", alt=True), {"properties": [("deselect", True)]}),
    ("rigid_motion.move_path_keys", _pressed("G"), None),
    ("rigid_motion.rotate_path_keys", _pressed("R"), None),
    ("wm.context_toggle", _pressed("O"), {"properties": [("data_path", "tool_settings.use_proportional_action")]}),
    ("rigid_motion.delete_path_keys", _pressed("X"), None),
    ("rigid_motion.delete_path_keys", _pressed("DEL"), None),
)
"""Operators, the events that run them, and their properties."""


class _EditPath(bpy.types.WorkSpaceTool):
    bl_space_type = "VIEW_3D"
    bl_idname = TOOL
    bl_label = "Edit Path"
    bl_description = n_(
        "Edit the paths of the selected objects or bones by their keys: click or drag a box to select, drag or G to "
        "move, R to rotate, Alt-drag to retime along the path, drag a tangent to set the speed, Ctrl-click on the path "
        "to insert a key, X to delete"
    )
    bl_icon = "ops.curve.pen"
    bl_keymap = KEYMAP


MODES = ("OBJECT", "POSE")
TOOLS = [type(f"EditPathIn{mode.title()}Mode", (_EditPath,), {"bl_context_mode": mode}) for mode in MODES]


class RIGID_MOTION_OT_edit_path(Operator):
    bl_idname = TOOL
    bl_label = "Edit Path"
    bl_description = (
        "Show the paths of the selected objects or bones, and switch the tool that edits them by their keys on or off"
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        is_there = context.area is not None and context.area.type == "VIEW_3D" and context.mode in MODES
        if not is_there:
            cls.poll_message_set(tip_(NO_MODE))
        return is_there

    def execute(self, context: Any) -> Returned:
        is_taken = context.workspace.tools.from_space_view3d_mode(context.mode, create=True).idname == TOOL
        bpy.ops.wm.tool_set_by_id(name=ANOTHER_TOOL if is_taken else TOOL)
        if not is_taken:
            overlay_settings(context.scene).show_paths = True
            context.space_data.overlay.show_overlays = context.space_data.overlay.show_motion_paths = True
        return {"FINISHED"}


def register() -> None:
    for tool in TOOLS:
        bpy.utils.register_tool(tool, after={"builtin.transform"}, separator=True)


def unregister() -> None:
    for tool in reversed(TOOLS):
        bpy.utils.unregister_tool(tool)
