"""Properties of objects and bones that files store. Without the extension they do nothing, but stay in the file.

The keys themselves store the modes, see `actions.marks`. An object or a pose bone shows its mode as a property, which
Python and a button can set.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import cast

import bpy

from ..blender import (
    CollectionProperty,
    EnumProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
    with_properties,
)
from ..motion import KEYFRAME_MODES
from .actions.refusals import MOST_TURNS
from .baking.originals import BAKED, CLEANED, REDUCED
from .edits import mode_keys
from .evaluation.components import MODE_NAMES, MODE_NUMBERS
from .evaluation.sources import SCREW_AXIS
from .following import follower
from .queries.keyed import mode_shown
from .transforms import MOTION_PROPERTY, OWN_WORDS, Refused, Transform, transform_of

FIRST_MODES = ("motor_spline", "dq_sclerp")
"""The modes that menus list first: the recommended ones."""

MODE_ITEMS = [
    ("BLENDER", "Blender", "Blender's own in-betweens: each channel separately", 0),
    *(
        (name, mode.label, ". ".join(filter(None, (mode.description, mode.same, mode.algebra))), mode.number)
        for name, mode in sorted(KEYFRAME_MODES.items(), key=lambda item: (*FIRST_MODES, item[0]).index(item[0]))
    ),
]
"""The modes as enum items. Files store their numbers."""

TURN_AXIS_ITEMS = [
    (
        SCREW_AXIS,
        "Screw",
        "About the axis of the segment's rotation, or the local Z axis if it does not rotate",
    ),
    ("X", "X", "Always about the local X axis"),
    ("Y", "Y", "Always about the local Y axis"),
    ("Z", "Z", "Always about the local Z axis"),
]
"""The axes for extra turns, as enum items."""


@with_properties
class ChangedKeys(bpy.types.PropertyGroup):
    """A record of how the keys were changed, and of the Action with the keys from before."""

    kind: str = EnumProperty(
        items=[
            (BAKED, "Baked", "It has keys for in-betweens too"),
            (REDUCED, "Reduced", "It has few of the keys"),
            (CLEANED, "Cleaned", "Its keys have less jitter"),
        ],
        options={"HIDDEN"},
    )
    # The slot with these keys.
    changed: bpy.types.Action | None = PointerProperty(type=bpy.types.Action)
    handle: int = IntProperty(options={"HIDDEN"})
    # The Action with the earlier keys, and the prefix of their data paths there.
    original: bpy.types.Action | None = PointerProperty(type=bpy.types.Action)
    kept_as: str = StringProperty(options={"HIDDEN"})
    # For reduced keys, the result: a `Reduction` as JSON.
    reduction: str = StringProperty(options={"HIDDEN"})


def _get_mode(motion: RigidMotion) -> int:
    return MODE_NUMBERS[mode_shown(_transform_with(motion))]


def _set_mode(motion: RigidMotion, number: int) -> None:
    # The panel shows why a transform refuses.
    with suppress(Refused):
        mode_keys.set_mode(_transform_with(motion), MODE_NAMES[number])


def _on_turns(motion: RigidMotion, _context: bpy.types.Context) -> None:
    if not follower.follower.busy:
        # The panel shows why a transform refuses to turn.
        with suppress(Refused):
            mode_keys.on_turns(_transform_with(motion))


def _transform_with(motion: RigidMotion) -> Transform:
    """Return the object or bone with these properties. Blender has no direct way from properties to their bone."""
    obj = cast(bpy.types.Object, motion.id_data)
    carriers = (obj, *(() if obj.pose is None else obj.pose.bones))
    return next(transform for transform in map(transform_of, carriers) if motion == cast(object, transform.motion))


@with_properties
class RigidMotion(bpy.types.PropertyGroup):
    """The settings of an object, or of a bone of a rig."""

    mode: str = EnumProperty(
        name="Mode",
        description="The motion between all keys. Animation editors set it for single keys",
        items=MODE_ITEMS,
        translation_context=OWN_WORDS,
        options=set(),
        get=_get_mode,
        set=_set_mode,
    )
    turns: int = IntProperty(
        name="Turns",
        description=(
            "Extra whole turns between two keys, in the direction of the rotation; negative for the opposite one. A"
            " key of this property applies from its frame on"
        ),
        min=-MOST_TURNS,
        max=MOST_TURNS,
        soft_min=-20,
        soft_max=20,
        options={"ANIMATABLE"},
        override={"LIBRARY_OVERRIDABLE"},
        update=_on_turns,
    )
    lead: Sequence[float] = FloatVectorProperty(
        name="Point",
        description="The point that its path in the viewport follows, on its own axes. At zero it is the origin",
        subtype="TRANSLATION",
        size=3,
        options=set(),
        override={"LIBRARY_OVERRIDABLE"},
    )
    # The mode chosen before there was an Action to store it.
    awaited: str = EnumProperty(items=MODE_ITEMS, options={"HIDDEN"}, override={"LIBRARY_OVERRIDABLE"})
    # The Empty with the motion below an offset layer: see `baking.layers`.
    base: bpy.types.Object | None = PointerProperty(
        type=bpy.types.Object, options={"HIDDEN"}, override={"LIBRARY_OVERRIDABLE"}
    )
    bakes: bpy.types.bpy_prop_collection[ChangedKeys] = CollectionProperty(
        type=ChangedKeys, override={"LIBRARY_OVERRIDABLE", "USE_INSERTION"}
    )


OWNER_TYPES = bpy.types.Object, bpy.types.PoseBone
CLASSES = (ChangedKeys, RigidMotion)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    for carrier in OWNER_TYPES:
        setattr(carrier, MOTION_PROPERTY, PointerProperty(type=RigidMotion, override={"LIBRARY_OVERRIDABLE"}))


def unregister() -> None:
    for carrier in OWNER_TYPES:
        delattr(carrier, MOTION_PROPERTY)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
