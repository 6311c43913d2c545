"""The overlay of the 3D viewport: paths of selected objects or bones, Blender's own beside that of a rigid-motion mode.

points   where the paths lead, and which ticks can be told apart in a view
parents  where parents carry it         kinds    by what each kind is drawn
ghosts   poses every few frames         blends   from one place to another
records  where hands were seen          held     where what is held goes
cache    what is worked out already     settings what to show
drawing  lines, dots and ghosts on the screen
"""

from __future__ import annotations

import bpy
from bpy.props import PointerProperty

from . import cache, drawing
from .settings import RIGID_MOTION_OT_update_path, RigidMotionOverlay, draw_settings, draw_toggle

CLASSES = (RIGID_MOTION_OT_update_path,)

__all__ = ["CLASSES", "draw_settings", "register", "unregister"]


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
