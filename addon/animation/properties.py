"""What is kept in the file: an object's mode and its own delta transforms, and what an Action was filled in for.

Without the extension all of it is inert, and stays in the file.
"""

from __future__ import annotations

import bpy
from bpy.props import (
    BoolVectorProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from ..motion import KEYFRAME_MODES
from . import live
from .originals import BAKED, REDUCED

MODE_ITEMS = [
    ("BLENDER", "Blender", "Blender's own in-betweens: every channel for itself", 0),
    *((name, mode.label, mode.description, number) for number, (name, mode) in enumerate(KEYFRAME_MODES.items(), 1)),
]


class SlotRecord(bpy.types.PropertyGroup):
    """What the in-betweens of one slot were computed from."""

    handle: IntProperty(options={"HIDDEN"})
    digest: StringProperty(options={"HIDDEN"})


class ActionMotion(bpy.types.PropertyGroup):
    slots: CollectionProperty(type=SlotRecord)


class ChangedAction(bpy.types.PropertyGroup):
    """A copy of an Action that was given other keys, what it is a copy of, and the mode that the object had then."""

    kind: EnumProperty(
        items=[
            (BAKED, "Baked", "It has keys for in-betweens too"),
            (REDUCED, "Reduced", "It has few of the keys"),
        ],
        options={"HIDDEN"},
    )
    changed: PointerProperty(type=bpy.types.Action)
    original: PointerProperty(type=bpy.types.Action)
    mode: EnumProperty(items=MODE_ITEMS, options={"HIDDEN"})
    keys_before: IntProperty(options={"HIDDEN"})
    keys_after: IntProperty(options={"HIDDEN"})
    largest_error: FloatProperty(
        description="How far the reduced motion is off where it is furthest, in Blender's units", options={"HIDDEN"}
    )


def _refresh(motion: ObjectMotion, _context: bpy.types.Context) -> None:
    live.refresh([motion.id_data])


class ObjectMotion(bpy.types.PropertyGroup):
    mode: EnumProperty(
        name="Mode",
        description="What happens between the keys. A key of this property decides from its frame on",
        items=MODE_ITEMS,
        options={"ANIMATABLE"},
        override={"LIBRARY_OVERRIDABLE"},
        update=_refresh,
    )
    filled: BoolVectorProperty(
        description="Which delta transforms in-betweens are in; the object's own are kept here meanwhile",
        size=4,
        options=set(),
        override={"LIBRARY_OVERRIDABLE"},
    )
    own_location: FloatVectorProperty(
        name="Delta Location",
        description="The object's own delta location, to which the in-betweens are added",
        subtype="TRANSLATION",
        options=set(),
        override={"LIBRARY_OVERRIDABLE"},
        update=_refresh,
    )
    own_quaternion: FloatVectorProperty(
        name="Delta Rotation",
        description="The object's own delta rotation, to which the in-betweens are added",
        size=4,
        default=(1.0, 0.0, 0.0, 0.0),
        subtype="QUATERNION",
        options=set(),
        override={"LIBRARY_OVERRIDABLE"},
        update=_refresh,
    )
    own_euler: FloatVectorProperty(
        name="Delta Rotation",
        description="The object's own delta rotation, to which the in-betweens are added",
        subtype="EULER",
        options=set(),
        override={"LIBRARY_OVERRIDABLE"},
        update=_refresh,
    )
    own_scale: FloatVectorProperty(
        name="Delta Scale",
        description="The object's own delta scale, by which the in-betweens are multiplied",
        default=(1.0, 1.0, 1.0),
        subtype="XYZ",
        options=set(),
        override={"LIBRARY_OVERRIDABLE"},
        update=_refresh,
    )
    bakes: CollectionProperty(type=ChangedAction, override={"LIBRARY_OVERRIDABLE", "USE_INSERTION"})


CLASSES = (SlotRecord, ActionMotion, ChangedAction, ObjectMotion)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Object.rigid_motion = PointerProperty(type=ObjectMotion, override={"LIBRARY_OVERRIDABLE"})
    bpy.types.Action.rigid_motion = PointerProperty(type=ActionMotion)


def unregister() -> None:
    del bpy.types.Action.rigid_motion
    del bpy.types.Object.rigid_motion
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
