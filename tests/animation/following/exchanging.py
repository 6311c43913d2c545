"""Actions that go and come, and are shared or exchanged, as steps of a machine that edits objects."""

from __future__ import annotations

import bpy
import numpy as np
from hypothesis import strategies as st
from hypothesis.stateful import precondition, rule

from tests.animation.editing import seeds, shares
from tests.animation.keyed import curves_of, key_frames, transform_paths
from tests.animation.machine import goes_on
from tests.animation.oracle import Own, expected_bases
from tests.animation.scenes import new_object, push_down, tweak
from tests.animation.tool_steps import WithTools


class Exchanging(WithTools):
    """An animator who also exchanges the Actions of objects."""

    KEPT = (*WithTools.KEPT, "turned")

    def __init__(self) -> None:
        super().__init__()
        self.turned: dict[str, tuple] = {}
        """The delta rotations of their own, as quaternions and Euler angles."""

    def _object(self, share: float) -> bpy.types.Object:
        return self._found(self._named(share))

    def _sharing(self, name: str) -> set[str]:
        """The objects that move by the same slot as this one, itself among them."""
        data = bpy.data.objects[name].animation_data
        if data is None or data.action is None:
            return {name}
        return {
            other
            for other in self.names
            if (theirs := bpy.data.objects[other].animation_data) is not None
            and (theirs.action, theirs.action_slot_handle) == (data.action, data.action_slot_handle)
        }

    def _is_free(self, name: str) -> bool:
        """Whether its Action may be exchanged without losing a bake's way back, or leaving others behind."""
        return name not in self.before_bake and self._sharing(name) == {name}

    @precondition(lambda self: self.on and len(self.names) > 1)
    @rule(who=shares, other=shares)
    def swap_the_actions_of_two(self, who, other):
        names = [self._object(share).name for share in (who, other)]
        alike = len({bpy.data.objects[name].rotation_mode for name in names}) == 1
        if names[0] == names[1] or not alike or not all(map(self._is_free, names)):
            return

        self._edit(lambda: self._swap_actions(names))

    @precondition(lambda self: self.on and len(self.names) > 1)
    @rule(who=shares, other=shares)
    def share_an_action_or_make_it_single_user(self, who, other):
        name, source = (self._object(share).name for share in (who, other))
        if len(self._sharing(name)) > 1:

            def change() -> None:
                obj = bpy.data.objects[name]
                slot = obj.animation_data.action_slot.identifier
                self._link(obj, obj.animation_data.action.copy(), None)
                obj.animation_data.action_slot = obj.animation_data.action.slots[slot]

        else:
            alike = (
                bpy.data.objects[name].rotation_mode == bpy.data.objects[source].rotation_mode
                and self.owns[name] == self.owns[source]
                and self._rests_alike(name, source)
            )
            if not alike or name in self.before_bake or source in self.before_bake:
                return

            def change() -> None:
                self._link(bpy.data.objects[name], *self._linked(bpy.data.objects[source]))

        self._edit(change)

    def _rests_alike(self, name: str, source: str) -> bool:
        """Whether two objects have the same where the source's Action keys nothing."""
        obj, other = bpy.data.objects[name], bpy.data.objects[source]
        keyed = {channel for channel, fcurve in curves_of(other).items() if len(fcurve.keyframe_points)}
        return all(
            (path, index) in keyed or getattr(obj, path)[index] == value
            for path in transform_paths(other)[1:]
            for index, value in enumerate(getattr(other, path))
        )

    @precondition(lambda self: self.on and len(self.names) < 4)
    @rule(who=shares, copied=st.booleans(), seed=seeds)
    def reuse_an_action_on_a_fresh_object(self, who, copied, seed):
        source = self._object(who)
        if source.name in self.before_bake or source.animation_data is None or source.animation_data.action is None:
            return
        name, self.fresh = f"Fresh {self.fresh}", self.fresh + 1
        self.owns[name], self.turned[name] = Own(), ((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        if self.owns[source.name] != Own() and not copied:
            return
        self.names.append(name)

        def make() -> None:
            obj = new_object(name, source.rotation_mode)
            for path in transform_paths(source):
                setattr(obj, path, getattr(source, path))
            action, slot = self._linked(source)
            if copied:
                identifier = slot.identifier
                action = action.copy()
                slot = action.slots[identifier]
            self._link(obj, action, slot)

        self._edit(make)

    @precondition(lambda self: self.on)
    @rule(
        who=shares,
        start=st.integers(1, 60),
        scale=st.sampled_from((1.0, 2.0, 4.0)),
        which=st.none() | shares,
        seed=seeds,
    )
    def push_down_tweak_and_delete_the_strip(self, who, start, scale, which, seed):
        """In a strip it moves as it did, and as its keys are edited there."""
        obj = self._object(who)
        name, (action, slot) = obj.name, self._linked(obj)
        if action is None or not self._is_free(name) or not len(key_frames(obj)) or goes_on(obj):
            return
        strip = push_down(obj, start)
        strip.scale = scale
        # Only in tweak mode the Action is the object's.
        tweak(obj, strip)
        fcurve = None if which is None else self._curve(obj, which)
        if fcurve is not None:
            fcurve.keyframe_points[0].co_ui.y = np.random.default_rng(seed).normal()
            fcurve.update()
            bpy.context.view_layer.update()
        own = np.round(8.0 * np.linspace(strip.action_frame_start, strip.action_frame_end, 9)[1:-1]) / 8.0
        expected = expected_bases(obj, own, self.owns[name])
        frames = strip.frame_start + scale * (own - strip.action_frame_start)
        obj.animation_data.use_tweak_mode = False
        bpy.context.view_layer.update()
        error = np.abs(self._bases(name, frames) - expected).max()
        assert error < 1e-4 * max(1.0, np.abs(expected).max()), f"{name} is off by {error:.3g} in a strip"
        obj.animation_data.nla_tracks.remove(obj.animation_data.nla_tracks[0])
        self._link(obj, action, slot)
        bpy.context.view_layer.update()
        # What was edited needs an undo step of its own.
        self._edit(lambda: None)
