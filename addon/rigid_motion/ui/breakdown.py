"""Breakdown, Push and Relax along the mode: Blender's own three for poses, which follow the path of the body."""

from __future__ import annotations

from typing import ClassVar

import bpy
from bpy.app.translations import pgettext_iface as iface_
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_
from bpy.props import FloatProperty

from .. import animation
from ..animation import Refused
from ..animation.edits.breakdowns import BREAKDOWN, PUSH, RELAX
from ..animation.queries.polls import with_modes
from ..animation.transforms import OWN_WORDS, Transform
from .on_targets import OnTargets
from .slider import Slider
from .targets import targets_of

CONFIRM, CANCEL = {"LEFTMOUSE", "RET", "NUMPAD_ENTER"}, {"RIGHTMOUSE", "ESC"}


class _Breakdown(OnTargets):
    """Operators that key a pose by a factor, which the mouse sets where they are invoked."""

    bl_options: ClassVar[set[str]] = {"REGISTER", "UNDO", "BLOCKING", "GRAB_CURSOR_X"}
    nothing_to_do = n_(
        "These objects have Blender's own in-betweens: choose a mode first, or take Blender's Pose > In-Betweens"
    )
    with_work = staticmethod(with_modes)
    kind: ClassVar[str]
    short: ClassVar[str]

    factor: FloatProperty(
        name="Factor",
        description="How far to go: 0 is the beginning, 1 the end, and beyond that the motion goes on",
        default=0.5,
        soft_min=0.0,
        soft_max=1.0,
        step=1,
        precision=3,
        subtype="FACTOR",
        options={"SKIP_SAVE"},
    )

    def do(self, _context: bpy.types.Context, targets: list[Transform], refused: list[Refused]) -> str:
        animation.breakdown(targets, self.factor, self.kind, refused=refused)
        return self._summary()

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if context.area is None:
            return self.execute(context)
        self._targets, self._refused = targets_of(context), []
        self._breakdowns = animation.Breakdowns(self._targets, self.kind, refused=self._refused)
        if not self._breakdowns:
            return self._finish()
        self._slider = Slider(self.factor, event.mouse_x, context.preferences.system.ui_scale)
        self._breakdowns.apply(self.factor)
        self._slider.show(context, iface_(self.short, OWN_WORDS))
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type in CANCEL and event.value == "PRESS":
            self.cancel(context)
            return {"CANCELLED"}
        if event.type in CONFIRM and event.value == "PRESS":
            self._slider.hide(context)
            return self._finish()
        if self._slider.handle(event) and self._slider.factor != self.factor:
            self.factor = self._slider.factor
            self._breakdowns.apply(self.factor)
        self._slider.tell(context)
        return {"RUNNING_MODAL"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Undo the breakdowns. Blender calls it, too, where it ends the operator by itself."""
        self._slider.hide(context)
        self._breakdowns.cancel()

    def _finish(self) -> set[str]:
        def keyed(refused: list[Refused]) -> str:
            refused.extend(self._refused)
            return self._summary()

        return self.act(self._targets, keyed)

    def _summary(self) -> str:
        return rpt_("{action} by {factor:.0f} %").format(
            action=iface_(self.short, OWN_WORDS), factor=100.0 * self.factor
        )


class RIGID_MOTION_OT_breakdown(_Breakdown, bpy.types.Operator):
    bl_idname = "rigid_motion.breakdown"
    bl_label = "Breakdown along Mode"
    bl_description = (
        "Key a pose on the current frame that is between the key before and the key after it, on the path of the mode"
    )
    kind = BREAKDOWN
    short = n_("Breakdown", OWN_WORDS)


class RIGID_MOTION_OT_push(_Breakdown, bpy.types.Operator):
    bl_idname = "rigid_motion.push"
    bl_label = "Push from In-Between of Mode"
    bl_description = "Key a more pronounced pose on the current frame: further away from the in-between of the mode"
    kind = PUSH
    short = n_("Push", OWN_WORDS)


class RIGID_MOTION_OT_relax(_Breakdown, bpy.types.Operator):
    bl_idname = "rigid_motion.relax"
    bl_label = "Relax to In-Between of Mode"
    bl_description = "Key a pose on the current frame that is more like its neighbours: nearer to the mode's in-between"
    kind = RELAX
    short = n_("Relax", OWN_WORDS)


CLASSES = (RIGID_MOTION_OT_breakdown, RIGID_MOTION_OT_push, RIGID_MOTION_OT_relax)
