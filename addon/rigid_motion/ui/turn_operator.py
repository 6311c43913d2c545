"""Setting whole turns between keys."""

from __future__ import annotations

import bpy
from bpy.app.translations import pgettext_rpt as rpt_
from bpy.props import EnumProperty, IntProperty

from .. import animation
from ..animation import Refused
from ..animation.actions.records import recorded
from ..animation.properties import MOST_TURNS, OWN_WORDS, SCREW_AXIS, TURN_AXIS_ITEMS
from ..animation.queries.keyed import active_binding
from ..animation.transforms import Transform
from .on_targets import OnTargets
from .targets import CURRENT, SELECTED, WHOLE, active_target, grouped_by_frames, is_key_editor

TURN_SCOPES = [
    (WHOLE, "All Segments", "All segments get so many turns"),
    (CURRENT, "Current Segment", "The segment that the playhead is in. The others keep their turns"),
    (SELECTED, "Selected Keys", "The segments that the selected keys begin. The others keep their turns"),
]
"""The parts of a target that get turns, as the items of an enum property."""


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
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        for name in ("turns", "axis", "on"):
            layout.prop(self, name)

    def do(self, context: bpy.types.Context, targets: list[Transform], refused: list[Refused]) -> str:
        axis = self.axis if self.properties.is_property_set("axis") else None
        for frames, group in grouped_by_frames(context, targets, self.on, refused).items():
            animation.set_turns(group, self.turns, frames, axis=axis, refused=refused)
        return rpt_("{turns} turns more").format(turns=self.turns)


CLASSES = (RIGID_MOTION_OT_set_turns,)
