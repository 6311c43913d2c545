"""What an animator sees: operators, menus, panels, the overlay and the preferences. No mathematics.

targets      the transforms and keys an editor means    operators    what can be done to them
on_targets   what these operators have in common        reducing     fewer keys, and all of them again
keymap       shortcuts
pose_operators  Blender's operators, with the pose that is seen; parent_switches has Rigify's
menus        entries in Blender's menus, and the pies   panels       the sidebar
rows         its lines, aligned                         notes        what the panel notes on a target
shown        the transform seen on the screen           overlay      paths in the viewport
look         how they look                              wording      labels and texts
bake         the one that bakes, with its dialog        slider       a factor, dragged with the mouse
breakdown    those that key poses by a slider
exactness    exact between frames, or not
preferences  of the extension                           manual       where the documentation is
turn_operator  whole turns between keys
gltf_export  glTF files with few keys                   live         bodies over a network
"""

from __future__ import annotations

import bpy

from . import (
    breakdown,
    exactness,
    gltf_export,
    keymap,
    live,
    manual,
    menus,
    operators,
    overlay,
    panels,
    parent_switches,
    pose_operators,
    preferences,
    reducing,
    shown,
    turn_operator,
)

CLASSES = (
    *preferences.CLASSES,
    *operators.CLASSES,
    *turn_operator.CLASSES,
    *breakdown.CLASSES,
    *exactness.CLASSES,
    *pose_operators.CLASSES,
    *parent_switches.CLASSES,
    *reducing.CLASSES,
    *gltf_export.CLASSES,
    *menus.CLASSES,
    *panels.CLASSES,
    *live.CLASSES,
)


def register() -> None:
    overlay.register()
    shown.register()
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    live.register()
    menus.register()
    keymap.register()
    manual.register()
    preferences.apply()


def unregister() -> None:
    manual.unregister()
    keymap.unregister()
    menus.unregister()
    live.unregister()
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
    shown.unregister()
    overlay.unregister()
