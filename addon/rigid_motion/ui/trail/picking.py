"""Operators that select keys on paths, insert one where a path is clicked, and delete keys."""

from __future__ import annotations

from typing import Any

import bpy
import gpu
import numpy as np
from bpy.app.translations import pgettext_n as n_
from mathutils import Vector

from ...animation import Refused
from ...animation.edits.path_keys import delete_keys, insert_key
from ...animation.evaluation.marks import near
from ...animation.holds.placing import world_matrix
from ...animation.transforms import Transform, transform_of
from ...blender import BoolProperty, EnumProperty, FloatProperty, Returned, StringProperty, existing, with_properties
from ..mouse_input import CANCEL
from ..overlay.drawing import batch_of
from ..targets import selected
from .arms import tangent_under
from .handles import REACH_PX, Handles, OnPath, handles_of, key_under, select

BOX_COLOUR = (0.8, 0.8, 0.8, 0.7)

KEY_THERE = n_("{name} already has a key on frame {frame:g}")


def mouse_of(event: bpy.types.Event) -> np.ndarray:
    """Return the position of the mouse in the region, (2,)."""
    return np.array((event.mouse_region_x, event.mouse_region_y), float)


def pressed_at(event: bpy.types.Event) -> np.ndarray:
    """Return the position in the region where the mouse button was pressed for a drag, (2,)."""
    moved = event.mouse_x - event.mouse_prev_press_x, event.mouse_y - event.mouse_prev_press_y
    return mouse_of(event) - moved


@with_properties
class _Selecting(OnPath):
    extend: bool = BoolProperty(description="Keep what is selected already", options={"SKIP_SAVE", "HIDDEN"})

    def choose(self, context: bpy.types.Context, handles: list[Handles], chosen: dict[Transform, np.ndarray]) -> None:
        """Select keys on these frames; with Extend, keep the selection, too."""
        if self.extend:
            chosen = {one.target: np.union1d(chosen.get(one.target, ()), one.selected) for one in handles}
        select(context, handles, chosen)


@with_properties
class RIGID_MOTION_OT_select_path_keys(_Selecting):
    bl_idname = "rigid_motion.select_path_keys"
    bl_label = "Select Key on Path"
    bl_description = "Select the key on a path under the mouse"

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> Returned:
        handles = handles_of(context)
        hit = key_under(context, handles, mouse_of(event))
        if hit is None:
            return {"PASS_THROUGH", "CANCELLED"}
        one, frame = hit
        if self.extend and frame in one.selected:
            select(context, [one], {one.target: one.selected[one.selected != frame]})
        else:
            self.choose(context, handles, {one.target: np.array([frame])})
        return {"FINISHED"}


@with_properties
class RIGID_MOTION_OT_select_all_path_keys(OnPath):
    bl_idname = "rigid_motion.select_all_path_keys"
    bl_label = "Select All Keys on Paths"
    bl_description = "Select all keys on the visible paths, or none"

    deselect: bool = BoolProperty(description="Select none", options={"SKIP_SAVE", "HIDDEN"})

    def execute(self, context: bpy.types.Context) -> Returned:
        handles = handles_of(context)
        if not handles:
            return {"PASS_THROUGH", "CANCELLED"}
        select(context, handles, {one.target: one.path.key_frames for one in handles if not self.deselect})
        return {"FINISHED"}


@with_properties
class RIGID_MOTION_OT_box_path_keys(_Selecting):
    bl_idname = "rigid_motion.box_path_keys"
    bl_label = "Box Select Keys on Paths"
    bl_description = "Select the keys on paths in a box"
    bl_options = {"REGISTER", "UNDO", "BLOCKING"}  # noqa: RUF012 - Blender reads it

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> Returned:
        handles, is_drag = handles_of(context), event.value == "CLICK_DRAG"
        self._first = pressed_at(event) if is_drag else None
        # A drag on a key or tangent is for other operators, in whatever order Blender asks them.
        takes = () if not is_drag or self.extend else (key_under, tangent_under)
        if not handles or any(take(context, handles, pressed_at(event)) for take in takes):
            return {"PASS_THROUGH", "CANCELLED"}
        self._last, self._region = mouse_of(event), context.region
        self._drawing = bpy.types.SpaceView3D.draw_handler_add(self._draw, (), "WINDOW", "POST_PIXEL")
        existing(context.window_manager).modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> Returned:
        self._last = mouse_of(event)
        existing(context.area).tag_redraw()
        if event.type == "LEFTMOUSE" and event.value == "PRESS":
            self._first = self._last
        elif event.type == "LEFTMOUSE" and event.value == "RELEASE" and self._first is not None:
            self.cancel(context)
            low, high = np.minimum(self._first, self._last), np.maximum(self._first, self._last)
            handles, chosen = handles_of(context), {}
            for one in handles:
                places = one.at_keys(context)
                chosen[one.target] = one.path.key_frames[((low <= places) & (places <= high)).all(axis=1)]
            self.choose(context, handles, chosen)
            return {"FINISHED"}
        elif event.type in CANCEL and event.value == "PRESS":
            self.cancel(context)
            return {"CANCELLED"}
        return {"RUNNING_MODAL"}

    def cancel(self, _context: bpy.types.Context) -> None:
        """Stop drawing the box."""
        bpy.types.SpaceView3D.draw_handler_remove(self._drawing, "WINDOW")

    def _draw(self) -> None:
        if self._first is None or bpy.context.region != self._region:
            return
        (left, bottom), (right, top) = self._first, self._last
        corners = [(left, bottom, 0), (right, bottom, 0), (right, top, 0), (left, top, 0), (left, bottom, 0)]
        shader: Any = gpu.shader.from_builtin("UNIFORM_COLOR")
        shader.uniform_float("color", BOX_COLOUR)
        existing(batch_of("LINE_STRIP", np.array(corners))).draw(shader)


@with_properties
class RIGID_MOTION_OT_insert_path_key(OnPath):
    bl_idname = "rigid_motion.insert_path_key"
    bl_label = "Insert Key on Path"
    bl_description = "Key the visible pose where you click on a path. The motion does not change"

    target: str = StringProperty(
        description="The object or bone that gets the key; all with a path where it is empty",
        options={"SKIP_SAVE", "HIDDEN"},
    )
    frame: float = FloatProperty(name="Frame", description="The frame that gets the key")

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> Returned:
        moments = [(*one.nearest_moment(context, mouse_of(event)), one.target.name) for one in handles_of(context)]
        distance, frame, self.target = min(moments, default=(np.inf, 0.0, ""))
        if distance > REACH_PX * existing(context.preferences).system.ui_scale:
            return {"PASS_THROUGH", "CANCELLED"}
        self.frame = float(round(frame))
        return self.execute(context)

    def execute(self, context: bpy.types.Context) -> Returned:
        handles, refused, at = handles_of(context), list[Refused](), np.array([self.frame])
        chosen = [one for one in handles if self.target in ("", one.target.name)]
        for one in chosen:
            try:
                if near(at, one.path.key_frames).any():
                    raise Refused(KEY_THERE, name=one.target.name, frame=self.frame)
                insert_key(one.target, self.frame)
            except Refused as refusal:
                refused.append(refusal)
        if len(refused) == len(chosen):
            return self.without_keys(handles, refused)
        select(context, handles, {one.target: at for one in chosen})
        return self.finish(refused)


class RIGID_MOTION_OT_delete_path_keys(OnPath):
    bl_idname = "rigid_motion.delete_path_keys"
    bl_label = "Delete Keys on Path"
    bl_description = "Delete the selected keys on the visible paths, of location, rotation and scale"

    def execute(self, context: bpy.types.Context) -> Returned:
        handles, refused = handles_of(context), list[Refused]()
        chosen = {one.target: one.selected for one in handles if len(one.selected)}
        if not chosen:
            return self.without_keys(handles)
        delete_keys(chosen, refused=refused)
        return self.finish(refused)


@with_properties
class RIGID_MOTION_OT_set_path_point(OnPath):
    bl_idname = "rigid_motion.set_path_point"
    bl_label = "Point of Path"
    bl_description = "Choose the point of the selected objects or bones that their paths follow, such as a sword's tip"

    point: str = EnumProperty(
        name="Point",
        description="The point that paths follow",
        items=[
            ("ORIGIN", "Origin", "The origin of an object, the head of a bone, or its tail where it only turns"),
            ("TAIL", "Tail", "The tail of a bone"),
            ("CURSOR", "3D Cursor", "The point of the body that is at the 3D cursor on the current frame"),
            ("VERTICES", "Selected Vertices", "The middle of the vertices of the mesh that are selected in Edit Mode"),
        ],
    )

    def execute(self, context: bpy.types.Context) -> Returned:
        for target in map(transform_of, selected(context)):
            target.motion.lead = self.point_of(target, existing(context.scene))[:]
            target.animated.update_tag()
        return self.finish(())

    def point_of(self, target: Transform, scene: bpy.types.Scene) -> Vector:
        """Return the chosen point in the local space of an object or bone."""
        if self.point == "CURSOR":
            return world_matrix(target).inverted_safe() @ scene.cursor.location
        mesh = target.animated.data
        if self.point == "VERTICES" and isinstance(mesh, bpy.types.Mesh):
            chosen = [vertex.co for vertex in mesh.vertices if vertex.select]
            return sum(chosen, Vector()) / max(len(chosen), 1)
        is_tail = self.point == "TAIL" and target.is_part
        return Vector((0.0, target.pose_bone.length if is_tail else 0.0, 0.0))
