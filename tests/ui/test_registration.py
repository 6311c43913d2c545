"""Registering and unregistering the extension."""

from __future__ import annotations

import bpy

import rigid_motion
from rigid_motion.animation.following import follower
from rigid_motion.ui import keymap, menus


def footprint():
    """Return what the extension may add to in Blender: classes, properties, menus, keymaps, handlers."""
    keymaps = bpy.context.window_manager.keyconfigs.addon.keymaps
    places = dict.fromkeys((shortcut.keymap, shortcut.space) for shortcut in keymap.SHORTCUTS)
    result = [keymaps.find(name, space_type=space) for name, space in places]
    lists = (getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers) if not name.startswith("_"))
    return {
        "classes": {name for name in dir(bpy.types) if "rigid_motion" in name.lower() or "RigidMotion" in name},
        "properties": [hasattr(kind, "rigid_motion") for kind in (bpy.types.Object, bpy.types.PoseBone)],
        "of scenes": hasattr(bpy.types.Scene, "rigid_motion_overlay"),
        "operators": dir(bpy.ops.rigid_motion),
        "menus": [len(getattr(bpy.types, menu)._dyn_ui_initialize()) for menu in menus.ENTRIES],
        "keymaps": sum(len(item.keymap_items) if item else 0 for item in result),
        "handlers": [list(item) for item in lists if isinstance(item, list)],
    }


def test_switched_off_it_leaves_nothing_behind_however_often(empty_file):
    before = footprint()
    for _ in range(2):
        rigid_motion.register()
        on = footprint()
        assert on["operators"]
        assert on["keymaps"] == before["keymaps"] + len(keymap.SHORTCUTS)
        assert on["menus"] == [count + 1 for count in before["menus"]]
        assert on["handlers"] != before["handlers"]
        rigid_motion.unregister()
        assert footprint() == before


def test_a_look_through_the_file_that_still_waits_is_called_off(empty_file):
    """In a window Blender runs the first look through the file as soon as it is idle."""
    rigid_motion.register()
    bpy.app.timers.register(follower.first_look, first_interval=1.0)
    rigid_motion.unregister()
    assert not bpy.app.timers.is_registered(follower.first_look)
