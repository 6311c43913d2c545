"""Breakdown, Push and Relax: operators that key poses along the path of the mode, by a slider.

They work like Blender's own operators for poses. Moving the mouse changes the factor, which the header shows. As in
Blender's Breakdowner, Shift is fine, Ctrl steps by a tenth, E allows overshoot, and digits set the factor in per cent.
"""

from __future__ import annotations

from typing import ClassVar

import bpy
from bpy.app.translations import pgettext_iface as iface_
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_

from .. import animation
from ..animation import Refused
from ..animation.edits.breakdowns import BREAKDOWN, PUSH, RELAX
from ..animation.queries.polls import with_modes
from ..animation.transforms import OWN_WORDS, Transform
from ..blender import FloatProperty, Returned, existing, with_properties
from .mouse_input import CANCEL, CONFIRM, MouseInput
from .targets import OnTargets, targets_of

MOUSE_TRAVEL_PX = 300.0
"""The distance of the mouse from factor 0 to 1, in pixels at a resolution scale of 1."""

CTRL_STEP = 0.1
"""The step of the factor while Ctrl is held."""


class Slider(MouseInput):
    """A factor that mouse and keyboard change. Typed numbers are per cent.

    Parameters
    ----------
    factor : float
        The initial factor.
    x : float
        The position of the mouse, in pixels.
    scale : float
        The resolution scale of the interface.
    """

    def __init__(self, factor: float, x: float, scale: float) -> None:
        super().__init__()
        self.overshoots = False
        """True if the factor may be below 0 and above 1."""
        self._dragged, self._x, self._travel = factor, x, MOUSE_TRAVEL_PX * scale

    @property
    def factor(self) -> float:
        if self.number is not None:
            return self.number / 100.0
        factor = self._clamped(self._dragged)
        return round(factor / CTRL_STEP) * CTRL_STEP if self.is_stepped else factor

    def _clamped(self, factor: float) -> float:
        return factor if self.overshoots else min(max(factor, 0.0), 1.0)

    def move(self, event: bpy.types.Event, ratio: float) -> None:
        # Clamped here, so a mouse that turns back beyond an end changes the factor at once.
        self._dragged = self._clamped(self._dragged + ratio * (event.mouse_x - self._x) / self._travel)
        self._x = event.mouse_x

    def press(self, key: str) -> bool:
        self.overshoots ^= key == "E"
        return key == "E"

    def show_status(self, context: bpy.types.Context, label: str) -> None:
        """Show the factor in the header of the area, and the keys in the status bar."""
        overshoot = iface_("On") if self.overshoots else iface_("Off")
        keys = iface_(
            "LMB, Enter: Confirm | Esc, RMB: Cancel | E: Overshoot ({overshoot}) | Ctrl: Steps of 10 % | "
            "Shift: Precision | 0-9: Per Cent"
        ).format(overshoot=overshoot)
        existing(context.area).header_text_set(f"{label} {self._factor_text}")
        existing(context.workspace).status_text_set(keys)

    def hide(self, context: bpy.types.Context) -> None:
        """Restore the header and the status bar."""
        existing(context.workspace).status_text_set(None)
        existing(context.area).header_text_set(None)

    @property
    def _factor_text(self) -> str:
        return f"{self.typed} %" if self.typed else f"{100.0 * self.factor:.0f} %"


@with_properties
class _Breakdown(OnTargets):
    """Operators that key a pose by a factor, which the mouse sets where they are invoked."""

    bl_options = {"REGISTER", "UNDO", "BLOCKING", "GRAB_CURSOR_X"}  # noqa: RUF012 - Blender reads it
    nothing_to_do = n_(
        "All keys have Blender's own in-betweens: choose a mode first, or use Blender's Pose > In-Betweens"
    )
    with_work = staticmethod(with_modes)
    kind: ClassVar[str]
    short: ClassVar[str]

    factor: float = FloatProperty(
        name="Factor",
        description="How far to go: 0 is the beginning, 1 the end; the motion continues beyond",
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

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> Returned:
        if context.area is None:
            return self.execute(context)
        self._targets = targets_of(context)
        self._refused: list[Refused] = []
        self._breakdowns = animation.Breakdowns(self._targets, self.kind, refused=self._refused)
        if not self._breakdowns:
            return self._finish()
        self._slider = Slider(self.factor, event.mouse_x, existing(context.preferences).system.ui_scale)
        self._breakdowns.apply(self.factor)
        self._slider.show_status(context, iface_(self.short, OWN_WORDS))
        existing(context.window_manager).modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> Returned:
        if event.type in CANCEL and event.value == "PRESS":
            self.cancel(context)
            return {"CANCELLED"}
        if event.type in CONFIRM and event.value == "PRESS":
            self._slider.hide(context)
            return self._finish()
        if self._slider.handle(event) and self._slider.factor != self.factor:
            self.factor = self._slider.factor
            self._breakdowns.apply(self.factor)
        self._slider.show_status(context, iface_(self.short, OWN_WORDS))
        return {"RUNNING_MODAL"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Undo the breakdowns. Blender calls this too when it ends the operator."""
        self._slider.hide(context)
        self._breakdowns.cancel()

    def _finish(self) -> Returned:
        def keyed(refused: list[Refused]) -> str:
            refused.extend(self._refused)
            return self._summary()

        return self.act(self._targets, keyed)

    def _summary(self) -> str:
        return rpt_("{action} by {factor:.0f} %").format(
            action=iface_(self.short, OWN_WORDS), factor=100.0 * self.factor
        )


@with_properties
class RIGID_MOTION_OT_breakdown(_Breakdown):
    bl_idname = "rigid_motion.breakdown"
    bl_label = "Breakdown along Mode"
    bl_description = "Key a pose on the current frame between the previous and the next key, on the path of the mode"
    kind = BREAKDOWN
    short = n_("Breakdown", OWN_WORDS)


@with_properties
class RIGID_MOTION_OT_push(_Breakdown):
    bl_idname = "rigid_motion.push"
    bl_label = "Push from In-Between of Mode"
    bl_description = "Key a more pronounced pose on the current frame: further from the in-between of the mode"
    kind = PUSH
    short = n_("Push", OWN_WORDS)


@with_properties
class RIGID_MOTION_OT_relax(_Breakdown):
    bl_idname = "rigid_motion.relax"
    bl_label = "Relax to In-Between of Mode"
    bl_description = "Key a pose on the current frame that is more like its neighbours: closer to the mode's in-between"
    kind = RELAX
    short = n_("Relax", OWN_WORDS)
