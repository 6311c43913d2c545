"""The overlay of the 3D viewport: paths of selected objects or bones, Blender's own beside that of a rigid-motion mode.

points   paths, and which ticks can be told apart in a view
seen     where something is on any frames
parents  where parents carry it         kinds    what channels are in
ghosts   poses every few frames         blends   from one place to another
records  where hands were seen          held     where what is held goes
cache    what is worked out already     settings what to show
drawing  lines and dots on the screen
ghost_drawing  ghosts on the screen, around the current frame
ghost_bodies   skinned meshes, as they were seen on other frames
cleaned  what was cleaned, before and after
"""

from __future__ import annotations

import bpy

from ...blender import PointerProperty
from . import cache, cleaned, drawing, ghost_bodies, ghost_drawing
from .settings import RIGID_MOTION_OT_update_path, RigidMotionOverlay, draw_settings, draw_toggle, overlay_settings

POPOVER = "VIEW3D_PT_overlay_object"
CLASSES = (RigidMotionOverlay, RIGID_MOTION_OT_update_path)
MODULES = (cache, drawing, ghost_bodies, ghost_drawing, cleaned)

__all__ = ["CLASSES", "draw_settings", "overlay_settings", "register", "unregister"]


def register() -> None:
    setattr(bpy.types.Scene, cache.OVERLAY, PointerProperty(type=RigidMotionOverlay))
    getattr(bpy.types, POPOVER).append(draw_toggle)
    for module in MODULES:
        module.register()


def unregister() -> None:
    for module in reversed(MODULES):
        module.unregister()
    getattr(bpy.types, POPOVER).remove(draw_toggle)
    delattr(bpy.types.Scene, cache.OVERLAY)
