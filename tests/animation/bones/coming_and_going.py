"""Bones and rigs that come and go, or get other names, as steps of a machine that edits."""

from __future__ import annotations

import bpy
from hypothesis import strategies as st
from hypothesis.stateful import precondition, rule

from tests.animation.bones.rig_editing import Name, RigEditing
from tests.animation.bones.rigs import with_edit_bones
from tests.animation.editing import shares


class ComingAndGoing(RigEditing):
    """An animator who also edits armatures."""

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
            self.taken_off = {self._now(name, rig, names) for name in self.taken_off}

        self._edit(change)
        assert self._keyed() == {self._now(name, rig, names): kept for name, kept in keyed.items()}

    @staticmethod
    def _now(name: Name, rig: str, names: dict[str, str]) -> Name:
        return (rig, names.get(name[1], name[1])) if name[0] == rig else name

    @precondition(lambda self: self.on and len(self.names) < 8)
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
