"""What can be done to motions: an operator for each verb of `rigid_motion.animation`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import nullcontext
from typing import ClassVar

import bpy
from bpy.app.translations import pgettext_iface as iface_
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_
from bpy.app.translations import pgettext_tip as tip_
from bpy.props import BoolProperty, EnumProperty, FloatProperty

from .. import animation
from ..animation import Refused
from ..animation.baking.copies import BAKED, REDUCED, entries_of
from ..animation.baking.sizes import first_tolerance
from ..animation.edits.repair import with_troubles
from ..animation.live.follower import paused
from ..animation.properties import MODE_ITEMS, OWN_WORDS
from ..animation.queries.polls import with_modes, with_more_keys_than
from ..animation.transforms import Transform
from .bake import RIGID_MOTION_OT_bake
from .on_targets import OnTargets
from .preferences import DEFAULT_MODE, default_mode
from .rows import labelled
from .targets import (
    SCOPES,
    SELECTED,
    WHOLE,
    each_target,
    grouped_by_frames,
    is_posing,
    scope_for,
    targets_of,
    with_bones_of_rigs,
)
from .wording import (
    DESCRIPTIONS,
    LABELS,
    counted_modes,
    length,
    listed,
    reduction_rows,
    reduction_summary,
    spoken_of,
)

SCOPE_NAMES = {scope: label for scope, label, _ in SCOPES}

LATER = {
    BAKED: n_("These keys were baked since: Un-Bake first"),
    REDUCED: n_("These keys were reduced since: Restore Keys first"),
}
"""Why what was done before cannot be taken back yet, by what was done last."""

REFRESHED = (
    n_("All up to date"),
    n_("In-betweens of {count} Action refreshed"),
    n_("In-betweens of {count} Actions refreshed"),
)
"""What was refreshed, by the number of Actions."""

MOST_LISTED = 5
"""Targets whose reductions are listed one by one."""


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
        return f"{what}.\n{on}"

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

    @classmethod
    def with_work(cls, targets: Iterable[Transform]) -> Iterable[Transform]:
        return with_modes(targets)

    def execute(self, context: bpy.types.Context) -> set[str]:
        targets = list(with_modes(each_target(context)))

        def clear(refused: list[Refused]) -> str:
            animation.set_mode(targets, "BLENDER", refused=refused)
            return rpt_("Blender's own in-betweens")

        return self.act(targets, clear)


class _OnChanged(OnTargets):
    """Operators on targets whose keys were baked or reduced last, while what they had before is still in the file."""

    kind: ClassVar[str]
    verb: ClassVar[Callable]
    summary: ClassVar[str]

    @classmethod
    def last_changes(cls, targets: Iterable[Transform]) -> dict[Transform, str]:
        """What was done last to the keys of each target that something was done to."""
        found = {}
        for target, entries in entries_of(targets):
            if kind := next((entry.kind for entry in entries if entry.original is not None), None):
                found[target] = kind
        return found

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        targets = list(cls.each_target(context))
        changes = cls.last_changes(targets)
        if cls.kind in changes.values():
            return True
        reason = cls.reason(targets, context)
        for target, later in changes.items():
            if any(entry.kind == cls.kind and entry.original is not None for entry in target.motion.bakes):
                reason = tip_(LATER[later])
        cls.poll_message_set(reason)
        return False

    def execute(self, context: bpy.types.Context) -> set[str]:
        targets = [target for target, kind in self.last_changes(self.each_target(context)).items() if kind == self.kind]

        def go_back(refused: list[Refused]) -> str:
            type(self).verb(targets, refused=refused)
            return rpt_(self.summary)

        return self.act(targets, go_back)


class _OfRigsToo:
    """Operators that act on all keyed bones of a rig where it is selected outside of Pose Mode: an import is."""

    @classmethod
    def each_target(cls, context: bpy.types.Context) -> Iterator[Transform]:
        return with_bones_of_rigs(context, each_target(context))


class RIGID_MOTION_OT_unbake(_OnChanged, bpy.types.Operator):
    bl_idname = "rigid_motion.unbake"
    bl_label = "Un-Bake"
    bl_description = "Give baked objects the Actions back that they had before, with their own keys and modes"
    kind = BAKED
    nothing_to_do = n_("None of these objects is baked")
    verb = staticmethod(animation.unbake)
    summary = n_("back to the keys from before baking")


class RIGID_MOTION_OT_reduce_keys(_OfRigsToo, OnTargets, bpy.types.Operator):
    bl_idname = "rigid_motion.reduce_keys"
    bl_label = "Reduce Keys to Poses"
    bl_description = (
        "Leave only the keys that the motion needs, location and rotation together, in a copy of the Action: "
        "for imported motion capture, baked simulations and solved cameras. Restore Keys gives all of them back"
    )

    nothing_to_do = n_(
        "None of these objects has more than two keys. Constraints, drivers and simulations are turned into keys first "
        "(Object > Animation > Bake Action, with Visual Keying)"
    )

    tolerance: FloatProperty(
        name="Tolerance",
        description=(
            "How far off any point may be on any frame, within the radius around what is moved. Of bones that counts "
            "where they get through all that they hang on. To begin with a millimetre, and of a rig 0.3 % of its size"
        ),
        default=0.001,
        min=1e-6,
        soft_max=1.0,
        step=0.1,
        precision=4,
        subtype="DISTANCE",
    )
    radius: FloatProperty(
        name="Radius",
        description=(
            "How far out from the origin nothing may be off by more: the larger, the more a rotation counts. "
            "At 0 each object has the size of its own bounding box, and each bone its length"
        ),
        default=0.0,
        min=0.0,
        soft_max=10.0,
        step=1.0,
        precision=4,
        subtype="DISTANCE",
        options={"SKIP_SAVE"},
    )
    mode: EnumProperty(
        name="Mode",
        description="What fills in between the keys that are left, and which keys those are",
        items=[item for item in MODE_ITEMS if item[0] != "BLENDER"],
        default="motor_spline",
    )
    best_of: BoolProperty(
        name="Best per Segment",
        description=(
            "Then key each segment with the mode that comes closest to the recording there, within the tolerance. "
            "Where one mode meets another the path may turn a corner"
        ),
    )

    shared: BoolProperty(
        name="Key Poses",
        description="Give all bones of a rig keys on the same frames. Otherwise each has its own: fewer keys in all",
    )
    hold: BoolProperty(
        name="Hold Feet",
        description="Keep bones that stand on the ground to a quarter of the tolerance while they do",
        default=True,
    )

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        targets = list(self.each_target(context))
        rigs = any(target.is_part for target in targets)
        for name in ("tolerance", "radius", "mode", "best_of", *(("shared", "hold") if rigs else ())):
            layout.prop(self, name)
        if rigs:
            self._draw_rigs(context.scene, targets)
            return
        for target in targets[:MOST_LISTED]:
            if (reduction := animation.reduction_of(target)) is not None:
                error = length(context.scene, reduction.largest_error, precision=3)
                became = f"{reduction.before} \N{RIGHTWARDS ARROW} {reduction.after}"
                text = iface_("{keys}, {error} off").format(keys=became, error=error)
                labelled(layout, target.name).label(text=text, translate=False)
                if self.best_of:
                    column = layout.column(align=True)
                    for line in counted_modes(reduction.segments):
                        labelled(column).label(text=line, translate=False)

    def _draw_rigs(self, scene: bpy.types.Scene, targets: list[Transform]) -> None:
        reduction = animation.total_reduction(targets)
        if reduction is None:
            return
        column = self.layout.column(align=True)
        for label, text in reduction_rows(scene, reduction):
            labelled(column, label).label(text=text, translate=False)

    @classmethod
    def with_work(cls, targets: Iterable[Transform]) -> Iterable[Transform]:
        return with_more_keys_than(targets, 2)

    def execute(self, context: bpy.types.Context) -> set[str]:
        targets = list(self.each_target(context))
        if not self.properties.is_property_set("tolerance"):
            self.tolerance = first_tolerance(context.scene, targets)
        if not self.radius and len(targets) == 1:
            self.radius = animation.radius_of(targets[0].carrier)
        return self.act(targets, lambda refused: self._reduce(context.scene, targets, refused))

    def _reduce(self, scene: bpy.types.Scene, targets: list[Transform], refused: list[Refused]) -> str:
        before = [len(target.motion.bakes) for target in targets]
        animation.reduce_keys_of(
            targets,
            self.mode,
            self.tolerance,
            self.radius or None,
            best_of=self.best_of,
            shared=self.shared,
            hold=self.hold,
            refused=refused,
        )
        reduced = [target for target, count in zip(targets, before, strict=True) if len(target.motion.bakes) > count]
        if not reduced:
            return ""
        if len(reduced) > MOST_LISTED or any(target.is_part for target in reduced):
            return reduction_summary(scene, animation.total_reduction(reduced))
        summaries = [reduction_summary(scene, animation.reduction_of(target)) for target in reduced]
        if len(reduced) == len(targets) == 1:
            return summaries[0]
        return "; ".join(f"{target.name}: {summary}" for target, summary in zip(reduced, summaries, strict=True))


class RIGID_MOTION_OT_restore_keys(_OfRigsToo, _OnChanged, bpy.types.Operator):
    bl_idname = "rigid_motion.restore_keys"
    bl_label = "Restore Keys"
    bl_description = "Give reduced objects all the keys back that they had before, to the last handle"
    kind = REDUCED
    nothing_to_do = n_("The keys of these objects are not reduced")
    verb = staticmethod(animation.restore_keys)
    summary = n_("back to the keys from before they were reduced")


class RIGID_MOTION_OT_discard_dense_keys(_OfRigsToo, _OnChanged, bpy.types.Operator):
    bl_idname = "rigid_motion.discard_dense_keys"
    bl_label = "Discard Dense Keys"
    bl_description = (
        "Remove the keys from the file that Restore Keys would give back, once the reduced ones are good. "
        "The reduced keys stay as they are"
    )
    kind = REDUCED
    nothing_to_do = n_("The keys of these objects are not reduced")
    verb = staticmethod(animation.discard_dense_keys)
    summary = n_("the keys from before they were reduced are removed from the file")


class RIGID_MOTION_OT_mend(OnTargets, bpy.types.Operator):
    bl_idname = "rigid_motion.mend"
    bl_label = "Restore Constraint"
    bl_description = (
        'Put the constraint "Rigid Motion" back on the selected bones, which shows their in-betweens: '
        "first in the stack, unmuted, with full influence"
    )
    nothing_to_do = n_("None of these objects lacks its constraint")

    @classmethod
    def with_work(cls, targets: Iterable[Transform]) -> Iterable[Transform]:
        return with_troubles(targets)

    def execute(self, context: bpy.types.Context) -> set[str]:
        targets = list(with_troubles(each_target(context)))

        def restore(refused: list[Refused]) -> str:
            animation.restore_constraints(targets, refused=refused)
            return rpt_("constraint restored")

        return self.act(targets, restore)


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
    RIGID_MOTION_OT_reduce_keys,
    RIGID_MOTION_OT_restore_keys,
    RIGID_MOTION_OT_discard_dense_keys,
    RIGID_MOTION_OT_mend,
    RIGID_MOTION_OT_refresh,
)
