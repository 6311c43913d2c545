"""The user interface: operators, menus, panels, the overlay and the preferences. No mathematics.

targets      finds the targets of operators               operators    modes, turns, cycles, layers, baking
reducing     reduces and restores keys                    breakdown    keys poses by a slider
holding      operators that hold objects                  held_in      the panel of holders
menus        entries in Blender's menus, and pie menus    keymap       shortcuts
panels       the sidebar                                  notes        warnings about a segment
overlay      paths in the viewport
wording      labels, texts and lines of a panel           preferences  preferences of the extension
gltf_export  glTF files with few keys                     live         bodies over a network
manual       links to the documentation                   cleaning     removes jitter from keys
trail        paths edited in the viewport                 speed        shows and equalises speed
deviations   pops and kinks on paths                      mouse_input  mouse and keyboard during a drag
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
    """Yield the classes of a module to register: those named RIGID_MOTION_..., property groups and preferences."""
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
