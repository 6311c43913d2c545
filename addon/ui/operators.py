"""What can be done to the motion of objects. Every operator does what it can, and names the objects that refuse.

An operator that every object refused has changed nothing: it is cancelled, without an undo step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import ClassVar

import bpy
from bpy.props import EnumProperty, FloatProperty

from .. import animation
from ..animation import Refused
from ..animation.properties import MODE_ITEMS
from .preferences import DEFAULT_MODE, default_mode
from .targets import SCOPES, SELECTED, WHOLE, frames_meant, objects_for, scope_for
from .wording import DESCRIPTIONS, LABELS, listed

SCOPE_NAMES = {scope: label for scope, label, _ in SCOPES}


class _OnObjects:
    """Operators on the selected objects, or on those that the editor shows."""

    bl_options: ClassVar[set[str]] = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if objects_for(context):
            return True
        cls.poll_message_set("Select an object with keys first")
        return False

    def act(self, objects: Sequence[bpy.types.Object], on_one: Callable[[bpy.types.Object], str]) -> set[str]:
        """Do something to each object, and say what.

        Parameters
        ----------
        objects
        on_one
            Does it to one, and returns in words what was done. May raise `Refused`.
        """
        done: dict[str, list[str]] = {}
        refusals = []
        for obj in objects:
            try:
                done.setdefault(on_one(obj), []).append(obj.name)
            except Refused as refusal:
                refusals.append(str(refusal))
        said = "; ".join(f"{listed(names)}: {what}" for what, names in done.items())
        if not done:
            self.report({"ERROR"}, "\n".join(refusals))
            return {"CANCELLED"}
        if refusals:
            self.report({"WARNING"}, "\n".join([f"{said}. But", *refusals]))
        else:
            self.report({"INFO"}, said)
        return {"FINISHED"}


class RIGID_MOTION_OT_set_mode(_OnObjects, bpy.types.Operator):
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
        name="On",
        description="What of each object gets the mode",
        items=SCOPES,
        default=WHOLE,
        options={"SKIP_SAVE"},
    )

    @classmethod
    def description(cls, _context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        if not properties.is_property_set("mode"):
            return cls.bl_description
        return f"{DESCRIPTIONS[properties.mode]}.\nOn: {SCOPE_NAMES[properties.on]}"

    def execute(self, context: bpy.types.Context) -> set[str]:
        if not self.properties.is_property_set("mode"):
            self.mode = default_mode()
        if not self.properties.is_property_set("on"):
            self.on = scope_for(context)
        objects = objects_for(context)
        if self.on == SELECTED:
            objects = [obj for obj in objects if len(animation.key_frames(obj, selected=True))]
            if not objects:
                self.report({"ERROR"}, "Select keys of location, rotation or scale first")
                return {"CANCELLED"}
        return self.act(objects, lambda obj: self._set(context, obj))

    def _set(self, context: bpy.types.Context, obj: bpy.types.Object) -> str:
        frames = frames_meant(context, obj, self.on)
        animation.set_mode(obj, self.mode, frames)
        label = LABELS[self.mode]
        return label if frames is None else f"{label} from frame {listed([f'{frame:g}' for frame in frames])}"


class RIGID_MOTION_OT_clear(_OnObjects, bpy.types.Operator):
    bl_idname = "rigid_motion.clear"
    bl_label = "Clear Modes"
    bl_description = (
        "Give the objects Blender's own in-betweens again, and remove the keys of their modes. "
        "Keys of location, rotation and scale stay"
    )

    def execute(self, context: bpy.types.Context) -> set[str]:
        return self.act(objects_for(context), self._clear)

    @staticmethod
    def _clear(obj: bpy.types.Object) -> str:
        animation.set_mode(obj, "BLENDER")
        return "Blender's own in-betweens"


class RIGID_MOTION_OT_bake(_OnObjects, bpy.types.Operator):
    bl_idname = "rigid_motion.bake"
    bl_label = "Bake to Keys"
    bl_description = (
        "Put the in-betweens on location, rotation and scale as real keys of type Generated, in a copy of the Action, "
        "for hand-over to programs that read keys only. Un-Bake gives the original back"
    )

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
    frames: EnumProperty(
        name="Frames",
        description="What to bake, widened to whole segments",
        items=[
            ("ACTION", "Action", "From the first key of each object to its last"),
            ("SCENE", "Scene", "The frame range of the scene, or its preview range while that is in use"),
            ("CUSTOM", "Custom", "From one frame to another"),
        ],
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
        layout.row().prop(self, "frames", expand=True)
        if self.frames == "CUSTOM":
            column = layout.column(align=True)
            column.prop(self, "first")
            column.prop(self, "last")

    def execute(self, context: bpy.types.Context) -> set[str]:
        if self.frames == "ACTION":
            first = last = None
        else:
            first, last = _range_of(context.scene) if self.frames == "SCENE" else (self.first, self.last)
            if first > last:
                self.report({"ERROR"}, f"The range to bake ends on frame {last:g}, before its start, {first:g}")
                return {"CANCELLED"}
        return self.act(objects_for(context), lambda obj: self._bake(obj, first, last))

    def _bake(self, obj: bpy.types.Object, first: float | None, last: float | None) -> str:
        first, last = animation.bake(obj, step=self.step, first=first, last=last)
        return f"baked from frame {first:g} to {last:g}"


def _range_of(scene: bpy.types.Scene) -> tuple[int, int]:
    if scene.use_preview_range:
        return scene.frame_preview_start, scene.frame_preview_end
    return scene.frame_start, scene.frame_end


class RIGID_MOTION_OT_unbake(_OnObjects, bpy.types.Operator):
    bl_idname = "rigid_motion.unbake"
    bl_label = "Un-Bake"
    bl_description = "Give baked objects the Actions back that they had before, with their own keys and modes"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if any(len(obj.rigid_motion.bakes) for obj in objects_for(context)):
            return True
        cls.poll_message_set("None of these objects is baked")
        return False

    def execute(self, context: bpy.types.Context) -> set[str]:
        return self.act([obj for obj in objects_for(context) if len(obj.rigid_motion.bakes)], self._unbake)

    @staticmethod
    def _unbake(obj: bpy.types.Object) -> str:
        animation.unbake(obj)
        return "back to the keys from before baking"


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
        self.report(
            {"INFO"}, f"In-betweens of {stale} Action{'s' * (stale != 1)} refreshed" if stale else "All up to date"
        )
        return {"FINISHED"}


CLASSES = (
    RIGID_MOTION_OT_set_mode,
    RIGID_MOTION_OT_clear,
    RIGID_MOTION_OT_bake,
    RIGID_MOTION_OT_unbake,
    RIGID_MOTION_OT_refresh,
)
