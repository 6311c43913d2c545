"""Operators that move, rotate and retime selected keys on paths with the mouse, as Blender's own transforms do.

X, Y and Z lock an axis of the world, Ctrl snaps to steps, Shift is for precision. A typed number goes along X if no
axis is locked. A click or Enter confirms, a right click or Esc restores everything.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

import bpy
import numpy as np
from bpy.app.translations import pgettext_iface as iface_
from bpy.app.translations import pgettext_n as n_
from bpy_extras.view3d_utils import (
    location_3d_to_region_2d,
    region_2d_to_location_3d,
    region_2d_to_origin_3d,
    region_2d_to_vector_3d,
)
from mathutils import Matrix, Vector
from mathutils.geometry import intersect_line_line

from ...animation import Refused
from ...animation.edits.path_keys import KeyEdits
from ...blender import FloatProperty, FloatVectorProperty, Returned, existing, with_properties
from ..mouse_input import CANCEL, CONFIRM, MouseInput
from . import proportional
from .handles import Handles, OnPath, handles_of, key_under, select, selected_spaces
from .picking import RIGID_MOTION_OT_select_path_keys, mouse_of, pressed_at

STEP_PX = 50.0
"""With Ctrl, a step is the largest power of ten that is at most so many pixels at a resolution scale of 1."""

STEP_DEG, FINE_STEP_DEG = 5.0, 1.0
"""Steps of rotation with Ctrl, and with Ctrl and Shift, in degrees."""

FINE_STEP_RATIO = 0.1
"""With Ctrl and Shift, steps are smaller by this factor."""

AXES = "XYZ"


class DragInput(MouseInput):
    """Mouse and keyboard input during a drag. `place` is the mouse in pixels of the region, slowed down by Shift."""

    def __init__(self, place: np.ndarray) -> None:
        super().__init__()
        self.first, self.place, self._mouse = place.copy(), place.copy(), place.copy()
        self.axis: int | None = None
        """The locked axis of the world, 0 to 2; None if none is locked."""

    def move(self, event: bpy.types.Event, ratio: float) -> None:
        mouse = mouse_of(event)
        self.place += ratio * (mouse - self._mouse)
        self._mouse = mouse

    def press(self, key: str) -> bool:
        if key not in AXES:
            return False
        axis = AXES.index(key)
        self.axis = None if self.axis == axis else axis
        return True


class Dragging(OnPath):
    """Operators that try edits of the selected keys while the mouse moves."""

    bl_options = {"REGISTER", "UNDO", "BLOCKING"}  # noqa: RUF012 - Blender reads it
    leaves_carried: ClassVar[bool] = True
    """True if keys are left out that move along with the keys of their parents or holders."""
    takes_neighbours: ClassVar[bool] = True
    """True if Proportional Editing applies to the keys around."""
    _hit: tuple[Handles, float] | None = None
    """The key under the mouse, by its frame, or else the first selected one."""
    shown_reach: ClassVar[float] = 0.0
    """The range of Proportional Editing in frames, drawn during the drag."""
    keys_text: ClassVar[str] = n_(
        "LMB, Enter: Confirm | Esc, RMB: Cancel | X, Y, Z: Axis | Ctrl: Steps | Shift: Precision | "
        "0-9: Number | O, Wheel: Proportional"
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> Returned:
        handles, self._is_drag = handles_of(context), event.value == "CLICK_DRAG"
        place = pressed_at(event) if self._is_drag else mouse_of(event)
        if self._is_drag and not self.grab(context, handles, place):
            return {"PASS_THROUGH", "CANCELLED"}
        handles = handles_of(context)
        if not self._is_drag:
            self._hit = next(((one, float(one.selected[0])) for one in handles if len(one.selected)), None)
        if not self.read(handles):
            return self.without_keys(handles, self._refused)
        self._input = DragInput(place)
        self.begin(context)
        self.show_status(context)
        existing(context.window_manager).modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> Returned:
        is_released = self._is_drag and event.type == "LEFTMOUSE" and event.value == "RELEASE"
        if event.type in CANCEL and event.value == "PRESS":
            self.cancel(context)
            return {"CANCELLED"}
        if is_released or (event.type in CONFIRM and event.value == "PRESS"):
            self._hide(context)
            return self.finish(self._refused)
        if self.press(context, event) or self._input.handle(event):
            existing(context.area).header_text_set(self.drag(context))
            self.finish(())
        return {"RUNNING_MODAL"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Restore the keys. Blender also calls it when it ends the operator by itself."""
        self._edits.cancel()
        self._hide(context)
        self.finish(())

    def execute(self, context: bpy.types.Context) -> Returned:
        handles = handles_of(context)
        if not self.read(handles):
            return self.without_keys(handles, self._refused)
        self.apply()
        return self.finish(self._refused)

    def grab(self, context: bpy.types.Context, handles: list[Handles], place: np.ndarray) -> bool:
        """Hit the key at a place on the screen, and select it alone unless it is selected; return whether it exists."""
        self._hit = key_under(context, handles, place)
        if self._hit is None:
            return False
        one, frame = self._hit
        if frame not in one.selected:
            select(context, handles, {one.target: np.array([frame])})
            # So the redo panel (F9) acts on the dragged keys.
            bpy.ops.ed.undo_push(message=RIGID_MOTION_OT_select_path_keys.bl_label)
        return True

    def read(self, handles: list[Handles]) -> bool:
        """Prepare the edit of the selected keys, and return whether any of them can be edited."""
        reach = proportional.reach() if self.takes_neighbours else 0.0
        spaces, self._refused = selected_spaces(handles, reach, leave_carried=self.leaves_carried), list[Refused]()
        self._edits: Any = KeyEdits(spaces, refused=self._refused)
        if spaces:
            chosen = [one.points[one.weights >= 1.0] for one in spaces.values()]
            self._pivot = Vector(np.concatenate(chosen).mean(axis=0).tolist())
        return len(self._edits) > 0

    def press(self, context: Any, event: bpy.types.Event) -> bool:
        """Handle a keyboard key that is neither for the mouse nor for a number; return whether it changed anything."""
        if not self.takes_neighbours or event.value != "PRESS" or not proportional.change(event):
            return False
        self._edits.cancel()
        self.show_status(context)
        return self.read(handles_of(context))

    def show_status(self, context: Any) -> None:
        """Show the shortcuts in the status bar, and the range of Proportional Editing in the viewport."""
        Dragging.shown_reach = proportional.reach() if self.takes_neighbours else 0.0
        existing(context.workspace).status_text_set(self.keys_shown())

    def keys_shown(self) -> str:
        """Return the shortcuts for the status bar."""
        return iface_(self.keys_text)

    def begin(self, context: Any) -> None:
        """Store the state of the viewport when the drag begins."""

    def drag(self, context: Any) -> str:
        """Edit the keys from the input, and return the text for the header."""
        raise NotImplementedError

    def apply(self) -> None:
        """Edit the keys from the operator's properties."""
        raise NotImplementedError

    def at(self, context: Any, place: np.ndarray, direction: Vector | None) -> Vector:
        """Return the point of the world at a place on the screen, at the depth of the keys or on the locked axis."""
        where = context.region, context.region_data, place.tolist()
        if direction is None:
            return region_2d_to_location_3d(*where, self._pivot)
        origin, ray = region_2d_to_origin_3d(*where), region_2d_to_vector_3d(*where)
        both = intersect_line_line(self._pivot, self._pivot + direction, origin, origin + ray)
        return self._pivot if both is None else both[0]

    def _hide(self, context: bpy.types.Context) -> None:
        Dragging.shown_reach = 0.0
        existing(context.area).header_text_set(None)
        existing(context.workspace).status_text_set(None)


def direction_of(axis: int | None) -> Vector | None:
    """Return the direction of an axis of the world, None if none is locked."""
    return None if axis is None else Vector([float(axis == row) for row in range(3)])


@with_properties
class RIGID_MOTION_OT_move_path_keys(Dragging):
    bl_idname = "rigid_motion.move_path_keys"
    bl_label = "Move Keys on Path"
    bl_description = "Move the selected keys on paths in the world, each with the whole body"

    value: Any = FloatVectorProperty(name="Move", description="How far, in the world", subtype="TRANSLATION", size=3)

    def drag(self, context: Any) -> str:
        given, number = self._input, self._input.number
        direction = direction_of(given.axis)
        first, last = (self.at(context, place, direction) for place in (given.first, given.place))
        move = last - first
        if number is not None:
            move = number * (direction or Vector((1.0, 0.0, 0.0)))
        elif given.is_stepped:
            beside = given.first + np.array((STEP_PX * context.preferences.system.ui_scale, 0.0))
            away = (self.at(context, beside, None) - self.at(context, given.first, None)).length
            step = 10.0 ** math.floor(math.log10(max(away, 1e-9)))
            step *= FINE_STEP_RATIO if given.is_fine else 1.0
            move = Vector([round(part / step) * step for part in move[:]])
        self.value = move
        self.apply()
        parts = [f"D{name.lower()} {part:.4g}" for name, part in zip(AXES, move[:], strict=True)]
        return "   ".join((*parts, f"({move.length:.4g})", proportional.text()))

    def apply(self) -> None:
        move = Vector(self.value[:])
        self._edits.move(lambda share: np.array(Matrix.Translation((share * move)[:])))


@with_properties
class RIGID_MOTION_OT_rotate_path_keys(Dragging):
    bl_idname = "rigid_motion.rotate_path_keys"
    bl_label = "Rotate Keys on Path"
    bl_description = "Rotate the selected keys on paths about the middle of their points, each with the whole body"

    angle: float = FloatProperty(name="Angle", description="By how much, counterclockwise", subtype="ANGLE")
    axis: Any = FloatVectorProperty(
        name="Axis", description="About which axis of the world", subtype="DIRECTION", size=3, default=(0.0, 0.0, 1.0)
    )

    def begin(self, context: Any) -> None:
        middle = location_3d_to_region_2d(context.region, context.region_data, self._pivot, default=Vector((0.0, 0.0)))
        self._middle, self._turned, self._before = np.array(middle), 0.0, self._input.first.copy()

    def drag(self, context: Any) -> str:
        given, number = self._input, self._input.number
        (x, y), (to_x, to_y) = self._before - self._middle, given.place - self._middle
        self._turned += math.atan2(x * to_y - y * to_x, x * to_x + y * to_y)
        self._before = given.place.copy()
        toward = context.region_data.view_rotation @ Vector((0.0, 0.0, 1.0))
        axis = direction_of(given.axis) or toward
        angle = math.degrees(self._turned if axis.dot(toward) >= 0.0 else -self._turned)
        if number is not None:
            angle = number
        elif given.is_stepped:
            step = FINE_STEP_DEG if given.is_fine else STEP_DEG
            angle = round(angle / step) * step
        self.angle, self.axis = math.radians(angle), axis
        self.apply()
        axis_name = "" if given.axis is None else AXES[given.axis]
        return "   ".join((f"{angle:.2f}°", axis_name, proportional.text()))

    def apply(self) -> None:
        middle = Matrix.Translation(tuple(self._pivot[:]))

        def turned(share: float) -> np.ndarray:
            return np.array(middle @ Matrix.Rotation(share * self.angle, 4, self.axis[:]) @ middle.inverted())

        self._edits.move(turned)


@with_properties
class RIGID_MOTION_OT_retime_path_keys(Dragging):
    bl_idname = "rigid_motion.retime_path_keys"
    bl_label = "Retime Keys on Path"
    bl_description = (
        "Move the selected keys in time. They keep their poses, and the key that is dragged gets the frame on which "
        "the path is nearest to the mouse"
    )
    leaves_carried = takes_neighbours = False
    keys_text = n_("LMB, Enter: Confirm | Esc, RMB: Cancel | Shift: Fractions of Frames | 0-9: Number")

    frames: float = FloatProperty(name="Frames", description="How much later, in frames")

    def drag(self, context: Any) -> str:
        (one, frame), number = existing(self._hit), self._input.number
        if number is not None:
            self.frames = number
        else:
            # Use the original path: along the present one the key would run away from the mouse.
            _, moment = one.nearest_moment(context, self._input.place)
            self.frames = (moment if self._input.is_fine else round(moment)) - frame
        self.apply()
        return iface_("Frame {frame:g} ({by:+g})").format(frame=round(frame + self.frames, 3), by=round(self.frames, 3))

    def apply(self) -> None:
        self.frames = self._edits.retime(self.frames)
