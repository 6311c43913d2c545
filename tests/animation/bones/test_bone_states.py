"""State machine for bones: after any edits in any order, bones move as keys and modes say, and nothing is stale."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np
from hypothesis import strategies as st
from hypothesis.stateful import initialize, precondition, rule

from rigid_motion import animation
from tests.animation.bones.rigs import ORDERS, Rest, new_rig, with_edit_bones
from tests.animation.holds.hold_steps import WithHolds
from tests.animation.keyed import MODE_IDS, transform_paths
from tests.animation.machine import LAST, SETTINGS, seeds, shares, while_on
from tests.animation.oracle import assert_there, expected_bases
from tests.animation.scenes import key, random_values, write

BONES = (
    Rest("Body", (0.1, -0.2, 0.9), (0.15, -0.1, 1.4), roll=0.4),
    Rest("Arm", (0.3, 0.0, 1.4), (0.6, 0.1, 1.3), "Body", roll=-1.1, settings=(("use_local_location", False),)),
    Rest("Prop", (-0.5, 0.3, 0.2), (-0.4, 0.3, 0.6), roll=0.9),
)
"""A chain of two bones, and a bone moved only by its keys."""

Name = tuple[str, str]
"""The names of a rig and of one of its bones."""


class EditingBones(WithHolds):
    """An animator at work on the bones of rigs, identified by both names, and on armatures."""

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
                write(bone, path, frames, values, "BEZIER")
            animation.set_mode(bone, mode)
        self.names = [(rig.name, bone.name) for bone in rig.pose.bones]
        if second is not None:
            self._copy(rig, "Second", copied=second == "with a copy of it")
        bpy.context.view_layer.update()
        self._start_history()

    def _found(self, name: Name) -> bpy.types.PoseBone:
        rig, bone = name
        return bpy.data.objects[rig].pose.bones[bone]

    def _basis(self, bone: bpy.types.PoseBone) -> np.ndarray:
        """Return the evaluated effect of its channels. The effect of its parents on that is Blender's."""
        rig = bone.id_data.evaluated_get(bpy.context.evaluated_depsgraph_get())
        return np.array(rig.pose.bones[bone.name].matrix_basis, dtype=np.float64)

    def _sharing(self, name: Name) -> set[Name]:
        users = {obj.name for obj in self._users(self._animated(name))}
        return {other for other in self.names if other[0] in users and other[1] == name[1]}

    def _assert_shown(self, names: Sequence[Name], frames: np.ndarray) -> None:
        for name, bases in self._bases(names, frames).items():
            if self._is_held(name):
                self._assert_held(name, frames)
                continue
            assert_there(self._found(name), frames, bases, expected_bases(self._found(name), frames))

    def _may_be_held(self, name: Name) -> bool:
        """Exclude bones whose location axes differ from their rotation axes: see `test_passing`."""
        return self._found(name).bone.use_local_location

    # Adding, removing and renaming bones and rigs

    @while_on(who=shares, other=st.none() | shares, in_edit_mode=st.booleans())
    def rename_a_bone_or_swap_names(self, who, other, in_edit_mode):
        """Bones may be baked, and all names change at once."""
        rig, one = self._named(who)
        others = [bone for owner, bone in self.names if owner == rig and bone != one]
        if len(self._users(bpy.data.objects[rig])) > 1 or (other is not None and not others):
            return
        names, self.fresh, keyed = {one: f'Renamed "{self.fresh}"'}, self.fresh + 1, self._keyed()
        if other is not None:
            two = others[int(other * len(others))]
            names = {one: two, two: one}

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
            self.names = [self._name_after_renaming(name, rig, names) for name in self.names]
            self.before_bake = {
                self._name_after_renaming(name, rig, names): kept for name, kept in self.before_bake.items()
            }

        self._edit(change)
        assert self._keyed() == {self._name_after_renaming(name, rig, names): kept for name, kept in keyed.items()}

    @staticmethod
    def _name_after_renaming(name: Name, rig: str, names: dict[str, str]) -> Name:
        return (rig, names.get(name[1], name[1])) if name[0] == rig else name

    @precondition(lambda self: self.on and 2 < len(self.names) < 8)
    @rule(who=shares, deleted=st.booleans())
    def duplicate_or_delete_a_bone(self, who, deleted):
        rig, bone = self._named(who)
        before = set(bpy.data.objects[rig].pose.bones.keys())
        if not self._is_free(bpy.data.objects[rig]) or len(before) < 2:
            return
        if deleted and any(map(self._is_held, self.names)):
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

    @while_on(who=shares)
    def move_along_other_axes(self, who):
        rig, bone = self._named(who)
        rest = bpy.data.objects[rig].data.bones[bone]
        if len(self._users(bpy.data.objects[rig])) == 1 and not self._is_held((rig, bone)):
            self._edit(lambda: setattr(rest, "use_local_location", not rest.use_local_location))

    @while_on(who=shares)
    def flip_the_action(self, who):
        """All values are mirrored, and channels with names of one side move to the other side."""
        rig = self._animated(self._named(who))
        action, _ = self._linked(rig)
        if self._is_free(rig) and action is not None:
            self._edit(lambda: action.flip_with_pose(rig))


EditingBones.TestCase.settings = SETTINGS
TestBoneEdits = EditingBones.TestCase
