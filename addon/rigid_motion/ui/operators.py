"""What can be done to motions: an operator for each verb of `rigid_motion.animation`."""

from __future__ import annotations

from contextlib import nullcontext
from typing import ClassVar

import bpy
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_
from bpy.app.translations import pgettext_tip as tip_
from bpy.props import EnumProperty

from .. import animation
from ..animation import Refused
from ..animation.baking.copies import BAKED
from ..animation.edits.repair import with_troubles
from ..animation.live.follower import paused
from ..animation.properties import MODE_ITEMS, OWN_WORDS
from ..animation.queries.polls import with_modes
from ..animation.transforms import Transform
from .bake import RIGID_MOTION_OT_bake
from .on_targets import OnChanged, OnTargets
from .preferences import DEFAULT_MODE, default_mode
from .targets import (
    SCOPES,
    SELECTED,
    WHOLE,
    grouped_by_frames,
    is_posing,
    scope_for,
    targets_of,
)
from .wording import DESCRIPTIONS, LABELS, algebra_of, listed, spoken_of

SCOPE_NAMES = {scope: label for scope, label, _ in SCOPES}

REFRESHED = (
    n_("All up to date"),
    n_("In-betweens of {count} Action refreshed"),
    n_("In-betweens of {count} Actions refreshed"),
)
"""The text on what was refreshed, by the number of Actions."""


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
        with paused() if len(groups) > 1 else nullcontext():
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

    def do(self, _context: bpy.types.Context, targets: list[Transform], refused: list[Refused]) -> str:
        animation.set_mode(targets, "BLENDER", refused=refused)
        return rpt_("Blender's own in-betweens")


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

    def do(self, _context: bpy.types.Context, targets: list[Transform], refused: list[Refused]) -> str:
        animation.restore_constraints(targets, refused=refused)
        return rpt_("constraint restored")


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
    RIGID_MOTION_OT_bake,
    RIGID_MOTION_OT_unbake,
    RIGID_MOTION_OT_mend,
    RIGID_MOTION_OT_refresh,
)
