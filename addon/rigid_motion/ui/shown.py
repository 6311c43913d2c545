"""The transform that is seen on the screen, as properties to be drawn by a panel: in the scene's units, and read-only.

Where in-betweens are in the delta transforms, or come from the constraint of a bone, the Item tab has Blender's own
values, and the object or bone stands elsewhere.
"""

from __future__ import annotations

import logging
from collections.abc import Callable

import bpy
from bpy.props import FloatVectorProperty, PointerProperty

from ..animation.compute.components import LOCATION, REST, ROTATION, ROWS, SCALE
from ..animation.transforms import Refused
from ..animation.writers.table import shown_components
from .targets import active_target

log = logging.getLogger(__package__)


def _components(part: slice) -> list[float]:
    """Return some of the ten components of the active target as it is seen; it is asked for as it is drawn."""
    shown = None
    try:
        if (target := active_target(bpy.context)) is not None:
            shown = shown_components(target)
    except Refused:
        pass  # a note of the panel has the reason
    except Exception:
        # Blender goes on with an error that is raised here, and crashes.
        log.exception("The transform on the screen cannot be shown")
    return (REST if shown is None else shown)[part].tolist()


# Blender holds no reference of its own to these: unnamed ones would be gone by the time that it asks.


def _getter(part: slice) -> Callable[[ShownTransform], list[float]]:
    return lambda _: _components(part)


_location, _quaternion, _euler, _scale = map(_getter, (ROWS[LOCATION], ROWS[ROTATION], slice(3, 6), ROWS[SCALE]))


class ShownTransform(bpy.types.PropertyGroup):
    """Of the active target of the context. Nothing of it is stored."""

    location: FloatVectorProperty(
        name="Location",
        description="Where it is seen on this frame: its location with the in-betweens",
        subtype="TRANSLATION",
        precision=5,
        get=_location,
    )
    rotation_quaternion: FloatVectorProperty(
        name="Rotation",
        description="How it is seen turned on this frame: its rotation with the in-betweens",
        size=4,
        subtype="QUATERNION",
        precision=3,
        get=_quaternion,
    )
    rotation_euler: FloatVectorProperty(
        name="Rotation",
        description="How it is seen turned on this frame: its rotation with the in-betweens",
        subtype="EULER",
        precision=5,
        get=_euler,
    )
    scale: FloatVectorProperty(
        name="Scale",
        description="How large it is seen on this frame: its scale with the in-betweens",
        subtype="XYZ",
        precision=3,
        get=_scale,
    )


def register() -> None:
    bpy.utils.register_class(ShownTransform)
    bpy.types.WindowManager.rigid_motion_shown = PointerProperty(type=ShownTransform)


def unregister() -> None:
    del bpy.types.WindowManager.rigid_motion_shown
    bpy.utils.unregister_class(ShownTransform)
