"""What an animator sees: operators, menus, panels, the overlay and the preferences. No mathematics.

targets      what an editor means, and operators on it    operators    what can be done to that
reducing     fewer keys, and all of them again            breakdown    operators that key poses by a slider
holding      operators by which things are held           held_in      what a panel shows of that
menus        entries in Blender's menus, and the pies     keymap       shortcuts
panels       the sidebar, with its notes                  overlay      paths in the viewport
wording      labels, texts and lines of a panel           preferences  of the extension
gltf_export  glTF files with few keys                     live         bodies over a network
manual       where the documentation is                   cleaning     keys that tremble less
trail        paths edited in the viewport               speed        how fast things move, and evenly
deviations   pops and kinks on paths                  mouse_input  what is dragged, and by how much
"""

from __future__ import annotations

from typing import Any

import bpy

from . import (
    breakdown,
    cleaning,
    deviations,
    gltf_export,
    holding,
    keymap,
    live,
    manual,
    menus,
    operators,
    overlay,
    panels,
    preferences,
    reducing,
    speed,
    trail,
)

MODULES = (
    *(overlay, preferences, operators, breakdown, reducing, cleaning, holding, speed, deviations, trail, gltf_export),
    *(menus, panels, live, keymap, manual),
)
CLASSES: tuple[type[Any], ...] = tuple(cls for module in MODULES for cls in getattr(module, "CLASSES", ()))


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    for module in MODULES:
        if hasattr(module, "register"):
            module.register()
    preferences.apply()


def unregister() -> None:
    for module in reversed(MODULES):
        if hasattr(module, "unregister"):
            module.unregister()
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
