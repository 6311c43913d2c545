"""Operators that reduce and restore keys: *Reduce Keys to Poses*, *Restore Keys*, *Discard Dense Keys*.

They also work on rigs in Object Mode. *Reduce into Holds* reduces the keys of objects held in hands.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any, cast

import bpy
from bpy.app.translations import pgettext_iface as iface_
from bpy.app.translations import pgettext_n as n_

from .. import animation
from ..animation import Refused
from ..animation.baking.into_holds import DEFAULT_HAND_TOLERANCE, DEFAULT_MIN_HOLD_FRAMES
from ..animation.baking.originals import CLEANED, REDUCED
from ..animation.properties import MODE_ITEMS
from ..animation.queries.polls import with_more_keys_than
from ..animation.transforms import OWN_WORDS, Transform, transform_of
from ..animation.transforms.sizes import first_tolerance
from ..blender import BoolProperty, EnumProperty, FloatProperty, IntProperty, Returned, StringProperty, with_properties
from .targets import OnChanged, OnTargets, each_done, each_target, is_posing, selected_in_view, with_bones_of_rigs
from .wording import NATIVE_LABEL, hold_lines, labelled, reduction_rows, reduction_summary, split


def radius_property(
    description: str = "At 0 each object has the size of its bounding box, and each bone that of what it moves",
    **more: Any,
) -> Any:
    """Return the property `radius` of operators that change keys: errors count within this radius."""
    return FloatProperty(
        name="Radius",
        description=description,
        min=0.0,
        soft_max=10.0,
        step=1.0,
        precision=4,
        subtype="DISTANCE",
        **more,
    )


def tolerance_property(description: str, default: float = 0.001) -> Any:
    """Return the property `tolerance` of operators that change keys."""
    return FloatProperty(
        name="Tolerance",
        description=description,
        default=default,
        min=1e-6,
        soft_max=1.0,
        step=0.1,
        precision=4,
        subtype="DISTANCE",
    )


class OfRigsToo:
    """Operators that act on all keyed bones of a rig selected outside of Pose Mode, as rigs are after an import."""

    @classmethod
    def each_target(cls, context: bpy.types.Context) -> Iterator[Transform]:
        return with_bones_of_rigs(context, each_target(context))


@with_properties
class RIGID_MOTION_OT_reduce_keys(OfRigsToo, OnTargets):
    bl_idname = "rigid_motion.reduce_keys"
    bl_label = "Reduce Keys to Poses"
    bl_description = (
        "Keep only the keys that the motion needs, location and rotation together: for imported motion capture, "
        "baked simulations and solved cameras. Restore Keys brings all of them back"
    )

    nothing_to_do = n_(
        "Nothing here has more than two keys. First convert constraints, drivers and simulations to keys (Animation"
        " > Bake Action, with Visual Keying)"
    )
    with_work = staticmethod(partial(with_more_keys_than, count=2))

    by: str = EnumProperty(
        name="Reduce By",
        description="What decides how many keys are left",
        items=[
            ("TOLERANCE", "Tolerance", "The fewest keys that keep the motion within the tolerance"),
            ("NUMBER", "Number", "This many keys, or key poses of a rig, with the smallest error found"),
        ],
        translation_context=OWN_WORDS,
    )
    tolerance: float = tolerance_property(
        "The largest error of any point at any time, within the radius around what moves. For bones it includes"
        " the errors of their parents. The default is a millimetre, for a rig 0.3 % of its size, or 2 % for key"
        " poses"
    )
    offered: float = FloatProperty(
        description="The tolerance that was offered last, until another one is set", options={"HIDDEN"}
    )
    count: int = IntProperty(
        name="Number",
        description="Remaining keys of each object, or key poses of each rig. The resulting error is below",
        default=12,
        min=2,
        soft_max=100,
    )
    radius: float = radius_property(
        "The distance from the origin up to which the tolerance applies: the larger, the more rotations count. At 0"
        " each object has the size of its bounding box, and each bone that of what it moves",
        options={"SKIP_SAVE"},
    )
    mode: str = EnumProperty(
        name="Mode",
        description=(
            "The motion between the remaining keys, which decides which ones remain. Starts with Native Curves, "
            "Smooth Screw or another mode, whichever needs the fewest keys"
        ),
        items=[
            (
                animation.NATIVE,
                NATIVE_LABEL,
                "Blender's own Bezier keys with handles, which need no mode and play anywhere. They keep the "
                "tolerance on frames. Their error between frames is below",
                0,
            ),
            *(item for item in MODE_ITEMS if item[0] != "BLENDER"),
        ],
        default="motor_spline",
        translation_context=OWN_WORDS,
    )
    offered_mode: str = StringProperty(
        description="The mode that was chosen last, until another one is chosen", options={"HIDDEN"}
    )
    is_chosen: bool = BoolProperty(
        description="Whether a mode was chosen since the operator was called", options={"HIDDEN", "SKIP_SAVE"}
    )
    shared: bool = BoolProperty(
        name="Key Poses",
        description="Give all bones of a rig keys on the same frames. Otherwise each bone has its own frames: fewer"
        " keys in total",
    )
    hold: bool = BoolProperty(
        name="Hold Feet",
        description="Keep bones within a quarter of the tolerance while they stand on the ground",
        default=True,
    )

    def draw(self, context: bpy.types.Context) -> None:
        layout = split(self.layout)
        targets = list(self.each_target(context))
        rigs = any(target.is_part for target in targets)
        layout.row().prop(self, "by", expand=True)
        if self.by == "NUMBER":
            text = iface_("Key Poses") if rigs else iface_("Keys", OWN_WORDS)
            layout.prop(self, "count", text=text, translate=False)
        else:
            layout.prop(self, "tolerance")
        # Key poses given by number are always shared.
        of_rigs = ("hold",) if self.by == "NUMBER" else ("shared", "hold")
        for name in ("radius", "mode", *(of_rigs if rigs else ())):
            layout.prop(self, name)
        column = layout.column(align=True)
        for label, text in reduction_rows(cast(bpy.types.Scene, context.scene), animation.reduction_of(targets)):
            labelled(column, label).label(text=text, translate=False)

    def execute(self, context: bpy.types.Context) -> Returned:
        targets = list(self.each_target(context))
        if not self.properties.is_property_set("tolerance") or self.tolerance == self.offered:
            self.tolerance = self.offered = first_tolerance(
                cast(bpy.types.Scene, context.scene), targets, shared=self.shared
            )
        if not self.radius and len(targets) == 1:
            self.radius = animation.radius_of(targets[0].carrier)
        return super().execute(context)

    def do(self, context: bpy.types.Context, targets: list[Transform], refused: list[Refused]) -> str:
        before = [len(target.motion.bakes) for target in targets]
        is_offered = not self.properties.is_property_set("mode") or self.mode == self.offered_mode
        animation.reduce_keys_of(
            targets,
            animation.FEWEST if is_offered and not self.is_chosen else self.mode,
            self.tolerance,
            self.radius or None,
            shared=self.shared,
            hold=self.hold,
            count=self.count if self.by == "NUMBER" else None,
            refused=refused,
        )
        reduced = [target for target, count in zip(targets, before, strict=True) if len(target.motion.bakes) > count]
        reduction = animation.reduction_of(reduced)
        if reduction is None:
            return ""
        if len(reduction.needed) > 1:
            self.mode = self.offered_mode = reduction.mode
        self.is_chosen = True
        return reduction_summary(cast(bpy.types.Scene, context.scene), reduction)


Holders = Sequence[bpy.types.Object | bpy.types.PoseBone] | None


def props_and_holders(context: bpy.types.Context) -> tuple[list[Transform], Holders]:
    """Return the selected transforms to hold, and their possible holders: selected rigs, or else the active object.

    In Pose Mode the selected bones hold the selected objects that are not posed; without any, the active bone holds
    the other bones. None as holders means all rigs of the scene.
    """
    things: Sequence[bpy.types.Object | bpy.types.PoseBone] = selected_in_view(context)
    active: bpy.types.Object | bpy.types.PoseBone | None = context.object
    if is_posing(context):
        active = context.active_pose_bone
        if objects := [obj for obj in context.selected_objects or () if obj.mode != "POSE"]:
            return list(map(transform_of, objects)), things or None
    elif rigs := [obj for obj in things if isinstance(obj, bpy.types.Object) and obj.type == "ARMATURE"]:
        return [transform_of(obj) for obj in things if obj not in rigs], rigs
    if len(things) < 2 or active is None or active not in things:
        return list(map(transform_of, things)), None
    return [transform_of(thing) for thing in things if thing != active], [active]


@with_properties
class RIGID_MOTION_OT_reduce_into_holds(OnTargets):
    bl_idname = "rigid_motion.reduce_into_holds"
    bl_label = "Reduce into Holds"
    bl_description = (
        "Find out what held the selection in the recording, and hold it there with a single key: select it, then "
        "the rigs or the bone that may have held it. With nothing else selected all rigs are tried. Restore Keys "
        "brings all of its keys back"
    )
    nothing_to_do = n_("Select something with dense keys, such as a recording, and then what held it")
    with_work = staticmethod(partial(with_more_keys_than, count=DEFAULT_MIN_HOLD_FRAMES - 1))

    tolerance: float = tolerance_property(
        "The largest error of any point on any frame, within the radius around what is held. Recorded hands "
        "give by a few millimetres",
        DEFAULT_HAND_TOLERANCE,
    )
    least: int = IntProperty(
        name="At Least",
        description="The fewest frames on which something is held. For fewer its keys stay as they are",
        default=DEFAULT_MIN_HOLD_FRAMES,
        min=2,
        soft_max=100,
    )
    radius: float = radius_property(options={"SKIP_SAVE"})

    @classmethod
    def each_target(cls, context: bpy.types.Context) -> Iterator[Transform]:
        return iter(props_and_holders(context)[0])

    def draw(self, context: bpy.types.Context) -> None:
        layout = split(self.layout)
        for name in ("tolerance", "least", "radius"):
            layout.prop(self, name)
        column = layout.column(align=True)
        for line in hold_lines(animation.reduction_of(list(self.each_target(context)))):
            column.label(text=line, translate=False)

    def do(self, context: bpy.types.Context, targets: list[Transform], refused: list[Refused]) -> str:
        _, holders = props_and_holders(context)
        settings: Any = {"tolerance": self.tolerance, "radius": self.radius or None, "least": self.least}
        done = each_done(targets, refused, lambda item: animation.reduce_into_holds(item, holders, **settings))
        return "; ".join(hold_lines(animation.reduction_of(done))) if done else ""


class RIGID_MOTION_OT_restore_keys(OfRigsToo, OnChanged):
    bl_idname = "rigid_motion.restore_keys"
    bl_label = "Restore Keys"
    bl_description = "Restore the keys from before the last reduction or cleaning, with all handles"
    kinds = REDUCED, CLEANED
    nothing_to_do = n_("The keys here are neither reduced nor cleaned")
    verb = staticmethod(animation.restore_keys)
    summary = n_("back to the keys from before")


class RIGID_MOTION_OT_discard_dense_keys(OfRigsToo, OnChanged):
    bl_idname = "rigid_motion.discard_dense_keys"
    bl_label = "Discard Dense Keys"
    bl_description = (
        "Remove the keys that Restore Keys would bring back from the file, once you are happy with the new ones. "
        "The new keys do not change"
    )
    kinds = REDUCED, CLEANED
    nothing_to_do = n_("The keys here are neither reduced nor cleaned")
    verb = staticmethod(animation.discard_dense_keys)
    summary = n_("previous keys removed from the file")
