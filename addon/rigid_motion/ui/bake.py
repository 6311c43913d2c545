"""Baking, with the dialog that asks how."""

from __future__ import annotations

import bpy
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_
from bpy.props import EnumProperty, FloatProperty

from .. import animation
from ..animation import Refused
from ..animation.properties import OWN_WORDS
from ..animation.queries.polls import with_in_betweens
from ..animation.transforms import Transform
from .on_targets import OnTargets


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
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
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
