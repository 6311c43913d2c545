"""Operators on motions: bake, set modes and turns, copy modes, add cycles and layers, clear and refresh."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from functools import partial

import bpy
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_
from bpy.app.translations import pgettext_tip as tip_

from .. import animation
from ..animation.actions.marks import read_marks
from ..animation.actions.refusals import MOST_TURNS
from ..animation.baking.layers import strips_of
from ..animation.baking.originals import BAKED
from ..animation.evaluation.sources import SCREW_AXIS, TURN_AXES
from ..animation.properties import MODE_ITEMS, TURN_AXIS_ITEMS
from ..animation.queries.keyed import active_binding
from ..animation.queries.polls import with_holders, with_in_betweens, with_modes, with_more_keys_than
from ..animation.transforms import OWN_WORDS, Refused, Transform
from ..animation.transforms.sizes import first_tolerance
from ..blender import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    Operator,
    Returned,
    existing,
    with_properties,
)
from .preferences import DEFAULT_MODE, preferences
from .reducing import radius_property, tolerance_property
from .targets import (
    CURRENT,
    SCOPES,
    SELECTED,
    WHOLE,
    OnChanged,
    OnTargets,
    active_target,
    each_target,
    grouped_by_frames,
    is_key_editor,
    scope_for,
    targets_of,
)
from .wording import DESCRIPTIONS, LABELS, listed, reduction_summary, split

SCOPE_NAMES = {scope: label for scope, label, _ in SCOPES}


def with_what_to_bake(targets: Iterable[Transform]) -> Iterator[Transform]:
    """Yield the targets with in-betweens, then the held ones."""
    targets = list(targets)
    return itertools.chain(with_in_betweens(targets), with_holders(targets))


@with_properties
class RIGID_MOTION_OT_bake(OnTargets):
    bl_idname = "rigid_motion.bake"
    bl_label = "Bake to Keys"
    bl_description = (
        "Convert the in-betweens to real keys of type Generated, for programs that read only keys. Un-Bake restores"
        " the original keys"
    )

    nothing_to_do = n_("There are no rigid in-betweens to bake: choose a mode first")
    with_work = staticmethod(with_what_to_bake)

    step: float = FloatProperty(
        name="Step",
        description="Frames between baked keys. Below 1 there are keys between frames, for motion blur",
        default=1.0,
        min=0.01,
        soft_min=0.1,
        soft_max=10.0,
        step=25,
        precision=2,
    )
    interpolation: str = EnumProperty(
        name="Interpolation",
        description="What is between baked keys",
        items=[
            ("LINEAR", "Linear", "Straight lines"),
            ("CONSTANT", "Constant", "Each pose holds until the next key: with a step of 2 the motion is on twos"),
        ],
        translation_context=OWN_WORDS,
    )
    to_world: bool = BoolProperty(
        name="To World",
        description=(
            "Put held things into the space of their parent, or the world, so that they no longer follow their "
            "holders. Otherwise their keys stay in the spaces of their holders"
        ),
        options={"SKIP_SAVE"},
    )

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> Returned:
        return existing(context.window_manager).invoke_props_dialog(self, confirm_text="Bake")

    def draw(self, context: bpy.types.Context) -> None:
        layout = split(self.layout)
        layout.prop(self, "step")
        layout.row().prop(self, "interpolation", expand=True)
        if self.to_world or any(with_holders(each_target(context))):
            layout.prop(self, "to_world")

    def do(self, _context: bpy.types.Context, targets: list[Transform], refused: list[Refused]) -> str:
        bake = animation.bake_to_world if self.to_world else animation.bake
        begin, end = bake(targets, step=self.step, interpolation=self.interpolation, refused=refused)
        return rpt_("baked from frame {first:g} to {last:g}").format(first=begin, last=end)


def axis_of_turns(target: Transform) -> str:
    """Return the axis of a target's turns: one of `TURN_AXES`, or `SCREW_AXIS`."""
    binding = active_binding(target)
    fcurve = None if binding is None else binding.curves.get(target.turns_channel)
    mark = 0 if fcurve is None else int(max(read_marks(fcurve)[:1], default=0))
    return TURN_AXES[(mark - 1) % len(TURN_AXES)] if mark else SCREW_AXIS


@with_properties
class RIGID_MOTION_OT_set_turns(OnTargets):
    bl_idname = "rigid_motion.set_turns"
    bl_label = "Set Turns"
    bl_description = "Add whole turns to the selection from key to key"

    turns: int = IntProperty(
        name="Turns",
        description="Extra whole turns in the same direction; negative for the opposite one",
        default=1,
        min=-MOST_TURNS,
        max=MOST_TURNS,
        soft_min=-20,
        soft_max=20,
    )
    axis: str = EnumProperty(
        name="Axis",
        description="The axis of the turns, in all segments",
        items=TURN_AXIS_ITEMS,
        default=SCREW_AXIS,
        translation_context=OWN_WORDS,
    )
    on: str = EnumProperty(
        name="Segments",
        description="Which segments get the turns",
        items=SCOPES,
        default=CURRENT,
        translation_context=OWN_WORDS,
        options={"SKIP_SAVE"},
    )

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> Returned:
        if not self.properties.is_property_set("on"):
            self.on = SELECTED if is_key_editor(context) else CURRENT
        active = active_target(context)
        if active is not None:
            self.turns, self.axis = active.motion.turns or 1, axis_of_turns(active)
        return existing(context.window_manager).invoke_props_dialog(self, confirm_text="Set Turns")

    def do(self, context: bpy.types.Context, targets: list[Transform], refused: list[Refused]) -> str:
        axis = self.axis if self.properties.is_property_set("axis") else None
        for frames, group in grouped_by_frames(context, targets, self.on, refused).items():
            animation.set_turns(group, self.turns, frames, axis=axis, refused=refused)
        return rpt_("{turns} turns more").format(turns=self.turns)


@with_properties
class RIGID_MOTION_OT_set_mode(OnTargets):
    bl_idname = "rigid_motion.set_mode"
    bl_label = "Set Rigid Motion Mode"
    bl_description = "Choose how the selection moves from key to key"

    mode: str = EnumProperty(
        name="Mode",
        description="What happens between the keys",
        items=MODE_ITEMS,
        default=DEFAULT_MODE,
        translation_context=OWN_WORDS,
        options={"SKIP_SAVE"},
    )
    on: str = EnumProperty(
        name="Segments",
        description="Which segments get the mode",
        items=SCOPES,
        default=WHOLE,
        translation_context=OWN_WORDS,
        options={"SKIP_SAVE"},
    )

    @classmethod
    def description(cls, _context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        if not properties.is_property_set("mode"):
            return tip_(cls.bl_description)
        what = tip_(DESCRIPTIONS[properties.mode])
        on = tip_("On: {segments}").format(segments=tip_(SCOPE_NAMES[properties.on], OWN_WORDS))
        return f"{what}.\n{on}"

    def execute(self, context: bpy.types.Context) -> Returned:
        if not self.properties.is_property_set("mode"):
            self.mode = preferences().default_mode
        if not self.properties.is_property_set("on"):
            self.on = scope_for(context)
        targets = targets_of(context)
        if self.on == SELECTED:
            targets = [target for target in targets if len(animation.key_frames(target, selected=True))]
            if not targets:
                self.report({"ERROR"}, "Select keys of location, rotation or scale first")
                return {"CANCELLED"}
        return self.act(targets, lambda refused: self._set_modes(context, targets, refused))

    def _set_modes(self, context: bpy.types.Context, targets: list[Transform], refused: list[Refused]) -> str:
        groups = grouped_by_frames(context, targets, self.on, refused)
        for frames, group in groups.items():
            animation.set_mode(group, self.mode, frames, refused=refused)
        label = rpt_(LABELS[self.mode], OWN_WORDS)
        if list(groups) == [None]:
            return label
        begins = sorted({frame for group in groups for frame in group or ()})
        text = rpt_("{mode} from frames {frames}") if len(begins) > 1 else rpt_("{mode} from frame {frames}")
        return text.format(mode=label, frames=listed([f"{frame:g}" for frame in begins]))


class RIGID_MOTION_OT_copy_mode(OnTargets):
    bl_idname = "rigid_motion.copy_mode"
    bl_label = "Copy Mode to Selected"
    bl_description = (
        "Copy the modes of the active one to the rest of the selection: each key gets the mode of the active one on"
        " its frame"
    )
    nothing_meant = n_("Select the ones to receive the mode, and last the one that has it")

    @classmethod
    def each_target(cls, context: bpy.types.Context) -> Iterator[Transform]:
        active = active_target(context)
        return (target for target in each_target(context) if active not in (None, target))

    def do(self, context: bpy.types.Context, targets: list[Transform], refused: list[Refused]) -> str:
        model = existing(active_target(context))
        animation.copy_modes(model, targets, refused=refused)
        return rpt_("modes as {name} has them").format(name=model.name)


@with_properties
class RIGID_MOTION_OT_add_cycles(OnTargets):
    bl_idname = "rigid_motion.add_cycles"
    bl_label = "Add Cycles"
    bl_description = (
        "Repeat the motion before its first and after its last keys, in all channels at once: Blender itself adds "
        "no Cycles to channels with in-betweens. Clear Cyclic (F-Modifier) in the Graph Editor (Channel > "
        "Extrapolation Mode) removes them"
    )
    nothing_to_do = n_("Nothing here has the two keys that a cycle needs")
    with_work = staticmethod(partial(with_more_keys_than, count=1))
    leaves_others = True

    mode: str = EnumProperty(
        name="Cycles",
        description="How each round follows the one before",
        items=[
            ("REPEAT", "Repeat", "Each round is the same"),
            ("REPEAT_OFFSET", "Repeat with Offset", "Each round continues where the one before ended"),
            ("MIRROR", "Mirror", "Every other round runs backwards"),
        ],
        translation_context=OWN_WORDS,
    )

    def do(self, _context: bpy.types.Context, targets: list[Transform], refused: list[Refused]) -> str:
        animation.repeat(targets, self.mode, refused=refused)
        return rpt_("the motion repeats")


class RIGID_MOTION_OT_add_layer(OnTargets):
    bl_idname = "rigid_motion.add_layer"
    bl_label = "Add Layer"
    bl_description = (
        "Key an offset on top of the motion, as one rigid motion on another: from now on the keys of the selection are "
        "the offset, in an NLA strip whose influence is keyed. The motion below goes to an Empty, where its keys stay"
    )
    nothing_to_do = n_("All of it has a layer: merge it first")
    with_work = staticmethod(partial(filter, lambda target: target.motion.base is None))
    leaves_others = True
    verb = staticmethod(animation.add_layer)
    summary = n_("its keys are an offset now; the motion below is that of the Empty")


@with_properties
class RIGID_MOTION_OT_merge_layer(OnTargets):
    bl_idname = "rigid_motion.merge_layer"
    bl_label = "Merge Layer"
    bl_description = (
        "Write what is seen as keys of the Action from before the layer, and remove the layer and its Empty. Keys stay "
        "on their frames, and come in between where the motion needs them. Of a rig that is the layer of all bones"
    )
    nothing_to_do = n_("Nothing here has a layer")
    with_work = staticmethod(partial(filter, lambda target: target.motion.base or strips_of(target.animated)))
    leaves_others = True

    tolerance: float = tolerance_property(
        "How far off any point may be on any frame, within the radius around what is moved. To begin with a "
        "millimetre, and of a rig 0.3 % of its size"
    )
    radius: float = radius_property(options={"SKIP_SAVE"})

    def execute(self, context: bpy.types.Context) -> Returned:
        if not self.properties.is_property_set("tolerance"):
            self.tolerance = first_tolerance(existing(context.scene), self.acted_on(context))
        return super().execute(context)

    def do(self, context: bpy.types.Context, targets: list[Transform], refused: list[Refused]) -> str:
        merged = animation.merge_layer(targets, self.tolerance, self.radius or None, refused=refused)
        return "" if merged is None else reduction_summary(existing(context.scene), merged)


class RIGID_MOTION_OT_clear(OnTargets):
    bl_idname = "rigid_motion.clear"
    bl_label = "Clear Modes"
    bl_description = "Restore Blender's own in-betweens for the selection. Its keys do not change"
    nothing_to_do = n_("All keys already have Blender's own in-betweens")
    with_work = staticmethod(with_modes)
    leaves_others = True
    verb = staticmethod(partial(animation.set_mode, mode="BLENDER"))
    summary = n_("Blender's own in-betweens")


class RIGID_MOTION_OT_unbake(OnChanged):
    bl_idname = "rigid_motion.unbake"
    bl_label = "Un-Bake"
    bl_description = "Restore the Action from before baking, with its keys and modes"
    kinds = (BAKED,)
    nothing_to_do = n_("Nothing here is baked")
    verb = staticmethod(animation.unbake)
    summary = n_("keys from before baking restored")


class RIGID_MOTION_OT_refresh(Operator):
    bl_idname = "rigid_motion.refresh"
    bl_label = "Refresh In-Betweens"
    bl_description = (
        "Update all in-betweens of this file from their keys. Only needed while Live Update is off in the "
        "preferences of the extension"
    )

    def execute(self, _context: bpy.types.Context) -> Returned:
        count = animation.refresh()
        self.report({"INFO"}, rpt_("In-betweens refreshed: {count}").format(count=count))
        return {"FINISHED"}
