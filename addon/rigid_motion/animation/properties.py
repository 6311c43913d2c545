"""What is kept in the file, on Actions and on objects. Without the extension all of it is inert, and stays in the file.

An Action keeps the modes of what it moves: see `records`. An object or a pose bone shows its own, to be chosen and to
be animated; an object keeps the delta transforms that it has without in-betweens.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import bpy
from bpy.props import (
    BoolProperty,
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
from .actions.refusals import MOST_TURNS
from .baking.originals import BAKED, REDUCED
from .compute.sources import SCREW_AXIS
from .edits import mode_keys
from .live import follower
from .transforms import OWN_WORDS, Refused, Transform, transform_of

FIRST = ("motor_spline", "dq_sclerp")
"""The modes that menus show first: those to take where nothing speaks for another."""

MODE_ITEMS = [
    ("BLENDER", "Blender", "Blender's own in-betweens: every channel for itself", 0),
    *(
        (name, mode.label, ". ".join(filter(None, (mode.description, mode.same))), mode.number)
        for name, mode in sorted(KEYFRAME_MODES.items(), key=lambda item: (*FIRST, item[0]).index(item[0]))
    ),
]
"""The modes as items of an enumeration. Files have the numbers."""


TURN_AXIS_ITEMS = [
    (
        SCREW_AXIS,
        "Screw",
        "About the axis that a segment turns about anyway, or the local Z axis where it does not turn",
    ),
    ("X", "X", "Always about the local X axis"),
    ("Y", "Y", "Always about the local Y axis"),
    ("Z", "Z", "Always about the local Z axis"),
]
"""The axes that turns are about."""


def _on_turns_axis(record: SlotRecord, _context: bpy.types.Context) -> None:
    follower.follower.refresh_edited({record.id_data})


class SlotRecord(bpy.types.PropertyGroup):
    """One transform in one slot: its mode, and what its in-betweens were made from."""

    handle: IntProperty(options={"HIDDEN"})
    prefix: StringProperty(options={"HIDDEN"})
    mode: EnumProperty(items=MODE_ITEMS, options={"HIDDEN"})
    digest: StringProperty(options={"HIDDEN"})
    rows: StringProperty(options={"HIDDEN"})
    turns_axis: EnumProperty(
        name="Axis of Turns",
        description="What the body turns about by whole turns more, in all segments of its Action",
        items=TURN_AXIS_ITEMS,
        options=set(),
        translation_context=OWN_WORDS,
        update=_on_turns_axis,
    )
    # What the constraint of a bone is called, where that is not its usual name.
    constraint: StringProperty(options={"HIDDEN"})
    # How many samples a frame the in-betweens have, and how far off they are between these, in Blender's units.
    rate: IntProperty(default=1, options={"HIDDEN"})
    error: FloatProperty(options={"HIDDEN"})


class BoneSlot(bpy.types.PropertyGroup):
    """A slot with bones in it, and the one that the differences of these are in."""

    handle: IntProperty(options={"HIDDEN"})
    differences: IntProperty(options={"HIDDEN"})


class ActionMotion(bpy.types.PropertyGroup):
    slots: CollectionProperty(type=SlotRecord)
    bone_slots: CollectionProperty(type=BoneSlot)
    # Whether the manual frame range was set for samples that lie behind the keys.
    range_is_set_here: BoolProperty(options={"HIDDEN"})
    # Whether samples lie outside of the keys that they are for, within those of others or not.
    has_longer: BoolProperty(options={"HIDDEN"})
    # Whether in-betweens of bones have one sample a frame, until more are needed.
    is_draft: BoolProperty(options={"HIDDEN"})


class ChangedAction(bpy.types.PropertyGroup):
    """A copy of an Action that was given other keys, and what it is a copy of."""

    kind: EnumProperty(
        items=[(BAKED, "Baked", "It has keys for in-betweens too"), (REDUCED, "Reduced", "It has few of the keys")],
        options={"HIDDEN"},
    )
    changed: PointerProperty(type=bpy.types.Action)
    original: PointerProperty(type=bpy.types.Action)
    # What location, rotation and scale had when the copy was made: what had no keys gets it back.
    components: FloatVectorProperty(size=10, options={"HIDDEN"})
    # What became of its keys where they were reduced: a `Reduction` as JSON.
    reduction: StringProperty(options={"HIDDEN"})


def _on_mode(motion: ObjectMotion | BoneMotion, _context: bpy.types.Context) -> None:
    if not follower.follower.busy:
        mode_keys.on_property(_transform_with(motion))


def _on_turns(motion: ObjectMotion | BoneMotion, _context: bpy.types.Context) -> None:
    if not follower.follower.busy:
        # What refuses to turn says so in the panel.
        with suppress(Refused):
            mode_keys.on_turns(_transform_with(motion))


def _transform_with(motion: ObjectMotion | BoneMotion) -> Transform:
    """Return what has these properties."""
    obj = motion.id_data
    if isinstance(motion, BoneMotion):
        # Blender has no way from it to its bone.
        return transform_of(next(bone for bone in obj.pose.bones if bone.rigid_motion == motion))
    return transform_of(obj)


def _on_original(motion: ObjectMotion, _context: bpy.types.Context) -> None:
    follower.follow_original(transform_of(motion.id_data))


KEPT: Any = {"options": {"HIDDEN"}, "override": {"LIBRARY_OVERRIDABLE"}}
"""How what is kept of something is declared."""

ORIGINAL: Any = {"options": set(), "override": {"LIBRARY_OVERRIDABLE"}, "update": _on_original}
"""How an object's own delta transforms are."""


class _Motion:
    """What all that is moved has."""

    mode: EnumProperty(
        name="Mode",
        description="What happens between the keys. A key of this property decides from its frame on",
        items=MODE_ITEMS,
        options={"ANIMATABLE"},
        override={"LIBRARY_OVERRIDABLE"},
        update=_on_mode,
    )
    turns: IntProperty(
        name="Turns",
        description=(
            "Whole turns that the body makes more between two keys, in the sense in which it turns anyway; against it "
            "where negative. A key of this property decides from its frame on"
        ),
        min=-MOST_TURNS,
        max=MOST_TURNS,
        soft_min=-20,
        soft_max=20,
        options={"ANIMATABLE"},
        override={"LIBRARY_OVERRIDABLE"},
        update=_on_turns,
    )
    # The mode that was chosen before there was an Action to keep it.
    awaited: EnumProperty(items=MODE_ITEMS, **KEPT)
    # The constraints that it was given. Who takes one off does so on purpose.
    mounted: StringProperty(**KEPT)
    bakes: CollectionProperty(type=ChangedAction, override={"LIBRARY_OVERRIDABLE", "USE_INSERTION"})


class BoneMotion(_Motion, bpy.types.PropertyGroup):
    # The name that Actions have records of the bone under. Where it has another, it was renamed.
    recorded_as: StringProperty(**KEPT)


class ObjectMotion(_Motion, bpy.types.PropertyGroup):
    # Whether in-betweens are exact between frames, by a constraint, and not in delta transforms.
    is_exact: BoolProperty(**KEPT)
    # Which components of delta transforms in-betweens are in; the object's own are kept meanwhile.
    filled: BoolVectorProperty(size=13, **KEPT)
    own_location: FloatVectorProperty(
        name="Delta Location",
        description="The object's own delta location, to which the in-betweens are added",
        subtype="TRANSLATION",
        **ORIGINAL,
    )
    own_quaternion: FloatVectorProperty(
        name="Delta Rotation",
        translation_context=OWN_WORDS,
        description="The object's own delta rotation, to which the in-betweens are added",
        size=4,
        default=(1.0, 0.0, 0.0, 0.0),
        subtype="QUATERNION",
        **ORIGINAL,
    )
    own_euler: FloatVectorProperty(
        name="Delta Rotation",
        translation_context=OWN_WORDS,
        description="The object's own delta rotation, to which the in-betweens are added",
        subtype="EULER",
        **ORIGINAL,
    )
    own_scale: FloatVectorProperty(
        name="Delta Scale",
        description="The object's own delta scale, by which the in-betweens are multiplied",
        default=(1.0, 1.0, 1.0),
        subtype="XYZ",
        **ORIGINAL,
    )
    # Whether bones have modes, or constraints for them.
    has_bones: BoolProperty(**KEPT)
    # Whether the constraints of bones show nothing, for as long as the rig is in Edit Mode.
    detached: BoolProperty(**KEPT)


CLASSES = (SlotRecord, BoneSlot, ActionMotion, ChangedAction, BoneMotion, ObjectMotion)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Object.rigid_motion = PointerProperty(type=ObjectMotion, override={"LIBRARY_OVERRIDABLE"})
    bpy.types.PoseBone.rigid_motion = PointerProperty(type=BoneMotion, override={"LIBRARY_OVERRIDABLE"})
    bpy.types.Action.rigid_motion = PointerProperty(type=ActionMotion)


def unregister() -> None:
    del bpy.types.Action.rigid_motion
    del bpy.types.PoseBone.rigid_motion
    del bpy.types.Object.rigid_motion
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
