"""Every edit is an operator with undo, as in a window, and what handlers complained of meanwhile; and steps that are
the same for objects and rigs.

Blender pushes its undo step before handlers get to see the edit.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Hashable
from typing import ClassVar

import bpy
import numpy as np
from hypothesis import strategies as st
from hypothesis.stateful import precondition, rule

from tests.animation.bones.rigs import select_only

LAST = 40
seeds = st.integers(0, 2**16)
shares = st.floats(0.0, 1.0, exclude_max=True)
frames_in = st.integers(-4, 4 * (LAST + 5)).map(lambda quarter: quarter / 4)


class Edit(bpy.types.Operator):
    """Any change, as an operator with undo."""

    bl_idname = "test.edit"
    bl_label = "Edit"
    bl_options: ClassVar = {"REGISTER", "UNDO"}
    change: ClassVar[Callable[[], None]]

    def execute(self, context: bpy.types.Context) -> set[str]:
        Edit.change()
        return {"FINISHED"}


class Complaints(logging.Handler):
    """Errors that handlers wrote down instead of raising them into Blender."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.found: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.found.append(self.format(record))


class TakenAway:
    """Steps after which nothing animates an object any more, or a bake of Blender's: it stays where it is seen.

    For machines of objects or of rigs, see `editing.Editing`.
    """

    def _animated(self, name: Hashable) -> bpy.types.Object:
        """The object whose Action moves what has this name."""
        raise NotImplementedError

    def _seen(self, obj: bpy.types.Object) -> dict[Hashable, np.ndarray]:
        """How all that an Action moves of an object is shown now, but for what Blender itself cannot show exactly."""
        bpy.context.view_layer.update()
        names = [name for name in self.names if self._animated(name) == obj and self._is_exact(name)]
        return {name: self._basis(self._found(name)) for name in names}

    def _is_exact(self, name: Hashable) -> bool:
        """Whether single precision is enough for how something is shown on this frame."""
        return True

    def _assert_seen(self, obj: bpy.types.Object, seen: dict[Hashable, np.ndarray]) -> None:
        bpy.context.view_layer.update()
        for name, then in seen.items():
            error = np.abs(self._basis(self._found(name)) - then).max()
            assert error < 5e-5 * max(1.0, np.abs(then).max()), f"{name} jumped by {error:.3g}"

    @precondition(lambda self: self.on)
    @rule(who=shares, cleared=st.booleans(), there=frames_in)
    def take_the_animation_away_for_a_while(self, who, cleared, there):
        """It stays where it is seen, and goes on as before with its Action."""
        obj = self._animated(self._named(who))
        action, slot = self._linked(obj)
        if action is None or not self._is_free(obj.name):
            return
        seen = self._seen(obj)
        if cleared:
            obj.animation_data_clear()
        else:
            self._link(obj, None, None)
        self._assert_seen(obj, seen)
        bpy.context.scene.frame_set(int(there + self.shift))
        self._assert_seen(obj, seen)
        self._link(obj, action, slot)
        bpy.context.view_layer.update()

    @precondition(lambda self: self.on)
    @rule(who=shares, step=st.sampled_from((1, 4)), first=frames_in)
    def bake_by_blender_and_take_it_back(self, who, step, first):
        obj = self._animated(self._named(who))
        action, slot = self._linked(obj)
        if action is None or not self._is_free(obj.name):
            return
        back = bpy.context.scene.frame_current
        # The operator begins at frame 0.
        begin = max(int(first + self.shift), 0)
        frames = range(begin, begin + 9, step)
        before = {}
        for frame in frames:
            bpy.context.scene.frame_set(frame)
            before[frame] = self._seen(obj)
        bpy.context.scene.frame_set(back)
        select_only(obj)
        kinds = {"POSE" if obj.pose is not None else "OBJECT"}
        bpy.ops.nla.bake(frame_start=frames[0], frame_end=frames[-1], step=step, only_selected=False, bake_types=kinds)
        baked = obj.animation_data.action
        assert baked != action
        for frame in frames:
            bpy.context.scene.frame_set(frame)
            self._assert_seen(obj, before[frame])
        self._link(obj, action, slot)
        bpy.data.actions.remove(baked)
        bpy.context.view_layer.update()
