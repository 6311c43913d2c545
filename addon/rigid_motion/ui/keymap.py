"""Keyboard shortcuts: Alt T for the pie menus, and Shift Alt T for the tool *Edit Path*.

In Blender, T alone chooses the interpolation of keys.
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple, cast

import bpy
import rna_keymap_ui
from bpy.app.translations import contexts

from ..blender import existing
from .menus import RIGID_MOTION_MT_pie_keys, RIGID_MOTION_MT_pie_view

PIE_OPERATOR, TOOL_OPERATOR = "wm.call_menu_pie", "rigid_motion.edit_path"


class Shortcut(NamedTuple):
    keymap: str
    space: Literal["EMPTY", "DOPESHEET_EDITOR", "GRAPH_EDITOR"]
    """The space type of the keymap."""

    menu: str = ""
    """The pie menu; "" for *Edit Path*."""


SHORTCUTS = (
    Shortcut("Object Mode", "EMPTY", RIGID_MOTION_MT_pie_view.__name__),
    Shortcut("Pose", "EMPTY", RIGID_MOTION_MT_pie_view.__name__),
    Shortcut("Object Mode", "EMPTY"),
    Shortcut("Pose", "EMPTY"),
    Shortcut("Dopesheet", "DOPESHEET_EDITOR", RIGID_MOTION_MT_pie_keys.__name__),
    Shortcut("Graph Editor", "GRAPH_EDITOR", RIGID_MOTION_MT_pie_keys.__name__),
)

_items: list[tuple[bpy.types.KeyMap, bpy.types.KeyMapItem]] = []


def register() -> None:
    configuration = existing(bpy.context.window_manager).keyconfigs.addon
    if configuration is None:
        return
    for shortcut in SHORTCUTS:
        keymap = configuration.keymaps.new(name=shortcut.keymap, space_type=shortcut.space)
        operator = PIE_OPERATOR if shortcut.menu else TOOL_OPERATOR
        item = keymap.keymap_items.new(operator, "T", "PRESS", alt=True, shift=not shortcut.menu)
        if shortcut.menu:
            existing(item.properties).name = shortcut.menu
        _items.append((keymap, item))


def unregister() -> None:
    for keymap, item in _items:
        keymap.keymap_items.remove(item)
    _items.clear()


def draw(context: bpy.types.Context, layout: bpy.types.UILayout) -> None:
    """Draw the user's shortcuts, for editing."""
    configuration = existing(existing(context.window_manager).keyconfigs.user)
    for shortcut in SHORTCUTS:
        keymap = configuration.keymaps.find(shortcut.keymap, space_type=shortcut.space)
        for item in keymap.keymap_items if keymap else ():
            # The tool has no menu.
            if item.idname in (PIE_OPERATOR, TOOL_OPERATOR) and getattr(item.properties, "name", "") == shortcut.menu:
                row = layout.column()
                row.context_pointer_set("keymap", keymap)
                row.label(text=shortcut.keymap, text_ctxt=cast(Any, contexts).id_windowmanager)
                rna_keymap_ui.draw_kmi([], configuration, keymap, item, row, 0)
