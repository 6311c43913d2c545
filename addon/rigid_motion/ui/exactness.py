"""How exact things are between frames, and the switch for objects."""

from __future__ import annotations

import bpy
from bpy.app.translations import pgettext_iface as iface_
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_
from bpy.props import BoolProperty

from .. import animation
from ..animation.transforms import OWN_WORDS, Refused, Transform
from ..animation.transforms.reaches import metres_per_unit
from .on_targets import OnTargets
from .rows import labelled
from .wording import length

PROMISED = 0.0001
"""The largest error between frames of what is to be exact there, in metres."""

WORTH_OFFERING = 0.001
"""From which error on, in metres, an object is offered to be exact."""


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


def draw(context: bpy.types.Context, layout: bpy.types.UILayout, target: Transform) -> None:
    """Draw how far off a target is between frames, where that is more than there should be, and what to do about it."""
    error, is_exact = animation.error_between_frames(target), target.has_difference_slot
    is_off = error > (PROMISED if is_exact else WORTH_OFFERING)
    if not is_off and (target.is_part or not is_exact):
        return
    scene = context.scene
    text = iface_("Exact")
    if is_off:
        text = iface_("{distance} off").format(distance=length(scene, error / metres_per_unit(scene), precision=2))
    row = labelled(layout, iface_("Subframes", OWN_WORDS))
    if target.is_part:
        row.label(text=text, translate=False)
    else:
        row.operator("rigid_motion.exact", text=text, translate=False, depress=is_exact).is_exact = not is_exact


CLASSES = (RIGID_MOTION_OT_exact,)
