"""Whatever is edited of objects, in whatever order, in-betweens are what a fresh computation gives, keys as keyed."""

from __future__ import annotations

from contextlib import suppress

import bpy
import numpy as np
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import initialize, invariant, precondition, rule
from mathutils import Euler, Matrix

from rigid_motion import animation
from tests.animation.edit_steps import TakenAway
from tests.animation.editing import LAST, ORDERS, seeds, shares
from tests.animation.following.exchanging import Exchanging
from tests.animation.keyed import MODE_IDS, WIDTHS, curves_of, key_frames, mode_at, snapshot, transform_paths
from tests.animation.oracle import (
    Own,
    as_quaternion,
    assert_shown,
    expected_bases,
    expected_worlds,
    shown_worlds,
    unit,
)
from tests.animation.scenes import give_own_deltas, key, new_object, own_deltas, random_values
from tests.thoroughness import THOROUGH


class EditingObjects(TakenAway, Exchanging):
    """An animator at work on a few objects, by their names."""

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
            self.owns[obj.name] = give_own_deltas(obj, seed + number) if with_own else own_deltas(obj)
            self.turned[obj.name] = tuple(obj.delta_rotation_quaternion), tuple(obj.delta_rotation_euler)
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

    def _animated(self, name: str) -> bpy.types.Object:
        return self._found(name)

    def _is_exact(self, name: str) -> bool:
        # Blender itself bakes the delta transforms of Euler angles wrongly.
        is_turned = np.abs(np.abs(self.owns[name].quaternion) - (1.0, 0.0, 0.0, 0.0)).max() > 1e-6
        return self._found(name).rotation_mode == "QUATERNION" or not is_turned

    def _basis(self, obj: bpy.types.Object) -> np.ndarray:
        return np.array(obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_basis)

    @precondition(lambda self: self.on)
    @rule(who=shares, seed=seeds)
    def change_its_own_deltas(self, who, seed):
        name = self._object(who).name
        if len(self._sharing(name)) > 1:
            return
        random = np.random.default_rng(seed)
        location, scale = random.normal(size=3), np.full(3, np.exp(0.3 * random.normal()))

        def change() -> None:
            obj = bpy.data.objects[name]
            obj.delta_location, obj.delta_scale = location, scale

        self.owns[name] = Own(
            tuple(np.float32(location).tolist()), self.owns[name].quaternion, tuple(np.float32(scale).tolist())
        )
        self._edit(change)

    @precondition(lambda self: self.on)
    @rule(
        who=shares,
        step=st.sampled_from((1.0, 0.5, 3.0)),
        interpolation=st.sampled_from(("LINEAR", "CONSTANT")),
    )
    def bake(self, who, step, interpolation):
        obj = self._object(who)
        if len(self._sharing(obj.name)) > 1:
            return
        name, keyed, keys = obj.name, snapshot(obj), key_frames(obj)
        live = any(mode_at(obj, frame) != "BLENDER" for frame in keys[:-1])
        # Between whole frames a parent's own in-betweens are not quite what they have to be.
        every = np.arange(-2.0, LAST + 6.0, 0.5 if obj.parent is None else 1.0) + self.shift
        before = expected_worlds(obj, every, self.owns)
        baked: list = []

        def change() -> None:
            with suppress(animation.Refused):
                result = bpy.data.objects[name]
                baked.extend(animation.bake(result, step=step, interpolation=interpolation))

        self._edit(change)
        obj = bpy.data.objects[name]
        assert bool(baked) == live
        if not baked:
            assert snapshot(obj) == keyed
            return
        self.before_bake.setdefault(name, keyed)
        self.history[self.place] = self._remembered()
        assert animation.is_baked(obj)
        begin, end = baked
        # Up to a baked key off whole frames, what is left of the segment before it blends into that key's pose.
        kept = (every >= np.ceil(begin)) & (every <= np.floor(end)) & ((every - begin) % step == 0.0)
        shown, expected = shown_worlds([obj], every[kept])[0], before[kept]
        size = max(1.0, np.abs(expected).max(initial=0.0))
        for frame, now, then in zip(every[kept], shown, expected, strict=True):
            assert np.abs(now - then).max() < 2e-5 * size, (
                f"{name} is baked otherwise on frame {frame} (keys on {keys}, step {step}):\n{now}\ninstead of\n{then}"
            )

    @precondition(lambda self: self.on)
    @rule(who=shares, count=st.integers(2, 8))
    def reduce_to_a_number_and_restore(self, who, count):
        name = self._object(who).name
        if len(self._sharing(name)) > 1 or name in self.before_bake:
            return
        keyed, before = snapshot(bpy.data.objects[name]), len(key_frames(bpy.data.objects[name]))
        refused: list[animation.Refused] = []
        self._edit(lambda: animation.reduce_keys_of(bpy.data.objects[name], count=count, refused=refused))
        if refused:
            assert snapshot(bpy.data.objects[name]) == keyed
            return
        assert len(key_frames(bpy.data.objects[name])) < before
        self._edit(lambda: animation.restore_keys(bpy.data.objects[name]))
        assert snapshot(bpy.data.objects[name]) == keyed

    @precondition(lambda self: self.on)
    @rule(who=shares, order=st.sampled_from(ORDERS), rekeyed=st.booleans(), seed=seeds)
    def turn_in_another_way(self, who, order, rekeyed, seed):
        obj = self._object(who)
        name = obj.name
        if not self._is_free(name):
            return

        def change() -> None:
            obj = bpy.data.objects[name]
            obj.rotation_mode = order
            path = transform_paths(obj)[1]
            keys = key_frames(obj)
            if rekeyed and len(keys):
                for index, values in enumerate(random_values(obj, path, len(keys), seed).T):
                    fcurve = curves_of(obj).get((path, index)) or animation.channelbag_of(obj).fcurves.new(
                        path, index=index
                    )
                    for frame, value in zip(keys, values, strict=True):
                        fcurve.keyframe_points.insert(frame, value)

        quaternion, angles = self.turned[name]
        turned = unit(quaternion) if order == "QUATERNION" else (1.0, 0.0, 0.0, 0.0)
        if order not in ("QUATERNION", "AXIS_ANGLE"):
            turned = as_quaternion(angles, order)
        self.owns[name] = Own(self.owns[name].location, turned, self.owns[name].scale)
        self._edit(change)

    @precondition(lambda self: self.on)
    @rule(who=shares)
    def rename_an_object_and_its_action(self, who):
        old = self._object(who).name
        if old in self.before_bake or bpy.data.objects[old].children or bpy.data.objects[old].parent:
            return
        new, self.fresh = f"Renamed {self.fresh}", self.fresh + 1
        for kept in (self.owns, self.turned):
            kept[new] = kept.pop(old)
        self.names[self.names.index(old)] = new

        def rename() -> None:
            obj = bpy.data.objects[old]
            obj.name = new
            if obj.animation_data is not None and obj.animation_data.action is not None:
                obj.animation_data.action.name = f"{new} moves"

        self._edit(rename)

    @precondition(lambda self: self.on)
    @rule(who=shares, seed=seeds)
    def set_a_matrix_and_key_it_in_one_go(self, who, seed):
        obj, scene = self._object(who), bpy.context.scene
        frame, name = scene.frame_current_final, obj.name
        if obj.parent is not None or obj.matrix_world.is_negative:
            return
        # What is keyed in a muted channel is not seen.
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

        self._edit(set_and_key, self._completes(frame))
        now = expected_bases(bpy.data.objects[name], [frame], self.owns[name])[0]
        size = max(1.0, np.abs(matrix).max())
        assert np.abs(now[:3, 3] - matrix.translation).max() < 2e-5 * size
        turned = Matrix(now.tolist()).to_quaternion().rotation_difference(matrix.to_quaternion())
        assert min(turned.angle, 2.0 * np.pi - turned.angle) < 1e-3, (
            f"{name} is at\n{now}\ninstead of\n{np.array(matrix)}"
        )

    @precondition(lambda self: not self.on)
    @rule(who=shares)
    def unlink_an_action_while_the_extension_is_off(self, who):
        obj = self._object(who)
        if self._is_free(obj.name) and obj.animation_data is not None:
            self.playing = None
            self._link(obj, None, None)
            bpy.context.view_layer.update()

    # What holds all the time

    @precondition(lambda self: self.on and self.history)
    @invariant()
    def everything_is_where_it_has_to_be(self):
        objects = [bpy.data.objects[name] for name in self.names]
        assert_shown(objects, self._frames_that_are_seen(objects), self.owns)

    @precondition(lambda self: self.history)
    @invariant()
    def channels_are_all_that_moves_it(self):
        for name in self.names:
            obj = bpy.data.objects[name]
            assert np.abs(np.subtract(obj.delta_location, self.owns[name].location)).max() < 1e-6
            assert np.abs(np.subtract(obj.delta_scale, self.owns[name].scale)).max() < 1e-6
            assert not obj.constraints


EditingObjects.TestCase.settings = settings(
    max_examples=40 if THOROUGH else 6,
    stateful_step_count=25,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
)
TestEdits = EditingObjects.TestCase
