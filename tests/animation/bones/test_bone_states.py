"""Whatever is edited of rigs, in whatever order, bones move as their keys and modes say, and nothing stale is left."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import ClassVar

import bpy
import numpy as np
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import initialize, invariant, precondition, rule

from addon import animation
from tests.animation.bones.poses import shown_poses
from tests.animation.bones.rigs import CONSTRAINT, Rest, new_rig, with_edit_bones, write_bone
from tests.animation.editing import LAST, ORDERS, Editing, frames_in, goes_on, seeds, shares
from tests.animation.oracle import (
    MODE_IDS,
    WIDTHS,
    curves_of,
    expected_bases,
    expected_off_whole_frames,
    key_frames,
    mode_at,
    shortest_quaternion,
    transform_paths,
)
from tests.animation.scenes import key, push_down, random_values
from tests.thoroughness import tried

BONES = (
    Rest("Body", (0.1, -0.2, 0.9), (0.15, -0.1, 1.4), roll=0.4),
    Rest("Arm", (0.3, 0.0, 1.4), (0.6, 0.1, 1.3), "Body", roll=-1.1),
    Rest("Prop", (-0.5, 0.3, 0.2), (-0.4, 0.3, 0.6), roll=0.9),
)
"""A chain of two bones, and one that nothing moves but its keys."""

TOLERANCE = 1e-5

Name = tuple[str, str]
"""Of a rig, and of a bone of it."""


def mode_channel(bone: bpy.types.PoseBone) -> bpy.types.FCurve | None:
    """The mode channel where it has keys, muted or not."""
    fcurve = curves_of(bone).get(("rigid_motion.mode", 0))
    return fcurve if fcurve is not None and len(fcurve.keyframe_points) else None


def has_live_segments(bone: bpy.types.PoseBone) -> bool:
    return any(mode_at(bone, frame) != "BLENDER" for frame in key_frames(bone)[:-1])


def as_blender_has_it(bone: bpy.types.PoseBone, frames: Iterable[float]) -> np.ndarray:
    """Where its channels alone move a bone, matrices of (m, 4, 4)."""
    return expected_bases(bone, frames, keys=np.empty(0))


def smallest_scale(bone: bpy.types.PoseBone, frames: Iterable[float]) -> np.ndarray:
    """The smallest scale of a bone by its channels, and of its parents, along any axis; at most 1."""
    least = np.ones(len(frames))
    for one in (bone, *bone.parent_recursive):
        curves = curves_of(one)
        for index, rest in enumerate(one.scale):
            fcurve = curves.get(("scale", index))
            keyed = fcurve is not None and len(fcurve.keyframe_points) and not fcurve.mute
            least = np.minimum(least, [fcurve.evaluate(frame) for frame in frames] if keyed else rest)
    return least


def own_constraints(bone: bpy.types.PoseBone) -> list[bpy.types.Constraint]:
    return [one for one in bone.constraints if one.name.startswith(CONSTRAINT)]


def channelbags(action: bpy.types.Action) -> list[bpy.types.ActionChannelbag]:
    return [bag for layer in action.layers for strip in layer.strips for bag in strip.channelbags]


def slots_of_differences(action: bpy.types.Action) -> list[bpy.types.ActionSlot]:
    return [slot for slot in action.slots if slot.name_display.startswith(CONSTRAINT)]


def carried_by(bone: bpy.types.PoseBone, parent: np.ndarray) -> np.ndarray:
    """What a bone is moved in, in the armature's space, where its parent is at these matrices (m, 4, 4)."""
    rest = np.array(bone.bone.matrix_local, dtype=np.float64)
    if bone.parent is None:
        return rest
    return parent @ np.linalg.inv(np.array(bone.parent.bone.matrix_local, dtype=np.float64)) @ rest


class EditingBones(Editing):
    """An animator at work on the bones of rigs."""

    KEPT: ClassVar = (*Editing.KEPT, "taken_off")

    def __init__(self) -> None:
        super().__init__()
        self.taken_off: set[Name] = set()
        """The bones whose constraints somebody took off."""

    @initialize(
        orders=st.lists(st.sampled_from(ORDERS), min_size=3, max_size=3),
        scales=st.lists(st.sampled_from((None, "even", "uneven")), min_size=3, max_size=3),
        modes=st.lists(st.sampled_from(MODE_IDS), min_size=3, max_size=3),
        rig_mode=st.none() | st.sampled_from(MODE_IDS),
        shift=st.sampled_from((0.0, 0.0, -20.0, -60.0)),
        seed=seeds,
    )
    def begin(self, orders, scales, modes, rig_mode, shift, seed):
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
        bpy.context.view_layer.update()
        self._start_history()

    def _found(self, name: Name) -> bpy.types.PoseBone:
        rig, bone = name
        return bpy.data.objects[rig].pose.bones[bone]

    def _basis(self, bone: bpy.types.PoseBone) -> np.ndarray:
        evaluated = bone.id_data.evaluated_get(bpy.context.evaluated_depsgraph_get()).pose.bones[bone.name]
        parent = None if bone.parent is None else np.array(evaluated.parent.matrix, dtype=np.float64)
        return np.linalg.solve(carried_by(bone, parent), np.array(evaluated.matrix, dtype=np.float64))

    def _rigs(self) -> list[bpy.types.Object]:
        return [bpy.data.objects[name] for name in sorted({rig for rig, _ in self.names})]

    def _sharing(self, name: Name) -> set[Name]:
        rig, bone = name
        return {(other, bone) for other in self._rigs_sharing(rig) if (other, bone) in self.names}

    def _rigs_sharing(self, name: str) -> set[str]:
        """The rigs that move by the same slot as this one, itself among them."""
        linked = self._linked(bpy.data.objects[name])
        return {name} | {rig.name for rig in self._rigs() if linked[0] is not None and self._linked(rig) == linked}

    def _is_free(self, rig: str) -> bool:
        """Whether its Action may be exchanged without losing a bake's way back, or leaving others behind."""
        own = {name for name in self.names if name[0] == rig}
        return self._rigs_sharing(rig) == {rig} and not own & (self.before_bake.keys() | self.taken_off)

    def _edit(self, change, settle=None) -> None:
        super()._edit(change, settle)
        # Without in-betweens there is nothing to be taken off, and what comes anew is put on.
        gone = {name for name in self.taken_off if not self._has_differences(name)}
        if gone:
            self.taken_off -= gone
            if self.on:
                self.history[self.place] = self._remembered()

    def _has_differences(self, name: Name) -> bool:
        bone = self._found(name)
        action, _ = self._linked(bone.id_data)
        handles = {slot.handle for slot in slots_of_differences(action)} if action is not None else ()
        bags = [bag for bag in channelbags(action) if bag.slot_handle in handles] if handles else ()
        return any(curve.data_path.startswith(f"{bone.path_from_id()}.") for bag in bags for curve in bag.fcurves)

    def _has_keys_for_any_pose(self, bone: bpy.types.PoseBone) -> bool:
        """What is not keyed, or muted, beside other channels of the same property has no key to get a value."""
        keyed = {name for name, fcurve in curves_of(bone).items() if len(fcurve.keyframe_points) and not fcurve.mute}
        return all(
            {(path, index) in keyed for index in range(WIDTHS[path])} in ({True}, {False})
            for path in transform_paths(bone)
        )

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

    @rule(who=shares, at=shares, mode=st.none() | st.sampled_from(MODE_IDS))
    def mute_the_mode_channel_or_change_a_key_of_it(self, who, at, mode):
        name = self._named(who)

        def change() -> None:
            fcurve = mode_channel(self._found(name))
            if fcurve is None:
                return
            if mode is None:
                fcurve.mute = not fcurve.mute
            else:
                fcurve.keyframe_points[int(at * len(fcurve.keyframe_points))].co_ui.y = MODE_IDS.index(mode)
                fcurve.update()

        self._edit(change)

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

        self._edit(change)

    @rule(who=shares, which=shares)
    def mute_a_channel(self, who, which):
        name = self._named(who)

        def change() -> None:
            fcurve = self._curve(self._found(name), which)
            if fcurve is not None:
                fcurve.mute = not fcurve.mute

        self._edit(change)

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

    @precondition(lambda self: self.on)
    @rule(who=shares, influence=st.sampled_from((0.0, 0.25, 0.75)))
    def weaken_the_constraint_and_back(self, who, influence):
        name = self._named(who)
        bone = self._found(name)
        constraint = next(iter(own_constraints(bone)), None)
        if constraint is None or constraint.mute:
            return
        constraint.influence = influence
        bpy.context.view_layer.update()
        frames = np.arange(2.0, 36.0, 7.0) + self.shift
        (shown,) = shown_poses([bone.id_data], frames)
        native, wanted = (self._placed(bone, shown, how(bone, frames)) for how in (as_blender_has_it, expected_bases))
        between = native[:, :3, 3] + influence * (wanted - native)[:, :3, 3]
        error = np.abs(shown[bone.name][:, :3, 3] - between).max()
        assert error < 2 * TOLERANCE * max(1.0, np.abs(wanted).max(), np.abs(native).max()), f"{name} is off by {error}"
        (constraint,) = own_constraints(self._found(name))
        constraint.influence = 1.0
        bpy.context.view_layer.update()

    # Bones that come and go

    @precondition(lambda self: self.on)
    @rule(who=shares)
    def rename_a_bone(self, who):
        name = self._named(who)
        rig, old = name
        if not self._is_free(rig):
            return
        new, self.fresh = f'Renamed "{self.fresh}"', self.fresh + 1
        keyed = self._keyed()[name]

        def change() -> None:
            bpy.data.objects[rig].data.bones[old].name = new
            self.names[self.names.index(name)] = (rig, new)

        self._edit(change)
        assert self._keyed()[rig, new] == keyed

    @precondition(lambda self: self.on and len(self.names) < 7)
    @rule(who=shares)
    def duplicate_a_bone(self, who):
        rig, bone = self._named(who)
        if not self._is_free(rig):
            return
        before = set(bpy.data.objects[rig].pose.bones.keys())

        def duplicate(edit_bones: bpy.types.ArmatureEditBones) -> None:
            for edit_bone in edit_bones:
                edit_bone.select = edit_bone.select_head = edit_bone.select_tail = edit_bone.name == bone
            bpy.ops.armature.duplicate()

        def change() -> None:
            with_edit_bones(bpy.data.objects[rig], duplicate)
            self.names += [(rig, made) for made in sorted(set(bpy.data.objects[rig].pose.bones.keys()) - before)]

        self._edit(change)
        assert len(bpy.data.objects[rig].pose.bones) == len(before) + 1

    @precondition(lambda self: self.on and len(self.names) > 2)
    @rule(who=shares)
    def delete_a_bone(self, who):
        rig, bone = self._named(who)
        if not self._is_free(rig) or len(bpy.data.objects[rig].pose.bones) < 2:
            return

        def change() -> None:
            with_edit_bones(bpy.data.objects[rig], lambda edit_bones: edit_bones.remove(edit_bones[bone]))
            self.names.remove((rig, bone))

        self._edit(change)

    @precondition(lambda self: self.on and len(self.names) < 6)
    @rule(who=shares, copied=st.booleans())
    def copy_a_rig(self, who, copied):
        rig, _ = self._named(who)
        if not self._is_free(rig):
            return
        new, self.fresh = f"Copy {self.fresh}", self.fresh + 1

        def change() -> None:
            obj = bpy.data.objects[rig]
            made = obj.copy()
            made.name, made.data = new, obj.data.copy()
            bpy.context.scene.collection.objects.link(made)
            action, slot = self._linked(obj)
            if copied and action is not None:
                made.animation_data.action = action.copy()
                made.animation_data.action_slot = made.animation_data.action.slots[slot.identifier]
            self.names += [(new, bone.name) for bone in made.pose.bones]

        self._edit(change)

    # Actions that go and come

    @staticmethod
    def _linked(obj: bpy.types.Object) -> tuple:
        data = obj.animation_data
        return (None, None) if data is None or data.action is None else (data.action, data.action_slot)

    @staticmethod
    def _link(obj: bpy.types.Object, action: bpy.types.Action | None, slot: bpy.types.ActionSlot | None) -> None:
        data = obj.animation_data_create()
        data.action = action
        if action is not None:
            data.action_slot = slot

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

        def swap() -> None:
            first, second = (bpy.data.objects[name] for name in names)
            of_first, of_second = self._linked(first), self._linked(second)
            self._link(first, *of_second)
            self._link(second, *of_first)

        self._edit(swap)

    @precondition(lambda self: self.on)
    @rule(who=shares, start=st.integers(1, 60), scale=st.sampled_from((1.0, 2.0)))
    def push_down_and_delete_the_strip(self, who, start, scale):
        rig = bpy.data.objects[self._named(who)[0]]
        action, slot = self._linked(rig)
        if action is None or not self._is_free(rig.name) or not any(len(key_frames(bone)) for bone in rig.pose.bones):
            return
        first, last = np.ceil(action.frame_range[0]), np.floor(action.frame_range[1])
        own = np.arange(first, last + 1.0, max(1.0, (last - first) // 8))
        wanted = {bone.name: self._wanted(bone, own) for bone in rig.pose.bones}
        strip = push_down(rig, start)
        strip.scale = scale
        bpy.context.view_layer.update()
        frames = strip.frame_start + scale * (own - strip.action_frame_start)
        self._assert_placed(rig, frames, wanted)
        bpy.context.scene.frame_set(start + 5)
        rig.animation_data.nla_tracks.remove(rig.animation_data.nla_tracks[0])
        bpy.context.view_layer.update()
        assert not any(own_constraints(bone) for bone in rig.pose.bones)
        self._link(rig, action, slot)
        bpy.context.view_layer.update()

    # What holds all the time

    def _wanted(self, bone: bpy.types.PoseBone, frames: np.ndarray, how: Callable = expected_bases) -> np.ndarray:
        """What moves a bone in the space of its channels: what was muted or taken off does not."""
        is_off = (bone.id_data.name, bone.name) in self.taken_off or any(one.mute for one in own_constraints(bone))
        return as_blender_has_it(bone, frames) if is_off else how(bone, frames)

    def _placed(self, bone: bpy.types.PoseBone, shown: dict[str, np.ndarray], bases: np.ndarray) -> np.ndarray:
        return carried_by(bone, None if bone.parent is None else shown[bone.parent.name]) @ bases

    def _assert_placed(
        self,
        rig: bpy.types.Object,
        frames: np.ndarray,
        wanted: dict[str, np.ndarray],
        tolerance: float = TOLERANCE,
        shown: dict[str, np.ndarray] | None = None,
    ) -> None:
        """Bones are at these matrices in the space of their channels, on top of what carries them as it is shown."""
        shown = shown or shown_poses([rig], frames)[0]
        for name, bases in wanted.items():
            bone = rig.pose.bones[name]
            placed = self._placed(bone, shown, bases)
            native = np.abs(self._placed(bone, shown, as_blender_has_it(bone, frames)))
            size = max(1.0, np.abs(placed).max(initial=0.0), native.max(initial=0.0))
            error = np.abs(shown[name] - placed).max(axis=(1, 2), initial=0.0) / size
            # Blender takes a constraint's bone apart: what is mirrored or has no size loses its way of turning there.
            scale = smallest_scale(bone, frames)
            error *= shortest_quaternion(bone, frames) * np.where(scale > 0.02, scale, 0.0)
            worst = int(np.argmax(error))
            assert error[worst] < tolerance, (
                f"{rig.name}, {name} ({bone.rotation_mode}) is off by {error[worst]:.3g} of its size on frame "
                f"{frames[worst]} (keys on {key_frames(bone)}):\n{shown[name][worst]}\ninstead of\n{placed[worst]}"
            )

    @precondition(lambda self: self.on and self.history)
    @invariant()
    def everything_is_where_it_has_to_be(self):
        rigs = self._rigs()
        frames = np.array(self._frames_that_are_seen([self._found(name) for name in self.names]), dtype=np.float64)
        for rig, shown in zip(rigs, shown_poses(rigs, frames), strict=True):
            wanted = {bone.name: self._wanted(bone, frames) for bone in rig.pose.bones}
            self._assert_placed(rig, frames, wanted, shown=shown)

    @precondition(lambda self: self.on and self.history)
    @invariant()
    def between_whole_frames_it_is_as_blender_has_it_from_one_to_the_next(self):
        rig = self._rigs()[-1]
        bones = [
            bone
            for bone in rig.pose.bones
            if bone.rotation_mode == "QUATERNION" and len(key_frames(bone)) > 1 and not goes_on(bone)
        ]
        if bones:
            keys = key_frames(bones[0])
            whole = np.arange(np.ceil(keys[0]), np.floor(keys[-1]))
            frames = whole[:: max(1, len(whole) // 6)] + 0.25
            wanted = {bone.name: self._wanted(bone, frames, expected_off_whole_frames) for bone in bones}
            self._assert_placed(rig, frames, wanted, 10 * TOLERANCE)

    @precondition(lambda self: self.on and self.history)
    @invariant()
    def constraints_are_those_of_the_action_in_use(self):
        for rig in self._rigs():
            action, _ = self._linked(rig)
            for bone in rig.pose.bones:
                found = own_constraints(bone)
                assert len(found) <= int(has_live_segments(bone)), f"{bone.name} of {rig.name}"
                for constraint in found:
                    assert constraint.action == action
                    assert constraint.action_slot in slots_of_differences(action)

    @precondition(lambda self: self.on and self.history)
    @invariant()
    def nothing_is_left_in_actions_of_what_has_no_mode(self):
        rigs = self._rigs()
        for action in {self._linked(rig)[0] for rig in rigs} - {None}:
            users = [rig for rig in rigs if self._linked(rig)[0] == action]
            live = {bone.path_from_id() for rig in users for bone in rig.pose.bones if has_live_segments(bone)}
            present = {bone.path_from_id() for rig in users for bone in rig.pose.bones}
            slots = {slot.handle for slot in slots_of_differences(action)}
            keyed = []
            for bag in channelbags(action):
                assert bag.slot_handle not in slots or len(bag.fcurves), f"an empty slot is left in {action.name}"
                for fcurve in bag.fcurves:
                    is_ours = bag.slot_handle in slots or CONSTRAINT in fcurve.data_path
                    path = fcurve.data_path[: fcurve.data_path.find('"]') + 2]
                    if is_ours and path.startswith("pose"):
                        # What a bone leaves behind that is deleted is Blender's to keep.
                        assert path in live or path not in present, f"{fcurve.data_path} is left in {action.name}"
                    elif len(fcurve.keyframe_points):
                        keyed.append(fcurve.range())
            assert len(slots) <= 1
            if keyed:
                begin, end = min(first for first, _ in keyed), max(last for _, last in keyed)
                assert tuple(action.frame_range) == (begin, end if end > begin else begin + 1.0)

    @precondition(lambda self: self.on and self.history)
    @invariant()
    def nothing_is_wrong(self):
        assert {animation.problem_of(self._found(name)) for name in self.names} == {""}


EditingBones.TestCase.settings = settings(
    max_examples=tried(40),
    stateful_step_count=25,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
)
TestBoneEdits = EditingBones.TestCase
