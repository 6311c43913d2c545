"""The bones of rigs as what is edited, and rigs that come and go, or whose bones get other names and are no more."""

from __future__ import annotations

import bpy
import numpy as np
from hypothesis import strategies as st
from hypothesis.stateful import invariant, precondition, rule

from tests.animation.bones.poses import TOLERANCE
from tests.animation.bones.rigs import Rest, with_edit_bones
from tests.animation.edit_steps import TakenAway
from tests.animation.editing import Editing, shares
from tests.animation.keyed import key_frames
from tests.animation.oracle import expected_bases, shortest_quaternion

BONES = (
    Rest("Body", (0.1, -0.2, 0.9), (0.15, -0.1, 1.4), roll=0.4),
    Rest("Arm", (0.3, 0.0, 1.4), (0.6, 0.1, 1.3), "Body", roll=-1.1, settings=(("use_local_location", False),)),
    Rest("Prop", (-0.5, 0.3, 0.2), (-0.4, 0.3, 0.6), roll=0.9),
)
"""A chain of two bones, and one that nothing moves but its keys."""

Name = tuple[str, str]
"""Of a rig, and of a bone of it."""


class RigEditing(TakenAway, Editing):
    """An animator at work on the bones of rigs, and on armatures."""

    def _found(self, name: Name) -> bpy.types.PoseBone:
        rig, bone = name
        return bpy.data.objects[rig].pose.bones[bone]

    def _animated(self, name: Name) -> bpy.types.Object:
        return bpy.data.objects[name[0]]

    def _basis(self, bone: bpy.types.PoseBone) -> np.ndarray:
        """What its channels make of it, as it is evaluated. What its parents make of that is Blender's."""
        rig = bone.id_data.evaluated_get(bpy.context.evaluated_depsgraph_get())
        return np.array(rig.pose.bones[bone.name].matrix_basis, dtype=np.float64)

    def _rigs(self) -> list[str]:
        return sorted({rig for rig, _ in self.names})

    def _sharing(self, name: Name) -> set[Name]:
        rig, bone = name
        return {(other, bone) for other in self._rigs_sharing(rig) if (other, bone) in self.names}

    def _rigs_sharing(self, name: str) -> set[str]:
        """The rigs that move by the same slot as this one, itself among them."""
        linked = self._linked(bpy.data.objects[name])
        others = (rig for rig in self._rigs() if linked[0] is not None)
        return {name} | {rig for rig in others if self._linked(bpy.data.objects[rig]) == linked}

    def _is_free(self, rig: str) -> bool:
        """Whether its Action may be exchanged without losing a bake's way back, or leaving others behind."""
        return self._rigs_sharing(rig) == {rig} and not {name for name in self.before_bake if name[0] == rig}

    # What holds all the time

    @precondition(lambda self: self.on and self.history)
    @invariant()
    def everything_is_where_it_has_to_be(self):
        scene = bpy.context.scene
        frames = self._frames_that_are_seen([self._found(name) for name in self.names])
        before, shown = (scene.frame_current, scene.frame_subframe), {name: [] for name in self.names}
        for frame in frames:
            scene.frame_set(int(frame // 1), subframe=frame % 1)
            for name, bases in shown.items():
                bases.append(self._basis(self._found(name)))
        scene.frame_set(before[0], subframe=before[1])
        for name, bases in shown.items():
            bone = self._found(name)
            expected = expected_bases(bone, frames)
            error = np.abs(np.array(bases) - expected).max(axis=(1, 2)) / max(1.0, np.abs(expected).max())
            error *= shortest_quaternion(bone, frames)
            worst = int(np.argmax(error))
            assert error[worst] < TOLERANCE, (
                f"{name} ({bone.rotation_mode}) is off by {error[worst]:.3g} of its size on frame {frames[worst]} "
                f"(keys on {key_frames(bone)}):\n{bases[worst]}\ninstead of\n{expected[worst]}"
            )

    # Bones and rigs that come and go

    @precondition(lambda self: self.on)
    @rule(who=shares, in_edit_mode=st.booleans())
    def rename_a_bone(self, who, in_edit_mode):
        rig, old = self._named(who)
        if self._rigs_sharing(rig) != {rig}:
            return
        new, self.fresh = f'Renamed "{self.fresh}"', self.fresh + 1
        self._rename(rig, {old: new}, in_edit_mode)

    @precondition(lambda self: self.on)
    @rule(who=shares, other=shares, in_edit_mode=st.booleans())
    def swap_the_names_of_two_bones(self, who, other, in_edit_mode):
        rig, one = self._named(who)
        bones = [bone for owner, bone in self.names if owner == rig and bone != one]
        if self._rigs_sharing(rig) != {rig} or not bones:
            return
        two = bones[int(other * len(bones))]
        self._rename(rig, {one: two, two: one}, in_edit_mode)

    def _rename(self, rig: str, names: dict[str, str], in_edit_mode: bool) -> None:
        """Rename bones, whatever is baked, all at once."""
        keyed = self._keyed()

        def rename(bones: bpy.types.ArmatureBones | bpy.types.ArmatureEditBones) -> None:
            bpy.context.view_layer.update()
            given = [(bones[old], new) for old, new in names.items()]
            for number, (bone, _) in enumerate(given):
                bone.name = f"Between {number}"
            for bone, new in given:
                bone.name = new

        def change() -> None:
            obj = bpy.data.objects[rig]
            if in_edit_mode:
                with_edit_bones(obj, rename)
            else:
                rename(obj.data.bones)
            self.names = [self._now(name, rig, names) for name in self.names]
            self.before_bake = {self._now(name, rig, names): kept for name, kept in self.before_bake.items()}

        self._edit(change)
        assert self._keyed() == {self._now(name, rig, names): kept for name, kept in keyed.items()}

    @staticmethod
    def _now(name: Name, rig: str, names: dict[str, str]) -> Name:
        return (rig, names.get(name[1], name[1])) if name[0] == rig else name

    @precondition(lambda self: self.on and 2 < len(self.names) < 8)
    @rule(who=shares, deleted=st.booleans())
    def duplicate_or_delete_a_bone(self, who, deleted):
        rig, bone = self._named(who)
        before = set(bpy.data.objects[rig].pose.bones.keys())
        if not self._is_free(rig) or len(before) < 2:
            return

        def act(edit_bones: bpy.types.ArmatureEditBones) -> None:
            if deleted:
                edit_bones.remove(edit_bones[bone])
                return
            for edit_bone in edit_bones:
                edit_bone.select = edit_bone.select_head = edit_bone.select_tail = edit_bone.name == bone
            bpy.ops.armature.duplicate()

        def change() -> None:
            with_edit_bones(bpy.data.objects[rig], act)
            there = bpy.data.objects[rig].pose.bones.keys()
            self.names = [name for name in self.names if name[0] != rig or name[1] in there]
            self.names += [(rig, made) for made in sorted(set(there) - before)]

        self._edit(change)
        assert len(bpy.data.objects[rig].pose.bones) == len(before) + (-1 if deleted else 1)

    @precondition(lambda self: self.on)
    @rule(who=shares)
    def move_along_other_axes(self, who):
        rig, bone = self._named(who)

        def change() -> None:
            rest = bpy.data.objects[rig].data.bones[bone]
            rest.use_local_location = not rest.use_local_location

        if self._rigs_sharing(rig) == {rig}:
            self._edit(change)

    @precondition(lambda self: self.on and len(self.names) < 5)
    @rule(who=shares, copied=st.booleans())
    def copy_a_rig(self, who, copied):
        rig, _ = self._named(who)
        if not self._is_free(rig):
            return
        new, self.fresh = f"Copy {self.fresh}", self.fresh + 1
        self._edit(lambda: self._copy(rig, new, copied))

    def _copy(self, rig: str, new: str, copied: bool) -> None:
        """The same rig once more, with the same Action or with a copy of it."""
        obj = bpy.data.objects[rig]
        made = obj.copy()
        made.name, made.data = new, obj.data.copy()
        bpy.context.scene.collection.objects.link(made)
        action, slot = self._linked(obj)
        if copied and action is not None:
            made.animation_data.action = action.copy()
            made.animation_data.action_slot = made.animation_data.action.slots[slot.identifier]
        self.names += [(new, bone.name) for bone in made.pose.bones]

    @precondition(lambda self: self.on)
    @rule(who=shares)
    def flip_the_action(self, who):
        """All values are mirrored, and all that there are names of two sides for goes to the other side."""
        rig, _ = self._named(who)
        obj = bpy.data.objects[rig]
        if self._is_free(rig) and self._linked(obj)[0] is not None:
            self._edit(lambda: self._linked(bpy.data.objects[rig])[0].flip_with_pose(bpy.data.objects[rig]))
