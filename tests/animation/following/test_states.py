"""State machine for objects: after any edits in any order, in-betweens equal a fresh computation, and keys stay."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np
from hypothesis import strategies as st
from hypothesis.stateful import initialize, precondition, rule
from mathutils import Euler, Matrix

from rigid_motion import animation
from tests.animation.editing import ORDERS
from tests.animation.holds.hold_steps import WithHolds
from tests.animation.keyed import MODE_IDS, WIDTHS, curves_of, key_frames, snapshot, transform_paths
from tests.animation.machine import LAST, SETTINGS, goes_on, seeds, shares, while_on
from tests.animation.oracle import assert_shown, expected_bases
from tests.animation.scenes import give_own_deltas, key, new_object, push_down, tweak


class EditingObjects(WithHolds):
    """An animator at work on a few objects, identified by name."""

    @initialize(
        orders=st.lists(st.sampled_from(ORDERS), min_size=1, max_size=3),
        scales=st.lists(st.sampled_from((None, "even", "uneven")), min_size=3, max_size=3),
        parented=st.booleans(),
        with_own=st.booleans(),
        mode=st.sampled_from(MODE_IDS),
        shift=st.sampled_from((0.0, 0.0, -20.0, -60.0)),
        seed=seeds,
    )
    def begin(self, orders, scales, parented, with_own, mode, shift, seed):
        bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, LAST
        self.shift = shift
        parent = None
        for number, (order, scale) in enumerate(zip(orders, scales, strict=False)):
            obj = new_object(f"Tool {number}", order)
            if with_own:
                give_own_deltas(obj, seed + number)
            key(obj, np.array((1.0, 13.0, 26.0, 37.0)) + shift, seed=seed + number, scale=scale)
            animation.set_mode(obj, mode)
            if parented and parent is not None:
                obj.parent = parent
                obj.matrix_parent_inverse = parent.matrix_world.inverted()
            parent = obj
        self.names = [obj.name for obj in bpy.data.objects]
        self._start_history()

    def _found(self, name: str) -> bpy.types.Object:
        return bpy.data.objects[name]

    def _basis(self, obj: bpy.types.Object) -> np.ndarray:
        return np.array(obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_basis)

    def _sharing(self, name: str) -> set[str]:
        return {obj.name for obj in self._users(self._found(name))}

    def _assert_shown(self, names: Sequence[str], frames: np.ndarray) -> None:
        for name in names:
            if any(map(self._is_held, self._carrying(name))):
                self._assert_held(name, frames)
            else:
                assert_shown([self._found(name)], frames)

    def _carrying(self, name: str) -> list[str]:
        parent = self._found(name).parent
        return [name] if parent is None else [name, *self._carrying(parent.name)]

    @while_on(who=shares, seed=seeds)
    def change_its_own_deltas(self, who, seed):
        name = self._named(who)
        random = np.random.default_rng(seed)

        def change() -> None:
            self._found(name).delta_location = random.normal(size=3)
            self._found(name).delta_scale = np.full(3, np.exp(0.3 * random.normal()))

        if self._sharing(name) == {name} and not self._is_held(name):
            self._edit(change)

    @while_on(who=shares, count=st.integers(2, 8))
    def reduce_to_a_number_and_restore(self, who, count):
        name = self._named(who)
        if self._sharing(name) != {name} or name in self.before_bake:
            return
        keyed, before = snapshot(self._found(name)), len(key_frames(self._found(name)))
        refused: list[animation.Refused] = []
        self._edit(lambda: animation.reduce_keys_of(self._found(name), count=count, refused=refused))
        if not refused:
            assert len(key_frames(self._found(name))) < before
            self._edit(lambda: animation.restore_keys(self._found(name)))
        assert snapshot(self._found(name)) == keyed

    @while_on(who=shares, seed=seeds)
    def set_a_matrix_and_key_it_in_one_go(self, who, seed):
        obj, scene = self._found(self._named(who)), bpy.context.scene
        frame, name = scene.frame_current_final, obj.name
        if obj.parent is not None or obj.matrix_world.is_negative or self._is_held(name):
            return
        # A flat matrix has no rotation, and keys in muted channels are not seen.
        if min(map(abs, obj.matrix_world.to_scale())) < 1e-6:
            return
        if any(fcurve.mute for (path, _), fcurve in curves_of(obj).items() if path in WIDTHS):
            return
        values = np.random.default_rng(seed).normal(size=6)
        matrix = Matrix.LocRotScale(values[:3], Euler(values[3:]), obj.matrix_world.to_scale())
        location, rotation, _ = transform_paths(obj)

        def set_and_key() -> None:
            obj = bpy.data.objects[name]
            obj.matrix_world = matrix
            for path in (location, rotation):
                obj.keyframe_insert(path, frame=frame)

        self._edit(set_and_key, self._inserted_keys_check(frame))
        now = expected_bases(bpy.data.objects[name], [frame])[0]
        size = max(1.0, np.abs(matrix).max())
        assert np.abs(now[:3, 3] - matrix.translation).max() < 2e-5 * size
        turned = Matrix(now.tolist()).to_quaternion().rotation_difference(matrix.to_quaternion())
        assert min(turned.angle, 2.0 * np.pi - turned.angle) < 1e-3, (
            f"{name} is at\n{now}\ninstead of\n{np.array(matrix)}"
        )

    @precondition(lambda self: not self.on)
    @rule(who=shares)
    def unlink_an_action_while_the_extension_is_off(self, who):
        obj = self._found(self._named(who))
        if self._is_free(obj) and obj.animation_data is not None:
            self.playing = None
            self._link(obj, None, None)
            bpy.context.view_layer.update()

    @precondition(lambda self: self.on and len(self.names) > 1)
    @rule(who=shares, other=shares)
    def swap_the_actions_of_two(self, who, other):
        names = [self._named(who), self._named(other)]
        objects = list(map(self._found, names))
        if len({obj.rotation_mode for obj in objects}) > 1 or not all(map(self._is_free, objects)):
            return
        if any(map(self._is_held, names)):
            return

        def swap() -> None:
            objects = list(map(self._found, names))
            for obj, linked in zip(objects, reversed(list(map(self._linked, objects))), strict=True):
                self._link(obj, *linked)

        self._edit(swap)

    @while_on(
        who=shares,
        start=st.integers(1, 60),
        scale=st.sampled_from((1.0, 2.0, 4.0)),
        which=st.none() | shares,
        seed=seeds,
    )
    def push_down_tweak_and_delete_the_strip(self, who, start, scale, which, seed):
        """In a strip the object moves as before, and follows edits of its keys."""
        obj = self._found(self._named(who))
        name, (action, slot) = obj.name, self._linked(obj)
        if action is None or not self._is_free(obj) or not len(key_frames(obj)) or goes_on(obj):
            return
        if self._is_held(name):
            return
        strip = push_down(obj, start)
        strip.scale = scale
        # Only in tweak mode is the Action the object's.
        tweak(obj, strip)
        fcurve = None if which is None else self._curve(obj, which)
        if fcurve is not None:
            self._set_a_value(fcurve, 0.0, seed)
            bpy.context.view_layer.update()
        own = np.round(8.0 * np.linspace(strip.action_frame_start, strip.action_frame_end, 9)[1:-1]) / 8.0
        expected = expected_bases(obj, own)
        frames = strip.frame_start + scale * (own - strip.action_frame_start)
        obj.animation_data.use_tweak_mode = False
        bpy.context.view_layer.update()
        error = np.abs(self._bases([name], frames)[name] - expected).max()
        assert error < 1e-4 * max(1.0, np.abs(expected).max()), f"{name} is off by {error:.3g} in a strip"
        obj.animation_data.nla_tracks.remove(obj.animation_data.nla_tracks[0])
        self._link(obj, action, slot)
        bpy.context.view_layer.update()
        # The edited state needs an undo step of its own.
        self._edit(lambda: None)


EditingObjects.TestCase.settings = SETTINGS
TestEdits = EditingObjects.TestCase
