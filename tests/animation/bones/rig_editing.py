"""The bones of rigs as what is edited, where they have to be, and what may be in their Actions."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import ClassVar, NamedTuple

import bpy
import numpy as np
from hypothesis.stateful import invariant, precondition

from rigid_motion import animation
from tests.animation.bones.poses import shown_poses
from tests.animation.bones.rigs import CONSTRAINT, Rest
from tests.animation.edit_steps import TakenAway
from tests.animation.editing import Editing
from tests.animation.keyed import WIDTHS, curves_of, key_frames, mode_at, transform_paths
from tests.animation.machine import goes_on
from tests.animation.oracle import expected_bases, shortest_quaternion

BONES = (
    Rest("Body", (0.1, -0.2, 0.9), (0.15, -0.1, 1.4), roll=0.4),
    Rest("Arm", (0.3, 0.0, 1.4), (0.6, 0.1, 1.3), "Body", roll=-1.1),
    Rest("Prop", (-0.5, 0.3, 0.2), (-0.4, 0.3, 0.6), roll=0.9),
)
"""A chain of two bones, and one that nothing moves but its keys."""

TOLERANCE = 1e-5

Name = tuple[str, str]
"""Of a rig, and of a bone of it."""


def has_live_segments(bone: bpy.types.PoseBone) -> bool:
    return any(mode_at(bone, frame) != "BLENDER" for frame in key_frames(bone)[:-1])


def as_blender_has_it(bone: bpy.types.PoseBone, frames: Iterable[float]) -> np.ndarray:
    """Where its channels alone move a bone, matrices of (m, 4, 4)."""
    return expected_bases(bone, frames, keys=np.empty(0))


def smallest_scale(bone: bpy.types.PoseBone, frames: Iterable[float]) -> np.ndarray:
    """The smallest scale of a bone by its channels, and of its parents, along any axis; at most 1."""
    least = np.ones(len(frames))
    for item in (bone, *bone.parent_recursive):
        curves = curves_of(item)
        for index, rest in enumerate(item.scale):
            fcurve = curves.get(("scale", index))
            keyed = fcurve is not None and len(fcurve.keyframe_points) and not fcurve.mute
            least = np.minimum(least, [fcurve.evaluate(frame) for frame in frames] if keyed else rest)
    return least


def own_constraints(bone: bpy.types.PoseBone) -> list[bpy.types.Constraint]:
    return [constraint for constraint in bone.constraints if constraint.name.startswith(CONSTRAINT)]


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


class Motion(NamedTuple):
    """What moves a bone in the space of its channels on m frames."""

    desired: np.ndarray
    """Matrices (m, 4, 4)."""

    native: np.ndarray
    """The same as Blender has it."""

    precision: np.ndarray
    """What part of single precision is left of its directions, (m,); 0 where Blender loses them.

    Blender takes a constraint's bone apart: what is mirrored or has no size loses its way of turning there.
    """


class RigEditing(TakenAway, Editing):
    """An animator at work on the bones of rigs: what every edit is checked by."""

    KEPT: ClassVar = (*Editing.KEPT, "taken_off")

    def __init__(self) -> None:
        super().__init__()
        self.taken_off: set[Name] = set()
        """The bones whose constraints somebody took off."""

    def _found(self, name: Name) -> bpy.types.PoseBone:
        rig, bone = name
        return bpy.data.objects[rig].pose.bones[bone]

    def _animated(self, name: Name) -> bpy.types.Object:
        return bpy.data.objects[name[0]]

    def _is_exact(self, name: Name) -> bool:
        frames = np.array([bpy.context.scene.frame_current_final])
        chain = (self._found(name), *self._found(name).parent_recursive)
        return all(self._motion(bone, frames).precision[0] > 0.2 for bone in chain)

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

    # What holds all the time

    def _motion(self, bone: bpy.types.PoseBone, frames: np.ndarray, how: Callable = expected_bases) -> Motion:
        """What was muted or taken off does not move a bone."""
        is_off = (bone.id_data.name, bone.name) in self.taken_off or any(
            constraint.mute for constraint in own_constraints(bone)
        )
        native, scale = as_blender_has_it(bone, frames), smallest_scale(bone, frames)
        precision = shortest_quaternion(bone, frames) * np.where(scale > 0.02, scale, 0.0)
        return Motion(native if is_off else how(bone, frames), native, precision)

    def _is_at_odds(self, name: Name) -> bool:
        """Whether another rig that moves by the same Action has this bone otherwise where nothing is keyed."""
        bone = self._found(name)
        keyed = {
            channel for channel, fcurve in curves_of(bone).items() if len(fcurve.keyframe_points) and not fcurve.mute
        }
        others = [self._found(other) for other in self._sharing(name) - {name}]
        return any(
            getattr(other, path)[index] != getattr(bone, path)[index]
            for other in others
            for path in transform_paths(bone)
            for index in range(WIDTHS[path])
            if (path, index) not in keyed
        )

    def _placed(self, bone: bpy.types.PoseBone, shown: dict[str, np.ndarray], bases: np.ndarray) -> np.ndarray:
        return carried_by(bone, None if bone.parent is None else shown[bone.parent.name]) @ bases

    def _assert_placed(
        self,
        rig: bpy.types.Object,
        frames: np.ndarray,
        motions: dict[str, Motion],
        tolerance: float = TOLERANCE,
        shown: dict[str, np.ndarray] | None = None,
    ) -> None:
        """Bones are at these matrices in the space of their channels, on top of what carries them as it is shown."""
        shown = shown or shown_poses([rig], frames)[0]
        for name, motion in motions.items():
            bone = rig.pose.bones[name]
            placed, native = (self._placed(bone, shown, bases) for bases in (motion.desired, motion.native))
            size = max(1.0, np.abs(placed).max(initial=0.0), np.abs(native).max(initial=0.0))
            error = np.abs(shown[name] - placed).max(axis=(1, 2), initial=0.0) / size * motion.precision
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
            bones = [bone for bone in rig.pose.bones if not self._is_at_odds((rig.name, bone.name))]
            motions = {bone.name: self._motion(bone, frames) for bone in bones}
            self._assert_placed(rig, frames, motions, shown=shown)

    @precondition(lambda self: self.on and self.history)
    @invariant()
    def between_whole_frames_and_on_keys_there_bones_are_where_they_have_to_be(self):
        rig = self._rigs()[-1]
        bones = [
            bone
            for bone in rig.pose.bones
            if len(key_frames(bone)) > 1 and not goes_on(bone) and not self._is_at_odds((rig.name, bone.name))
        ]
        if bones:
            keys = key_frames(bones[0])
            whole = np.arange(np.ceil(keys[0]), np.floor(keys[-1]))
            frames = np.unique((*(whole[:: max(1, len(whole) // 6)] + 0.25), *keys[keys % 1.0 > 0.0][:6]))
            motions = {bone.name: self._motion(bone, frames) for bone in bones}
            self._assert_placed(rig, frames, motions, 10 * TOLERANCE)

    @precondition(lambda self: self.on and self.history)
    @invariant()
    def constraints_are_those_of_the_action_in_use(self):
        for rig in self._rigs():
            action, _ = self._linked(rig)
            for bone in rig.pose.bones:
                result = own_constraints(bone)
                assert len(result) <= int(has_live_segments(bone)), f"{bone.name} of {rig.name}"
                for constraint in result:
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
                    is_of_extension = bag.slot_handle in slots or CONSTRAINT in fcurve.data_path
                    path = fcurve.data_path[: fcurve.data_path.find('"]') + 2]
                    if is_of_extension and path.startswith("pose"):
                        # What a bone leaves behind that is deleted is Blender's to keep.
                        assert path in live or path not in present, f"{fcurve.data_path} is left in {action.name}"
                    elif len(fcurve.keyframe_points):
                        keyed.append(fcurve.range())
            assert len(slots) <= 1
            if keyed:
                begin, end = min(first for first, _ in keyed), max(last for _, last in keyed)
                assert tuple(action.frame_range) == (begin, end if end > begin else begin + 1.0), action.name

    @precondition(lambda self: self.on and self.history)
    @invariant()
    def nothing_is_wrong(self):
        fine = [name for name in self.names if not self._is_at_odds(name)]
        assert {animation.problem_of(self._found(name)) for name in fine} <= {""}
