"""What can be done to motions: an operator for each verb of `rigid_motion.animation`."""

from __future__ import annotations

from contextlib import nullcontext
from functools import partial
from typing import ClassVar

import bpy
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_
from bpy.app.translations import pgettext_tip as tip_
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty

from .. import animation
from ..animation.actions.records import recorded
from ..animation.baking.originals import BAKED
from ..animation.edits.constraints import with_troubles
from ..animation.live.follower import follower
from ..animation.properties import MODE_ITEMS, MOST_TURNS, SCREW_AXIS, TURN_AXIS_ITEMS
from ..animation.queries.keyed import active_binding
from ..animation.queries.polls import with_in_betweens, with_modes
from ..animation.transforms import OWN_WORDS, Refused, Transform
from .preferences import DEFAULT_MODE, default_mode
from .targets import (
    CURRENT,
    SCOPES,
    SELECTED,
    WHOLE,
    OnChanged,
    OnTargets,
    active_target,
    grouped_by_frames,
    is_key_editor,
    is_posing,
    scope_for,
    targets_of,
)
from .wording import DESCRIPTIONS, LABELS, algebra_of, listed, split, spoken_of

TURN_SCOPES = [
    (WHOLE, "All Segments", "All segments get so many turns"),
    (CURRENT, "Current Segment", "The segment that the playhead is in. The others keep their turns"),
    (SELECTED, "Selected Keys", "The segments that the selected keys begin. The others keep their turns"),
]
"""The parts of a target that get turns, as the items of an enum property."""

SCOPE_NAMES = {scope: label for scope, label, _ in SCOPES}

REFRESHED = (
    n_("All up to date"),
    n_("In-betweens of {count} Action refreshed"),
    n_("In-betweens of {count} Actions refreshed"),
)
"""The text on what was refreshed, by the number of Actions."""


class RIGID_MOTION_OT_bake(OnTargets, bpy.types.Operator):
    bl_idname = "rigid_motion.bake"
    bl_label = "Bake to Keys"
    bl_description = (
        "Put the in-betweens on location, rotation and scale as real keys of type Generated, in a copy of the Action, "
        "for hand-over to programs that read keys only. Un-Bake gives the original back"
    )

    nothing_to_do = n_("There are no rigid in-betweens to bake: choose a mode for keys of these objects first")
    with_work = staticmethod(with_in_betweens)

    step: FloatProperty(
        name="Step",
        description="Frames from one baked key to the next. Below 1 there are keys between the frames, for motion blur",
        default=1.0,
        min=0.01,
        soft_min=0.1,
        soft_max=10.0,
        step=25,
        precision=2,
    )
    interpolation: EnumProperty(
        name="Interpolation",
        description="What is between baked keys",
        items=[
            ("LINEAR", "Linear", "Straight lines"),
            ("CONSTANT", "Constant", "Each pose holds until the next key: with a step of 2 the motion is on twos"),
        ],
        translation_context=OWN_WORDS,
    )
    frames: EnumProperty(
        name="Frames",
        description="What to bake, widened to whole segments, and those of smooth modes beside them",
        items=[
            ("ACTION", "Action", "From the first key of each to its last"),
            ("SCENE", "Scene", "The frame range of the scene, or its preview range while that is in use"),
            ("CUSTOM", "Custom", "From one frame to another"),
        ],
        translation_context=OWN_WORDS,
    )
    first: FloatProperty(name="Start", description="First frame to bake", default=1.0, step=100, precision=2)
    last: FloatProperty(name="End", description="Last frame to bake", default=250.0, step=100, precision=2)

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        if self.frames != "CUSTOM":
            self.first, self.last = _range_of(context.scene)
        return context.window_manager.invoke_props_dialog(self, confirm_text="Bake")

    def draw(self, _context: bpy.types.Context) -> None:
        layout = split(self.layout)
        layout.prop(self, "step")
        layout.row().prop(self, "interpolation", expand=True)
        layout.row().prop(self, "frames", expand=True)
        if self.frames == "CUSTOM":
            column = layout.column(align=True)
            column.prop(self, "first")
            column.prop(self, "last")

    def execute(self, context: bpy.types.Context) -> set[str]:
        first, last = self._range(context)
        if first is not None and first > last:
            text = rpt_("The range to bake ends on frame {last:g}, before its start, {first:g}")
            self.report({"ERROR"}, text.format(last=last, first=first))
            return {"CANCELLED"}
        return super().execute(context)

    def do(self, context: bpy.types.Context, targets: list[Transform], refused: list[Refused]) -> str:
        first, last = self._range(context)
        begin, end = animation.bake(
            targets, step=self.step, first=first, last=last, interpolation=self.interpolation, refused=refused
        )
        return rpt_("baked from frame {first:g} to {last:g}").format(first=begin, last=end)

    def _range(self, context: bpy.types.Context) -> tuple[float, float] | tuple[None, None]:
        if self.frames == "ACTION":
            return None, None
        return _range_of(context.scene) if self.frames == "SCENE" else (self.first, self.last)


def _range_of(scene: bpy.types.Scene) -> tuple[int, int]:
    if scene.use_preview_range:
        return scene.frame_preview_start, scene.frame_preview_end
    return scene.frame_start, scene.frame_end


class RIGID_MOTION_OT_set_turns(OnTargets, bpy.types.Operator):
    bl_idname = "rigid_motion.set_turns"
    bl_label = "Set Turns"
    bl_description = "Have the selected objects make whole turns more from key to key"

    turns: IntProperty(
        name="Turns",
        description="Whole turns more than there are without, in the same sense; against it where negative",
        default=1,
        min=-MOST_TURNS,
        max=MOST_TURNS,
        soft_min=-20,
        soft_max=20,
    )
    axis: EnumProperty(
        name="Axis",
        description="What the turns are about, in all segments",
        items=TURN_AXIS_ITEMS,
        default=SCREW_AXIS,
        translation_context=OWN_WORDS,
    )
    on: EnumProperty(
        name="Segments",
        description="Which segments get the turns",
        items=TURN_SCOPES,
        default=CURRENT,
        translation_context=OWN_WORDS,
        options={"SKIP_SAVE"},
    )

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        if not self.properties.is_property_set("on"):
            self.on = SELECTED if is_key_editor(context) else CURRENT
        active = active_target(context)
        if active is not None and (binding := active_binding(active)) is not None:
            self.turns, self.axis = active.motion.turns or 1, recorded(binding).turns_axis
        return context.window_manager.invoke_props_dialog(self, confirm_text="Set Turns")

    def draw(self, _context: bpy.types.Context) -> None:
        layout = split(self.layout)
        for name in ("turns", "axis", "on"):
            layout.prop(self, name)

    def do(self, context: bpy.types.Context, targets: list[Transform], refused: list[Refused]) -> str:
        axis = self.axis if self.properties.is_property_set("axis") else None
        for frames, group in grouped_by_frames(context, targets, self.on, refused).items():
            animation.set_turns(group, self.turns, frames, axis=axis, refused=refused)
        return rpt_("{turns} turns more").format(turns=self.turns)


class RIGID_MOTION_OT_exact(OnTargets, bpy.types.Operator):
    bl_idname = "rigid_motion.exact"
    bl_label = "Exact Between Frames"
    bl_description = (
        "Follow the modes between whole frames as well, for motion blur, strips in slow motion and fast moves: "
        "by a constraint in place of delta transforms"
    )
    nothing_to_do = n_("What is selected is exact between frames anyway")
    with_work = staticmethod(lambda targets: (target for target in targets if not target.is_part))
    leaves_others = True

    is_exact: BoolProperty(
        name="Exact",
        description="Off, in-betweens are in delta transforms, which are right on whole frames",
        default=True,
    )

    def do(self, _context: bpy.types.Context, targets: list[Transform], refused: list[Refused]) -> str:
        animation.set_exact(targets, self.is_exact, refused=refused)
        return rpt_("exact between frames") if self.is_exact else rpt_("exact on whole frames")


class RIGID_MOTION_OT_set_mode(OnTargets, bpy.types.Operator):
    bl_idname = "rigid_motion.set_mode"
    bl_label = "Set Rigid Motion Mode"
    bl_description = "Choose how the selected objects move from key to key"

    mode: EnumProperty(
        name="Mode",
        description="What happens between the keys",
        items=MODE_ITEMS,
        default=DEFAULT_MODE,
        options={"SKIP_SAVE"},
    )
    on: EnumProperty(
        name="Segments",
        description="Which segments get the mode",
        items=SCOPES,
        default=WHOLE,
        translation_context=OWN_WORDS,
        options={"SKIP_SAVE"},
    )

    @classmethod
    def description(cls, context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        if not properties.is_property_set("mode"):
            return super().description(context, properties)
        what = tip_(spoken_of(DESCRIPTIONS[properties.mode], "bones" if is_posing(context) else "objects"))
        on = tip_("On: {segments}").format(segments=tip_(SCOPE_NAMES[properties.on], OWN_WORDS))
        algebra = tip_(algebra_of(properties.mode))
        return "\n".join(filter(None, (f"{what}.", algebra, on)))

    def execute(self, context: bpy.types.Context) -> set[str]:
        if not self.properties.is_property_set("mode"):
            self.mode = default_mode()
        if not self.properties.is_property_set("on"):
            self.on = scope_for(context)
        targets = targets_of(context)
        if self.on == SELECTED:
            targets = [target for target in targets if len(animation.key_frames(target, selected=True))]
            if not targets:
                self.report({"ERROR"}, "Select keys of location, rotation or scale first")
                return {"CANCELLED"}
        return self.act(targets, lambda refused: self._set(context, targets, refused))

    def _set(self, context: bpy.types.Context, targets: list[Transform], refused: list[Refused]) -> str:
        groups = grouped_by_frames(context, targets, self.on, refused)
        # Several groups are refreshed together behind the last; a single one is read only once by the verb itself.
        with follower.turn() if len(groups) > 1 else nullcontext():
            for frames, group in groups.items():
                animation.set_mode(group, self.mode, frames, refused=refused)
        if len(groups) > 1:
            animation.refresh(targets)
        label = rpt_(LABELS[self.mode])
        if list(groups) == [None]:
            return label
        frames = sorted({frame for group in groups for frame in group})
        text = rpt_("{mode} from frames {frames}") if len(frames) > 1 else rpt_("{mode} from frame {frames}")
        return text.format(mode=label, frames=listed([f"{frame:g}" for frame in frames]))


class RIGID_MOTION_OT_clear(OnTargets, bpy.types.Operator):
    bl_idname = "rigid_motion.clear"
    bl_label = "Clear Modes"
    bl_description = (
        "Give the objects Blender's own in-betweens again, and remove the keys of their modes. "
        "Keys of location, rotation and scale stay"
    )
    nothing_to_do = n_("These objects have Blender's own in-betweens already")
    with_work = staticmethod(with_modes)
    leaves_others = True
    verb = staticmethod(partial(animation.set_mode, mode="BLENDER"))
    summary = n_("Blender's own in-betweens")


class RIGID_MOTION_OT_unbake(OnChanged, bpy.types.Operator):
    bl_idname = "rigid_motion.unbake"
    bl_label = "Un-Bake"
    bl_description = "Give baked objects the Actions back that they had before, with their own keys and modes"
    kind = BAKED
    nothing_to_do = n_("None of these objects is baked")
    verb = staticmethod(animation.unbake)
    summary = n_("back to the keys from before baking")


class RIGID_MOTION_OT_mend(OnTargets, bpy.types.Operator):
    bl_idname = "rigid_motion.mend"
    bl_label = "Restore Constraint"
    bl_description = (
        'Put the constraint "Rigid Motion" back on the selected bones, which shows their in-betweens: '
        "first in the stack, unmuted, with full influence"
    )
    nothing_to_do = n_("None of these objects lacks its constraint")
    with_work = staticmethod(with_troubles)
    leaves_others = True
    verb = staticmethod(animation.restore_constraints)
    summary = n_("constraint restored")


class RIGID_MOTION_OT_refresh(bpy.types.Operator):
    bl_idname = "rigid_motion.refresh"
    bl_label = "Refresh In-Betweens"
    bl_description = (
        "Bring all in-betweens of this file up to date with their keys. "
        "Needed only while Live Update is off, in the preferences of the extension"
    )
    bl_options: ClassVar[set[str]] = {"REGISTER", "UNDO"}

    def execute(self, _context: bpy.types.Context) -> set[str]:
        stale = animation.refresh()
        self.report({"INFO"}, rpt_(REFRESHED[min(stale, 2)]).format(count=stale))
        return {"FINISHED"}


CLASSES = (
    RIGID_MOTION_OT_set_mode,
    RIGID_MOTION_OT_clear,
    RIGID_MOTION_OT_set_turns,
    RIGID_MOTION_OT_exact,
    RIGID_MOTION_OT_bake,
    RIGID_MOTION_OT_unbake,
    RIGID_MOTION_OT_mend,
    RIGID_MOTION_OT_refresh,
)
