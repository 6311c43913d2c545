"""What an animator sees: operators, menus, panels, the overlay and the preferences. No mathematics.

targets      what an editor means, and operators on it    operators    what can be done to that
reducing     fewer keys, and all of them again            breakdown    operators that key poses by a slider
holding      operators by which things are held           held_in      what a panel shows of that
menus        entries in Blender's menus, and the pies     keymap       shortcuts
panels       the sidebar                                  notes        what it says of a segment
overlay      paths in the viewport
wording      labels, texts and lines of a panel           preferences  of the extension
gltf_export  glTF files with few keys                     live         bodies over a network
manual       where the documentation is                   cleaning     keys that tremble less
trail        paths edited in the viewport               speed        how fast things move, and evenly
deviations   pops and kinks on paths                  mouse_input  what is dragged, and by how much
"""

from __future__ import annotations

from collections.abc import Iterator
from types import ModuleType

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
    panels,
    preferences,
    reducing,
    speed,
)
from .overlay import cache, cleaned, drawing, ghost_bodies, ghost_drawing, settings
from .trail import dragging, picking, tangents, tool

MODULES = (
    *(settings, cache, drawing, ghost_bodies, ghost_drawing, cleaned),
    *(preferences, operators, breakdown, reducing, cleaning, holding, speed, deviations),
    *(picking, dragging, tangents, tool, gltf_export, menus, panels, live, keymap, manual),
)


def _classes_of(module: ModuleType) -> Iterator[type]:
    """Yield the classes of a module that Blender is to know: those with its kind of names, and groups of properties."""
    for cls in (*vars(module).values(), *getattr(module, "PANELS", ())):
        if isinstance(cls, type) and cls.__module__ == module.__name__:
            groups = bpy.types.PropertyGroup, bpy.types.AddonPreferences
            if cls.__name__.startswith("RIGID_MOTION_") or issubclass(cls, groups):
                yield cls


CLASSES = tuple(cls for module in MODULES for cls in _classes_of(module))


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
