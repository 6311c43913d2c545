"""Shortcuts: Alt T for the pie menus, beside T, by which Blender chooses the interpolation of keys; and Ctrl C in Pose
Mode, which is Blender's own again where its poll fails.
"""

from __future__ import annotations

import sys
from typing import NamedTuple

import bpy
import rna_keymap_ui
from bpy.app.translations import contexts

from .menus import RIGID_MOTION_MT_pie_keys, RIGID_MOTION_MT_pie_object, RIGID_MOTION_MT_pie_pose
from .pose_operators import RIGID_MOTION_OT_copy_pose

PIE = "wm.call_menu_pie"
COMMAND = "oskey" if sys.platform == "darwin" else "ctrl"
"""The modifier that Blender has for copying."""


class Shortcut(NamedTuple):
    keymap: str
    space: str
    """The space of the keymap."""

    operator: str
    key: str
    modifier: str
    menu: str = ""
    """The menu that the operator calls."""


SHORTCUTS = (
    Shortcut("Object Mode", "EMPTY", PIE, "T", "alt", RIGID_MOTION_MT_pie_object.__name__),
    Shortcut("Pose", "EMPTY", PIE, "T", "alt", RIGID_MOTION_MT_pie_pose.__name__),
    Shortcut("Dopesheet", "DOPESHEET_EDITOR", PIE, "T", "alt", RIGID_MOTION_MT_pie_keys.__name__),
    Shortcut("Graph Editor", "GRAPH_EDITOR", PIE, "T", "alt", RIGID_MOTION_MT_pie_keys.__name__),
    Shortcut("Pose", "EMPTY", RIGID_MOTION_OT_copy_pose.bl_idname, "C", COMMAND),
)

_items: list[tuple[bpy.types.KeyMap, bpy.types.KeyMapItem]] = []


def register() -> None:
    configuration = bpy.context.window_manager.keyconfigs.addon
    if configuration is None:
        return
    for shortcut in SHORTCUTS:
        keymap = configuration.keymaps.new(name=shortcut.keymap, space_type=shortcut.space)
        item = keymap.keymap_items.new(shortcut.operator, shortcut.key, "PRESS", **{shortcut.modifier: True})
        if shortcut.menu:
            item.properties.name = shortcut.menu
        _items.append((keymap, item))


def unregister() -> None:
    for keymap, item in _items:
        keymap.keymap_items.remove(item)
    _items.clear()


def draw(context: bpy.types.Context, layout: bpy.types.UILayout) -> None:
    """Draw the shortcuts as the user has them, to be changed."""
    configuration = context.window_manager.keyconfigs.user
    for shortcut in SHORTCUTS:
        keymap = configuration.keymaps.find(shortcut.keymap, space_type=shortcut.space)
        for item in keymap.keymap_items if keymap else ():
            if item.idname == shortcut.operator and (not shortcut.menu or item.properties.name == shortcut.menu):
                row = layout.column()
                row.context_pointer_set("keymap", keymap)
                row.label(text=shortcut.keymap, text_ctxt=contexts.id_windowmanager)
                rna_keymap_ui.draw_kmi([], configuration, keymap, item, row, 0)
