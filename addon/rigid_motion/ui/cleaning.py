"""*Clean Motion*: an operator that removes jitter from dense keys, by a slider, and shows the motion from before."""

from __future__ import annotations

from functools import partial
from typing import Any, cast

import bpy
from bpy.app.translations import pgettext_iface as iface_
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_

from .. import animation
from ..animation import Cleaning, Refused
from ..animation.baking.cleaning import MAX_MOVE_PER_NOISE, MIN_NOISE_KEYS, focus_of, pixels_of
from ..animation.queries.polls import with_more_keys_than
from ..animation.transforms import Transform
from ..blender import BoolProperty, FloatProperty, StringProperty, with_properties
from .overlay import cleaned
from .reducing import OfRigsToo, radius_property
from .targets import OnTargets, is_key_editor
from .wording import length, split

MIN_UNTOUCHED_RATIO = 0.25
"""The report mentions unchanged keys above this fraction of all keys."""


@with_properties
class RIGID_MOTION_OT_clean_motion(OfRigsToo, OnTargets):
    bl_idname = "rigid_motion.clean_motion"
    bl_label = "Clean Motion"
    bl_description = (
        "Remove jitter and spikes from keys on every frame, as of motion capture, trackers and solved cameras, and "
        "keep hits. Only spikes move by more than Strength times the jitter. Restore Keys brings the original keys "
        "back"
    )
    nothing_to_do = n_("Nothing here has a key on every frame, like a recording or a solved camera")
    with_work = staticmethod(partial(with_more_keys_than, count=MIN_NOISE_KEYS - 1))

    strength: float = FloatProperty(
        name="Strength",
        description="How far anything may move at most, in multiples of its jitter. Spikes move as far as necessary",
        default=MAX_MOVE_PER_NOISE,
        min=0.01,
        soft_max=5.0,
        step=10,
        options={"SKIP_SAVE"},
    )
    radius: float = radius_property()
    nearest: float = FloatProperty(
        name="Nearest",
        description="The distance of the nearest thing that a camera looks at. At 0 it is the focus distance",
        min=0.0,
        soft_max=100.0,
        subtype="DISTANCE",
    )
    selected: bool = BoolProperty(
        name="Selected Keys",
        description="Clean only from the first to the last selected key, and join the rest",
        options={"SKIP_SAVE"},
    )
    select_spikes: bool = BoolProperty(
        name="Select Spikes",
        description="Select the keys that were spikes, or repeated the one before, if there are any",
        default=True,
    )
    said: str = StringProperty(description="What became of the keys", options={"HIDDEN", "SKIP_SAVE"})

    def draw(self, context: bpy.types.Context) -> None:
        layout = split(self.layout)
        cameras = {getattr(target.carrier, "type", "") == "CAMERA" for target in self.each_target(context)}
        layout.prop(self, "strength", slider=True)
        for name in (
            ("radius",) * (cameras != {True}) + ("nearest",) * (True in cameras) + ("selected", "select_spikes")
        ):
            layout.prop(self, name)
        column = layout.column(align=True)
        for line in self.said.split("; "):
            column.label(text=line, translate=False)

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> Any:
        self.selected = is_key_editor(context)
        return self.execute(context)

    def do(self, context: bpy.types.Context, targets: list[Transform], refused: list[Refused]) -> str:
        cleanings = animation.clean_motion(
            targets,
            self.strength,
            self.radius or None,
            nearest=self.nearest or None,
            selected=self.selected,
            select_spikes=self.select_spikes,
            refused=refused,
        )
        cleaned.show(cleanings)
        self.said = self._summary(context, cleanings) if cleanings else ""
        return self.said

    def _summary(self, context: bpy.types.Context, cleanings: list[Cleaning]) -> str:
        """Return a summary of all cleanings, with lengths, or with pixels if all of them are cameras."""
        cameras: list[Any] = [one.transforms[0].carrier for one in cleanings]
        spoken = partial(length, cast(bpy.types.Scene, context.scene), precision=3)
        spans = [(one.jitter, one.moved) for one in cleanings]
        if all(isinstance(camera, bpy.types.Object) and camera.type == "CAMERA" for camera in cameras):
            by = [pixels_of(camera, self.nearest or focus_of(camera)) for camera in cameras]
            most = [
                max(one * pixels for one, pixels in zip(ends, by, strict=True)) for ends in zip(*spans, strict=True)
            ]
            jitter, moved = (iface_("{count:.2g} pixels").format(count=pixels) for pixels in most)
        else:
            jitter, moved = (spoken(max(ends)) for ends in zip(*spans, strict=True))
        parts = [
            rpt_("jitters by {length}").format(length=jitter),
            rpt_("moved at most {length}").format(length=moved),
        ]
        spikes, repeats = sum(one.spikes for one in cleanings), sum(one.repeats for one in cleanings)
        if spikes:
            text = n_("{count} keys were spikes") if spikes > 1 else n_("{count} key was a spike")
            parts.append(rpt_(text).format(count=spikes))
        if repeats:
            parts.append(rpt_("repeated keys: {count}").format(count=repeats))
        if rigs := [one.contacts for one in cleanings if one.contacts]:
            counts, *slides = zip(*rigs, strict=True)
            now, before = (spoken(max(ends)) for ends in slides)
            text = n_("contacts held: {count}, feet slide by {now} there, before by {before}")
            text = text if any(counts) else n_("no foot clearly stands: none is held")
            parts.append(rpt_(text).format(count=sum(counts), now=now, before=before))
        if (alone := max(one.alone for one in cleanings)) > MIN_UNTOUCHED_RATIO:
            text = rpt_(
                "{percent:.0f} % of the keys stay nearly unchanged: noise cannot be distinguished from motion there"
            )
            parts.append(text.format(percent=100.0 * alone))
        return "; ".join(parts)
