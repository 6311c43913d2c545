"""The overlay of the 3D viewport: paths of selected objects or bones, Blender's own beside that of a rigid-motion mode.

settings  what to show                  points   where the paths lead, and which ticks can be told apart in a view
kinds     by what each kind is drawn    parents  where parents carry it
ghosts    poses every few frames        cache    what is worked out already
drawing   lines, dots and ghosts on the screen
"""

from __future__ import annotations

import bpy
from bpy.props import PointerProperty

from . import cache, drawing
from .settings import RigidMotionOverlay, draw_settings, draw_toggle

__all__ = ["draw_settings", "register", "unregister"]


def register() -> None:
    bpy.utils.register_class(RigidMotionOverlay)
    bpy.types.Scene.rigid_motion_overlay = PointerProperty(type=RigidMotionOverlay)
    bpy.types.VIEW3D_PT_overlay_object.append(draw_toggle)
    cache.register()
    drawing.register()


def unregister() -> None:
    drawing.unregister()
    cache.unregister()
    bpy.types.VIEW3D_PT_overlay_object.remove(draw_toggle)
    del bpy.types.Scene.rigid_motion_overlay
    bpy.utils.unregister_class(RigidMotionOverlay)
