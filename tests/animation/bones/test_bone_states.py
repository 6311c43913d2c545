"""Whatever is edited of rigs, in whatever order, bones move as their keys and modes say, and nothing stale is left."""

from __future__ import annotations

import operator
from collections.abc import Callable
from contextlib import suppress

import bpy
import numpy as np
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import initialize, precondition, rule

from rigid_motion import animation
from rigid_motion.animation.live.follower import show_seen_in_channels
from rigid_motion.animation.transforms import transform_of
from tests.animation.bones.coming_and_going import ComingAndGoing
from tests.animation.bones.poses import shown_poses
from tests.animation.bones.rig_editing import (
    BONES,
    TOLERANCE,
    Name,
    as_blender_has_it,
    has_live_segments,
    own_constraints,
)
from tests.animation.bones.rigs import ORDERS, new_rig, own_clipboard, pose_mode, write_bone
from tests.animation.editing import LAST, frames_in, mode_channel, seeds, shares
from tests.animation.keyed import MODE_IDS, key_frames, mode_at, transform_paths
from tests.animation.machine import goes_on
from tests.animation.oracle import expected_bases
from tests.animation.scenes import key, push_down, random_values, tweak
from tests.thoroughness import THOROUGH


class EditingBones(ComingAndGoing):
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
    @rule(which=st.sets(st.integers(0, 5), min_size=1), mode=st.sampled_from(MODE_IDS))
    def set_the_mode_of_several_bones(self, which, mode):
        names = [self.names[number % len(self.names)] for number in sorted(which)]
        self._edit(lambda: animation.set_mode([self._found(name) for name in names], mode))
        for name in names:
            assert {mode_at(self._found(name), frame) for frame in (1.0, 20.0)} == {mode}

    @precondition(lambda self: self.on)
    @rule(who=shares, mode=st.sampled_from(MODE_IDS))
    def choose_the_mode_by_its_property(self, who, mode):
        name = self._named(who)
        if mode_channel(self._found(name)) is not None:
            return
        self._edit(lambda: setattr(self._found(name).rigid_motion, "mode", mode))
        assert mode_at(self._found(name), 20.0) == mode

    @precondition(lambda self: self.on)
    @rule(who=shares, frame=frames_in)
    def key_the_mode(self, who, frame):
        rig, bone = self._named(who)
        path = f"{self._found((rig, bone)).path_from_id()}.rigid_motion.mode"
        frame = round(frame + self.shift)
        self._edit(lambda: bpy.data.objects[rig].keyframe_insert(path, frame=frame) and None)

    # Keys

    @precondition(lambda self: self.on)
    @rule(who=shares, seed=seeds, count=st.integers(1, 2))
    def set_values_and_key_them_in_one_go(self, who, seed, count):
        name, frame = self._named(who), bpy.context.scene.frame_current_final

        def change() -> None:
            bone = self._found(name)
            for path in transform_paths(bone)[:count]:
                setattr(bone, path, random_values(bone, path, 1, seed)[0])
                bone.keyframe_insert(path, frame=frame)

        self._edit(change, self._only_share_out_turns)

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
                fcurve.keyframe_points[int(at * len(fcurve.keyframe_points))].co_ui.y = np.random.default_rng(
                    seed
                ).normal()
                fcurve.update()
            bpy.context.view_layer.update()
        finally:
            animation.set_enabled(True)
        self._edit(lambda: animation.refresh() and None)

    @precondition(lambda self: self.on)
    @rule(who=shares, to=frames_in, keyed=st.booleans())
    def copy_a_pose_and_paste_it(self, who, to, keyed):
        name = self._named(who)
        rig, frame = bpy.data.objects[name[0]], round(to + self.shift)
        if self._sharing(name) != {name} or not self._is_exact(name):
            return
        bone = self._found(name)
        bpy.context.view_layer.update()
        seen = {name: self._basis(bone)}
        show_seen_in_channels([transform_of(bone)])
        self._assert_seen(rig, seen)
        copied = [getattr(bone, path).copy() for path in transform_paths(bone)]
        with own_clipboard(self.folder.name):
            self._in_pose_mode(name, bpy.ops.pose.copy)
            bpy.context.scene.frame_set(frame)
            bone = self._found(name)
            # With undo Blender would tell that it is the operator; a script is known by setting several properties.
            if sum(map(operator.ne, copied, [getattr(bone, path) for path in transform_paths(bone)])) < 2:
                return
            self._in_pose_mode(name, bpy.ops.pose.paste)
        self._assert_seen(rig, seen)
        settable = self._has_keys_for_any_pose(bone) and not any(
            constraint.mute for constraint in own_constraints(bone)
        )

        def insert() -> None:
            for path in transform_paths(bone):
                self._found(name).keyframe_insert(path, frame=frame)

        if keyed and name not in self.before_bake:
            self._edit(insert, self._only_share_out_turns)
            if settable:
                self._assert_seen(rig, seen)

    def _in_pose_mode(self, name: Name, act: Callable[[], set[str]]) -> None:
        pose_mode(bpy.data.objects[name[0]], name[1])
        assert act() == {"FINISHED"}
        bpy.ops.object.mode_set(mode="OBJECT")

    # Baking and reducing

    @precondition(lambda self: self.on)
    @rule(which=st.sets(st.integers(0, 5), min_size=1), step=st.sampled_from((1.0, 0.5, 3.0)))
    def bake(self, which, step):
        names = list(dict.fromkeys(self.names[number % len(self.names)] for number in sorted(which)))
        names = [name for name in names if self._sharing(name) == {name}]
        keyed = self._keyed()
        live = [name for name in names if has_live_segments(self._found(name))]
        frames = {name: self._frames_around(name, step) for name in live}
        before = {name: expected_bases(self._found(name), frames[name]) for name in live}
        refused: list[animation.Refused] = []
        self._edit(lambda: animation.bake([self._found(name) for name in names], step=step, refused=refused) and None)
        assert len(refused) == len(names) - len(live)
        for name in live:
            assert animation.is_baked(self._found(name))
            self.before_bake.setdefault(name, keyed[name])
            now = expected_bases(self._found(name), frames[name])
            size = max(1.0, np.abs(before[name]).max(initial=0.0))
            error = np.abs(now - before[name]).max(axis=(1, 2), initial=0.0) / size
            assert error.max() < 2e-5, f"{name} is baked otherwise on {frames[name][error > 2e-5]}: {error.max():.3g}"
        self.history[self.place] = self._remembered()

    def _frames_around(self, name: Name, step: float) -> np.ndarray:
        """The frames that get keys when a bone is baked, and its own."""
        bone = self._found(name)
        keys = key_frames(bone)
        if goes_on(bone):
            return keys
        return np.union1d(keys, np.arange(keys[0], keys[-1] + 1e-6, step))

    @precondition(lambda self: self.on)
    @rule(who=shares, mode=st.sampled_from(MODE_IDS[1:]), tolerance=st.sampled_from((0.05, 0.5)))
    def reduce_and_restore(self, who, mode, tolerance):
        name = self._named(who)
        if self._sharing(name) != {name}:
            return
        keyed, reduced = self._keyed(), []

        def reduce() -> None:
            with suppress(animation.Refused):
                reduced.append(animation.reduce_keys_of(self._found(name), mode, tolerance, 0.1))

        self._edit(reduce)
        assert {other: kept for other, kept in self._keyed().items() if other != name} == {
            other: kept for other, kept in keyed.items() if other != name
        }
        assert animation.is_reduced(self._found(name)) == bool(reduced)
        self.everything_is_where_it_has_to_be()
        if reduced:
            self._edit(lambda: animation.restore_keys(self._found(name)))
        assert self._keyed() == keyed

    # Constraints

    @precondition(lambda self: self.on)
    @rule(who=shares, what=st.sampled_from(("mute", "remove", "move down", "put on")))
    def handle_the_constraint(self, who, what):
        name = self._named(who)
        bone = self._found(name)
        constraint = next(iter(own_constraints(bone)), None)
        if constraint is None:
            return

        def change() -> None:
            bone = self._found(name)
            (constraint,) = own_constraints(bone)
            if what == "mute":
                constraint.mute = not constraint.mute
            elif what == "remove":
                bone.constraints.remove(constraint)
            elif what == "put on":
                bone.constraints.new("LIMIT_LOCATION")
            else:
                place = bone.constraints.find(constraint.name)
                bone.constraints.move(place, len(bone.constraints) - 1)

        if what == "remove":
            self.taken_off.add(name)
        self._edit(change)

    @precondition(lambda self: self.on and self.taken_off)
    @rule(who=shares, mode=st.sampled_from(MODE_IDS))
    def choose_a_mode_anew_where_it_was_taken_off(self, who, mode):
        name = sorted(self.taken_off)[int(who * len(self.taken_off))]
        self._edit(lambda: animation.set_mode(self._found(name), "BLENDER"))
        assert len(self._sharing(name)) > 1 or name not in self.taken_off
        self._edit(lambda: animation.set_mode(self._found(name), mode))

    @precondition(lambda self: self.on)
    @rule(who=shares, influence=st.sampled_from((0.0, 0.25, 0.75)))
    def weaken_the_constraint_and_back(self, who, influence):
        name = self._named(who)
        bone = self._found(name)
        constraint = next(iter(own_constraints(bone)), None)
        if constraint is None or constraint.mute or self._is_at_odds(name):
            return
        constraint.influence = influence
        bpy.context.view_layer.update()
        frames = np.array(self._frames_that_are_seen([bone])[::7], dtype=np.float64)
        (shown,) = shown_poses([bone.id_data], frames)
        native, expected = (self._placed(bone, shown, how(bone, frames)) for how in (as_blender_has_it, expected_bases))
        between = native[:, :3, 3] + influence * (expected - native)[:, :3, 3]
        error = np.abs(shown[bone.name][:, :3, 3] - between).max()
        assert error < 2 * TOLERANCE * max(1.0, np.abs(expected).max(), np.abs(native).max()), (
            f"{name} is off by {error}"
        )
        (constraint,) = own_constraints(self._found(name))
        constraint.influence = 1.0
        bpy.context.view_layer.update()

    # Actions that go and come

    @precondition(lambda self: self.on)
    @rule(who=shares, updated=st.booleans(), there=frames_in)
    def unlink_the_action_and_choose_it_again(self, who, updated, there):
        rig = bpy.data.objects[self._named(who)[0]]
        if not self._is_free(rig.name):
            return
        action, slot = self._linked(rig)
        self._link(rig, None, None)
        if updated:
            bpy.context.view_layer.update()
            assert not any(own_constraints(bone) for bone in rig.pose.bones)
            bpy.context.scene.frame_set(int(there + self.shift))
        self._link(rig, action, slot)
        bpy.context.view_layer.update()

    @precondition(lambda self: self.on and len(self._rigs()) > 1)
    @rule()
    def swap_the_actions_of_two_rigs(self):
        names = [rig.name for rig in self._rigs()][:2]
        turning = [{bone.name: bone.rotation_mode for bone in bpy.data.objects[name].pose.bones} for name in names]
        if turning[0] != turning[1] or not all(map(self._is_free, names)):
            return

        self._edit(lambda: self._swap_actions(names))

    @precondition(lambda self: self.on)
    @rule(
        who=shares,
        start=st.integers(1, 60),
        scale=st.sampled_from((1.0, 2.0, 4.0)),
        which=st.none() | shares,
        seed=seeds,
    )
    def push_down_edit_and_delete_the_strip(self, who, start, scale, which, seed):
        name = self._named(who)
        rig = bpy.data.objects[name[0]]
        action, slot = self._linked(rig)
        if action is None or not self._is_free(rig.name) or not any(len(key_frames(bone)) for bone in rig.pose.bones):
            return
        strip = push_down(rig, start)
        strip.scale = scale
        # Only in tweak mode the Action is the rig's.
        tweak(rig, strip)
        fcurve = None if which is None else self._curve(self._found(name), which)
        if fcurve is not None:
            fcurve.keyframe_points[0].co_ui.y = np.random.default_rng(seed).normal()
            fcurve.update()
            bpy.context.view_layer.update()
        first, last = np.ceil(strip.action_frame_start), np.floor(strip.action_frame_end)
        own = np.arange(first, last + 1.0, max(1.0, (last - first) // 8))
        own = np.union1d(own, own[:-1] + 0.25)
        motions = {bone.name: self._motion(bone, own) for bone in rig.pose.bones}
        frames = strip.frame_start + scale * (own - strip.action_frame_start)
        rig.animation_data.use_tweak_mode = False
        bpy.context.view_layer.update()
        self._assert_placed(rig, frames, motions, 10 * TOLERANCE)
        bpy.context.scene.frame_set(start + 5)
        rig.animation_data.nla_tracks.remove(rig.animation_data.nla_tracks[0])
        bpy.context.view_layer.update()
        assert not any(own_constraints(bone) for bone in rig.pose.bones)
        self._link(rig, action, slot)
        bpy.context.view_layer.update()
        # What was edited needs an undo step of its own.
        self._edit(lambda: None)


EditingBones.TestCase.settings = settings(
    max_examples=40 if THOROUGH else 6,
    stateful_step_count=25,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
)
TestBoneEdits = EditingBones.TestCase
