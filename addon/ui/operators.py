"""What can be done to the motion of objects. Every operator does what it can, and names the objects that refuse.

An operator that every object refused has changed nothing: it is cancelled, without an undo step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import ClassVar

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty

from .. import animation
from ..animation import Refused
from ..animation.originals import BAKED, REDUCED
from ..animation.properties import MODE_ITEMS
from ..animation.reducing import metres_per_unit
from .preferences import DEFAULT_MODE, default_mode
from .rows import labelled
from .targets import SCOPES, SELECTED, WHOLE, frames_meant, objects_for, scope_for
from .wording import DESCRIPTIONS, LABELS, counted_modes, length, listed, reduction_told

SCOPE_NAMES = {scope: label for scope, label, _ in SCOPES}

MOST_TOLD = 5
"""Objects that the redo panel tells of."""


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
        if frames is None:
            return label
        return f"{label} from frame{'s' * (len(frames) > 1)} {listed([f'{frame:g}' for frame in frames])}"


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


class _OnChanged(_OnObjects):
    """Operators on objects whose keys were baked or reduced, while what they had before is still in the file."""

    kind: ClassVar[str]
    missing: ClassVar[str]
    """Why there is nothing to do."""

    @classmethod
    def objects_of(cls, context: bpy.types.Context) -> list[bpy.types.Object]:
        return [
            obj
            for obj in objects_for(context)
            if any(note.kind == cls.kind and note.original is not None for note in obj.rigid_motion.bakes)
        ]

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if cls.objects_of(context):
            return True
        cls.poll_message_set(cls.missing)
        return False

    def execute(self, context: bpy.types.Context) -> set[str]:
        return self.act(self.objects_of(context), self.on_one)


class RIGID_MOTION_OT_unbake(_OnChanged, bpy.types.Operator):
    bl_idname = "rigid_motion.unbake"
    bl_label = "Un-Bake"
    bl_description = "Give baked objects the Actions back that they had before, with their own keys and modes"
    kind = BAKED
    missing = "None of these objects is baked"

    @staticmethod
    def on_one(obj: bpy.types.Object) -> str:
        animation.unbake(obj)
        return "back to the keys from before baking"


class RIGID_MOTION_OT_reduce_keys(_OnObjects, bpy.types.Operator):
    bl_idname = "rigid_motion.reduce_keys"
    bl_label = "Reduce Keys to Poses"
    bl_description = (
        "Leave only the keys that the motion needs, location and rotation together, in a copy of the Action: "
        "for imported motion capture, baked simulations and solved cameras. Restore Keys gives all of them back"
    )

    tolerance: FloatProperty(
        name="Tolerance",
        description=(
            "How far off any of three points of the object may be on any frame, at the radius from its origin along "
            "its axes. A millimetre to begin with"
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
            "How far out the object is held to the tolerance: the larger, the more a rotation counts. "
            "At 0 each object has the size of its own bounding box"
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
            "Where one mode meets another the object may turn a corner"
        ),
    )

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        for name in ("tolerance", "radius", "mode", "best_of"):
            layout.prop(self, name)
        for obj in objects_for(context)[:MOST_TOLD]:
            if (reduction := animation.reduction_of(obj)) is not None:
                error = length(context.scene, reduction.largest_error, precision=3)
                labelled(layout, obj.name).label(
                    text=f"{reduction.before} \N{RIGHTWARDS ARROW} {reduction.after}, {error} off"
                )
                if self.best_of:
                    column = layout.column(align=True)
                    for line in counted_modes(reduction.segments):
                        labelled(column).label(text=line)

    def execute(self, context: bpy.types.Context) -> set[str]:
        objects = objects_for(context)
        if not self.properties.is_property_set("tolerance"):
            self.tolerance = 0.001 / metres_per_unit(context.scene)
        if not self.radius and len(objects) == 1:
            self.radius = animation.radius_of(objects[0])
        return self.act(objects, lambda obj: self._reduce(context.scene, obj))

    def _reduce(self, scene: bpy.types.Scene, obj: bpy.types.Object) -> str:
        reduction = animation.reduce_keys_of(obj, self.mode, self.tolerance, self.radius or None, best_of=self.best_of)
        return reduction_told(scene, reduction)


class RIGID_MOTION_OT_restore_keys(_OnChanged, bpy.types.Operator):
    bl_idname = "rigid_motion.restore_keys"
    bl_label = "Restore Keys"
    bl_description = "Give reduced objects all the keys back that they had before, to the last handle"
    kind = REDUCED
    missing = "The keys of these objects are not reduced"

    @staticmethod
    def on_one(obj: bpy.types.Object) -> str:
        animation.restore_keys(obj)
        return "back to the keys from before they were reduced"


class RIGID_MOTION_OT_let_keys_go(_OnChanged, bpy.types.Operator):
    bl_idname = "rigid_motion.let_keys_go"
    bl_label = "Let Dense Keys Go"
    bl_description = (
        "Remove the keys from the file that Restore Keys would give back, once the reduced ones are good. "
        "The reduced keys stay as they are"
    )
    kind = REDUCED
    missing = "The keys of these objects are not reduced"

    @staticmethod
    def on_one(obj: bpy.types.Object) -> str:
        animation.discard_dense_keys(obj)
        return "the keys from before they were reduced are gone"


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
    RIGID_MOTION_OT_reduce_keys,
    RIGID_MOTION_OT_restore_keys,
    RIGID_MOTION_OT_let_keys_go,
    RIGID_MOTION_OT_refresh,
)
