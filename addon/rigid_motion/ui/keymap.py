"""The shortcut of the pie menus: Alt T, beside T, by which Blender chooses the interpolation of keys."""

from __future__ import annotations

import bpy
import rna_keymap_ui

from .menus import RIGID_MOTION_MT_pie_keys, RIGID_MOTION_MT_pie_object, RIGID_MOTION_MT_pie_pose

OPERATOR = "wm.call_menu_pie"

PLACES = (
    ("Object Mode", "EMPTY", RIGID_MOTION_MT_pie_object.__name__),
    ("Pose", "EMPTY", RIGID_MOTION_MT_pie_pose.__name__),
    ("Dopesheet", "DOPESHEET_EDITOR", RIGID_MOTION_MT_pie_keys.__name__),
    ("Graph Editor", "GRAPH_EDITOR", RIGID_MOTION_MT_pie_keys.__name__),
)
"""Keymap, its space, and the pie menu that is called there."""

_items: list[tuple[bpy.types.KeyMap, bpy.types.KeyMapItem]] = []


def register() -> None:
    configuration = bpy.context.window_manager.keyconfigs.addon
    if configuration is None:
        return
    for name, space, menu in PLACES:
        keymap = configuration.keymaps.new(name=name, space_type=space)
        item = keymap.keymap_items.new(OPERATOR, "T", "PRESS", alt=True)
        item.properties.name = menu
        _items.append((keymap, item))


def unregister() -> None:
    for keymap, item in _items:
        keymap.keymap_items.remove(item)
    _items.clear()


def draw(context: bpy.types.Context, layout: bpy.types.UILayout) -> None:
    """The shortcuts as the user has them, to be changed."""
    configuration = context.window_manager.keyconfigs.user
    for name, space, menu in PLACES:
        keymap = configuration.keymaps.find(name, space_type=space)
        for item in keymap.keymap_items if keymap else ():
            if item.idname == OPERATOR and item.properties.name == menu:
                row = layout.column()
                row.context_pointer_set("keymap", keymap)
                row.label(text=name)
                rna_keymap_ui.draw_kmi([], configuration, keymap, item, row, 0)
