"""What an animator sees: operators, menus, panels, the overlay and the preferences. No mathematics.

targets      the transforms and keys an editor means    operators    what can be done to them
on_targets   what these operators have in common        keymap       the pies' shortcut
menus        entries in Blender's menus, and the pies   panels       the sidebar
rows         its lines, aligned                         notes        what the panel notes on a target
shown        the transform seen on the screen           overlay      paths in the viewport
look         how they look                              wording      labels and texts
exactness    exact between frames, or not
preferences  of the extension                           manual       where the documentation is
"""

from __future__ import annotations

import bpy

from . import exactness, keymap, manual, menus, operators, overlay, panels, preferences, shown

CLASSES = (*preferences.CLASSES, *operators.CLASSES, *exactness.CLASSES, *menus.CLASSES, *panels.CLASSES)


def register() -> None:
    overlay.register()
    shown.register()
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    menus.register()
    keymap.register()
    manual.register()
    preferences.apply()


def unregister() -> None:
    manual.unregister()
    keymap.unregister()
    menus.unregister()
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
    shown.unregister()
    overlay.unregister()
