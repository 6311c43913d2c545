"""Whatever is edited of rigs, in whatever order, bones move as their keys and modes say, and nothing stale is left."""

from __future__ import annotations

import bpy
import numpy as np
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import initialize, precondition, rule

from rigid_motion import animation
from tests.animation.bones.poses import TOLERANCE
from tests.animation.bones.rig_editing import BONES, Name, RigEditing
from tests.animation.bones.rigs import ORDERS, new_rig, own_clipboard, pose_mode, write_bone
from tests.animation.editing import LAST, frames_in, seeds, shares
from tests.animation.keyed import MODE_IDS, key_frames, mode_at, transform_paths
from tests.animation.machine import goes_on
from tests.animation.oracle import expected_bases
from tests.animation.scenes import key, random_values
from tests.thoroughness import THOROUGH


class EditingBones(RigEditing):
    """An animator at work on the bones of rigs."""

    @initialize(
        orders=st.lists(st.sampled_from(ORDERS), min_size=3, max_size=3),
        scales=st.lists(st.sampled_from((None, "even", "uneven")), min_size=3, max_size=3),
        modes=st.lists(st.sampled_from(MODE_IDS), min_size=3, max_size=3),
        rig_mode=st.none() | st.sampled_from(MODE_IDS),
        second=st.sampled_from((None, None, "with the same Action", "with a copy of it")),
        shift=st.sampled_from((0.0, 0.0, -20.0, -60.0)),
        seed=seeds,
    )
    def begin(self, orders, scales, modes, rig_mode, second, shift, seed):
        bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, LAST
        self.shift = shift
        rig = new_rig("Rig", BONES)
        frames = np.array((1.0, 13.0, 26.0, 37.0)) + shift
        if rig_mode is not None:
            key(rig, frames, seed=seed)
            animation.set_mode(rig, rig_mode)
        for number, (bone, order, scale, mode) in enumerate(zip(rig.pose.bones, orders, scales, modes, strict=True)):
            bone.rotation_mode = order
            for path in transform_paths(bone)[: 3 if scale else 2]:
                values = random_values(bone, path, len(frames), seed + number, scale == "even")
                write_bone(bone, path, frames, values, "BEZIER")
            animation.set_mode(bone, mode)
        self.names = [(rig.name, bone.name) for bone in rig.pose.bones]
        if second is not None:
            self._copy(rig.name, "Second", copied=second == "with a copy of it")
        bpy.context.view_layer.update()
        self._start_history()

    # Modes

    @precondition(lambda self: self.on)
    @rule(which=st.sets(st.integers(0, 5), min_size=1), mode=st.sampled_from(MODE_IDS), by_property=st.booleans())
    def set_the_mode_of_several_bones(self, which, mode, by_property):
        names = [self.names[number % len(self.names)] for number in sorted(which)]

        def change() -> None:
            bones = [self._found(name) for name in names]
            if not by_property:
                animation.set_mode(bones, mode)
            for bone in bones if by_property else ():
                bone.rigid_motion.mode = mode

        self._edit(change)
        for name in names:
            assert {mode_at(self._found(name), frame) for frame in key_frames(self._found(name))} <= {mode}

    # Keys

    @precondition(lambda self: self.on)
    @rule(who=shares, order=st.sampled_from(ORDERS), rekeyed=st.booleans(), seed=seeds)
    def turn_in_another_way(self, who, order, rekeyed, seed):
        name = self._named(who)
        if self._sharing(name) != {name} or name in self.before_bake:
            return

        def change() -> None:
            bone = self._found(name)
            keys = key_frames(bone)
            bone.rotation_mode = order
            if rekeyed and len(keys):
                path = transform_paths(bone)[1]
                for frame, values in zip(keys, random_values(bone, path, len(keys), seed), strict=True):
                    setattr(bone, path, values)
                    bone.keyframe_insert(path, frame=frame)

        self._edit(change)

    @precondition(lambda self: self.on)
    @rule(who=shares, which=shares, at=shares, seed=seeds)
    def edit_while_nothing_is_followed(self, who, which, at, seed):
        animation.set_enabled(False)
        try:
            fcurve = self._curve(self._found(self._named(who)), which)
            if fcurve is not None:
                point = fcurve.keyframe_points[int(at * len(fcurve.keyframe_points))]
                point.co_ui.y = np.random.default_rng(seed).normal()
                fcurve.update()
            bpy.context.view_layer.update()
        finally:
            animation.set_enabled(True)
        self._edit(lambda: animation.refresh() and None)

    @precondition(lambda self: self.on)
    @rule(who=shares, to=frames_in, keyed=st.booleans())
    def copy_a_pose_and_paste_it(self, who, to, keyed):
        name, frame = self._named(who), round(to + self.shift)
        if self._sharing(name) != {name}:
            return
        bpy.context.view_layer.update()
        seen = {name: self._basis(self._found(name))}
        with own_clipboard(self.folder.name):
            self._in_pose_mode(name, bpy.ops.pose.copy)
            bpy.context.scene.frame_set(frame)
            self._in_pose_mode(name, bpy.ops.pose.paste)
        self._assert_in_place(seen)
        if not keyed or name in self.before_bake:
            return

        def insert() -> None:
            for path in transform_paths(self._found(name)):
                self._found(name).keyframe_insert(path, frame=frame)

        self._edit(insert, self._completes(frame))
        self._assert_in_place(seen)

    def _in_pose_mode(self, name: Name, operator: object) -> None:
        pose_mode(bpy.data.objects[name[0]], name[1])
        assert operator() == {"FINISHED"}
        bpy.ops.object.mode_set(mode="OBJECT")

    # Baking

    @precondition(lambda self: self.on)
    @rule(which=st.sets(st.integers(0, 5), min_size=1), step=st.sampled_from((1.0, 0.5, 3.0)))
    def bake(self, which, step):
        names = list(dict.fromkeys(self.names[number % len(self.names)] for number in sorted(which)))
        names = [name for name in names if self._sharing(name) == {name}]
        keyed, frames = self._keyed(), {}
        live = [name for name in names if self._is_live(name)]
        for name in live:
            keys = key_frames(self._found(name))
            steps = () if goes_on(self._found(name)) else np.arange(keys[0], keys[-1] + 1e-6, step)
            frames[name] = np.union1d(keys, steps)
        before = {name: expected_bases(self._found(name), frames[name]) for name in live}
        refused: list[animation.Refused] = []
        self._edit(
            lambda: animation.bake([self._found(name) for name in names], step=step, refused=refused) and None,
            lambda made, after: None,
        )
        assert len(refused) == len(names) - len(live)
        for name in live:
            assert animation.is_baked(self._found(name))
            self.before_bake.setdefault(name, keyed[name])
            now = expected_bases(self._found(name), frames[name])
            error = np.abs(now - before[name]).max(axis=(1, 2)) / max(1.0, np.abs(before[name]).max())
            assert error.max() < 2 * TOLERANCE, f"{name} is baked otherwise on {frames[name][error.argmax()]}"
        self.history[self.place] = self._remembered()

    def _is_live(self, name: Name) -> bool:
        bone = self._found(name)
        return any(mode_at(bone, frame) != "BLENDER" for frame in key_frames(bone)[:-1])


EditingBones.TestCase.settings = settings(
    max_examples=40 if THOROUGH else 6,
    stateful_step_count=25,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
)
TestBoneEdits = EditingBones.TestCase
