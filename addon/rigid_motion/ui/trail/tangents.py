"""Tangents at the selected keys of paths: operator and drawing of handles that set the speed, and bend the path.

A handle is as long as the distance travelled in a third of a second. Dragging it along itself makes the body faster or
slower on that side of the key, and the path stays. B also bends the path: a key is inserted halfway in the segment, and
moved until the path leaves in the direction of the handle.
"""

from __future__ import annotations

from typing import Any

import bpy
import gpu
import numpy as np
from bpy.app.translations import pgettext_iface as iface_
from bpy.app.translations import pgettext_n as n_
from mathutils import Matrix, Vector

from ...animation import Refused
from ...animation.edits.path_keys import KeyEdits, insert_key, select_keys
from ...animation.edits.path_tangents import SIDE_AFTER, SIDE_BEFORE, TangentEdit
from ...animation.evaluation.ends import SLOPE_STEP_RATIO
from ...animation.transforms import Transform
from ...blender import (
    BoolProperty,
    FloatProperty,
    FloatVectorProperty,
    StringProperty,
    existing,
    view_layer,
    with_properties,
)
from ..overlay.drawing import KEY_COLOUR, Pen, batch_of, path_drawers
from ..overlay.parents import maps_of
from ..overlay.points import DrawnPath
from ..overlay.settings import RigidMotionOverlay
from .arms import HANDLE_SECONDS, arms_of, ends_of, frame_rate, is_shown, tangent_under
from .dragging import Dragging, direction_of
from .handles import Handles, handles_of, spaces

HANDLE_DIAMETER_PX, HANDLE_WIDTH_PX = 8.0, 1.5

MIN_SLOPE = 0.05
"""The progress at a key, up to which its velocity has no reliable direction."""

BEND_RATIO = 0.5
"""The place of the inserted key that bends the path, as a fraction of the segment.

At the keys of *Smooth Screw*, segments of like durations have most effect: a nearer key would have to be moved far.
"""

TRIED_RATIO = 0.1
"""Trial movement of the key that bends the path, as a fraction of the segment's length."""

MIN_LENGTH_RATIO = 0.5
"""While the path is bent, a tangent keeps at least this fraction of its length at an even speed."""

SPEED_STEP_RATIO, FINE_SPEED_STEP_RATIO = 0.1, 0.01
"""Steps of speed with Ctrl, and with Ctrl and Shift, as fractions of the even speed."""

RANGE_COLOUR, RANGE_WIDTH_PX = (1.0, 1.0, 1.0, 0.35), 9.0

NO_ROOM = n_("{name} has no frame between the keys for one that bends the path: move them apart")


def draw(pen: Pen, _: Transform, path: DrawnPath, _frame: float, overlay: RigidMotionOverlay) -> None:
    """Draw the handles of a path in its space, and the range of Proportional Editing while keys are dragged."""
    if Dragging.shown_reach and path.selected.any():
        away = np.abs(path.frames[:, None] - path.key_frames[path.selected]).min(axis=1)
        within = (away[:-1] <= Dragging.shown_reach) & (away[1:] <= Dragging.shown_reach)
        pieces = np.stack((path.line[:-1][within], path.line[1:][within]), axis=1).reshape(-1, 3)
        pen.line(batch_of("LINES", pieces), RANGE_COLOUR, RANGE_WIDTH_PX)
    if not is_shown(path, overlay):
        return
    projection = np.array(gpu.matrix.get_projection_matrix() @ gpu.matrix.get_model_view_matrix())
    ends = ends_of(path, projection, pen.size, pen.scale)
    starts = np.broadcast_to(path.keys[path.selected][:, None], ends.shape)
    is_there = np.isfinite(ends).all(axis=-1)
    lines = np.stack((starts[is_there], ends[is_there]), axis=1).reshape(-1, 3)
    pen.outlined_line(batch_of("LINES", lines), pen.look.key_color, HANDLE_WIDTH_PX)
    pen.dot(batch_of("POINTS", ends[is_there]), pen.look.key_color, HANDLE_DIAMETER_PX, KEY_COLOUR, 1.5)


@with_properties
class RIGID_MOTION_OT_drag_path_tangent(Dragging):
    bl_idname = "rigid_motion.drag_path_tangent"
    bl_label = "Drag Tangent of Path"
    bl_description = (
        "Set how fast the body leaves a key or comes to it, by the handles of all its channels. The path stays, unless "
        "it is bent: then it leaves the key in the direction of the tangent"
    )
    takes_neighbours = False

    speed: float = FloatProperty(name="Speed", description="At the key, in units a second", min=0.0)
    bend: Any = FloatVectorProperty(
        name="Bend",
        description="How far the key that is inserted to bend the path is moved, in the world. Zero bends nothing",
        subtype="TRANSLATION",
        size=3,
    )
    after: bool = BoolProperty(name="After the Key", description="Set the speed behind the key", default=True)
    frame: float = FloatProperty(name="Frame", description="That of the key")
    target: str = StringProperty(description="What has the key", options={"HIDDEN"})

    def grab(self, context: bpy.types.Context, handles: list[Handles], place: np.ndarray) -> bool:
        hit = tangent_under(context, handles, place)
        if hit is not None:
            self.target, self.frame, self.after = hit[0].target.name, hit[1], hit[2] == SIDE_AFTER
        return hit is not None

    def read(self, handles: list[Handles]) -> bool:
        self._refused, self._is_bending = list[Refused](), False
        self._bent: KeyEdits | None = None
        if self._hit is not None:
            self.target, self.frame = self._hit[0].target.name, self._hit[1]
        one = self._edited_handles(handles)
        if one is None:
            return False
        self._target, self._edits = one.target, self._new_edit(one.target)
        if not self._edits:
            return False
        self._pivot = Vector(one.in_world(one.path.keys)[self._key_index(one)].tolist())
        self._even = self._even_velocity(one, self._edits)
        return True

    def begin(self, _context: Any) -> None:
        self._arm = self._even * self._edits.slope * HANDLE_SECONDS * frame_rate()

    def keys_shown(self) -> str:
        return iface_(
            "LMB, Enter: Confirm | Esc, RMB: Cancel | B: Bend the Path ({bends}) | Ctrl: Steps | Shift: Precision | "
            "0-9: Speed"
        ).format(bends=iface_("On") if self._is_bending else iface_("Off"))

    def press(self, context: Any, event: bpy.types.Event) -> bool:
        if event.type != "B" or event.value != "PRESS":
            return False
        self._is_bending = not self._is_bending and self._ensure_bending_key()
        if self._is_bending:
            self._measure_bending()
        self.show_status(context)
        return True

    def drag(self, context: Any) -> str:
        given, number = self._input, self._input.number
        direction = direction_of(given.axis) if self._is_bending else Vector(self._even.tolist()).normalized()
        first, last = (self.at(context, place, direction) for place in (given.first, given.place))
        arm = self._arm + np.array(last - first)
        even = float(np.linalg.norm(self._even)) * frame_rate()
        self.speed = max(float(np.linalg.norm(arm) if self._is_bending else arm @ direction), 0.0) / HANDLE_SECONDS
        if number is not None:
            self.speed = max(number, 0.0)
        elif given.is_stepped:
            step = even * (FINE_SPEED_STEP_RATIO if given.is_fine else SPEED_STEP_RATIO)
            self.speed = round(self.speed / step) * step
        self.bend = self._bend_towards(arm) if self._is_bending else (0.0, 0.0, 0.0)
        self.apply()
        return iface_("Speed {speed:.4g} a second ({share:.0f} % of even)").format(
            speed=self.speed, share=100.0 * self.speed / even
        )

    def apply(self) -> None:
        edits, even = self._edits, self._even
        if any(self.bend) and self._ensure_bending_key():
            self._move(np.array(self.bend))
            if not (edits := self._new_edit(self._target)):
                return
            even = self._even_velocity(existing(self._edited_handles(handles_of(bpy.context))), edits)
        else:
            self._bent = None
        edits.apply(self.speed / frame_rate() / max(float(np.linalg.norm(even)), 1e-9))

    def _edited_handles(self, handles: list[Handles]) -> Handles | None:
        return next((one for one in handles if one.target.name == self.target), None)

    def _key_index(self, one: Handles) -> int:
        return int(np.argmin(np.abs(one.path.key_frames - self.frame)))

    def _new_edit(self, target: Transform) -> TangentEdit:
        return TangentEdit(target, self.frame, SIDE_AFTER if self.after else SIDE_BEFORE, refused=self._refused)

    def _even_velocity(self, one: Handles, edits: TangentEdit) -> np.ndarray:
        """Return the velocity at the key if progress were even, in the world, per frame, shape (3,)."""
        if edits.slope > MIN_SLOPE:
            return self._velocity(one) / edits.slope
        by = SLOPE_STEP_RATIO * np.diff(edits.ends)[0]
        first, last = one.in_world(
            np.stack([existing(one.path.at(at)[1]) for at in (edits.ends[0], edits.ends[0] + by)])
        )
        return np.asarray((last - first) * SLOPE_STEP_RATIO / (edits.first_share * abs(by)))

    def _velocity(self, one: Handles) -> np.ndarray:
        arm = arms_of(one.path)[0][self._key_index(one), int(self.after)]
        return np.asarray(maps_of(one.space).axes @ arm)

    def _ensure_bending_key(self) -> bool:
        """Insert the key that bends the path unless it exists; return whether there is room for it."""
        if self._bent is None:
            first, last = self._edits.ends
            at = float(round(first + BEND_RATIO * (last - first)))
            if not min(first, last) < at < max(first, last):
                self._refused.append(Refused(NO_ROOM, name=self._target.name))
                return False
            chosen = existing(self._edited_handles(handles_of(bpy.context))).selected
            self._edits.cancel()
            insert_key(self._target, at)
            select_keys(self._target, chosen)
            view_layer().update()
            one = existing(self._edited_handles(handles_of(bpy.context)))
            self._bent = KeyEdits(spaces({one: (np.array((at,)), np.ones(1))}))
        return True

    def _move(self, by: np.ndarray) -> None:
        existing(self._bent).move(lambda _: np.array(Matrix.Translation(by.tolist())))

    def _measure_bending(self) -> None:
        """Measure how the tangent at the key depends on the place of the key that bends the path.

        The dependence is linear where no handle acts.
        """

        def tangent_with(by: np.ndarray) -> np.ndarray:
            self._move(by)
            self._new_edit(self._target).apply(None)
            return self._velocity(existing(self._edited_handles(handles_of(bpy.context))))

        self._straight = tangent_with(np.zeros(3))
        step = TRIED_RATIO * float(np.linalg.norm(self._straight) * abs(np.diff(self._edits.ends)[0]))
        tried = [tangent_with(step * axis) for axis in np.eye(3)]
        self._turns = (np.array(tried) - self._straight).T / step

    def _bend_towards(self, arm: np.ndarray) -> np.ndarray:
        """Return the movement (3,) of the key that bends the path, which makes the tangent point along an arm."""
        both = np.stack((arm / max(float(np.linalg.norm(arm)), 1e-9), self._straight), axis=1)
        along, stays = np.linalg.lstsq(self._turns, both, rcond=1e-6)[0].T
        # Choose the length of the tangent that moves the key least.
        length = float(np.linalg.norm(self._straight))
        return np.asarray(np.clip(along @ stays / (along @ along), MIN_LENGTH_RATIO * length, length) * along - stays)


def register() -> None:
    path_drawers.append(draw)


def unregister() -> None:
    path_drawers.remove(draw)
