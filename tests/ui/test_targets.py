"""Transforms that operators act on in each editor. No screen is needed: areas exist in the background, too."""

from __future__ import annotations

import bpy
import pytest

from rigid_motion.animation import is_reduced, key_frames, modes_of
from rigid_motion.animation.transforms import transform_of
from rigid_motion.ui.notes import KEYED_BONES, facts_and_notes
from rigid_motion.ui.targets import (
    CURRENT,
    KEY_EDITORS,
    SELECTED,
    WHOLE,
    modes_meant,
)
from tests.animation.bones.rigs import select_bones
from tests.animation.scenes import editor
from tests.rigs.recorded import recorded_rig
from tests.ui.conftest import FRAMES, keyed, select_keys


@pytest.mark.parametrize("kind", KEY_EDITORS)
def test_in_a_key_editor_modes_are_for_the_selected_keys_of_all_objects_shown(tool, kind):
    other, left_out = keyed("Other"), keyed("Left Out")
    left_out.select_set(False)
    for obj in (tool, other, left_out):
        select_keys(obj, 11.0)
    with editor(kind) as space:
        space.dopesheet.show_only_selected = True
        bpy.ops.rigid_motion.set_mode(mode="dq_sclerp")
    assert modes_of(tool, FRAMES[:-1]) == modes_of(other, FRAMES[:-1]) == ["BLENDER", "dq_sclerp", "BLENDER"]
    assert modes_of(left_out, FRAMES[:-1]) == ["BLENDER"] * 3


@pytest.mark.parametrize("kind", ["VIEW_3D", *KEY_EDITORS])
def test_a_rig_in_object_mode_is_reduced_and_restored_in_every_editor(extension, kind, capfd):
    rig = recorded_rig()
    rig.select_set(True)
    select_bones(rig)
    keys, bones = bpy.ops.rigid_motion, rig.pose.bones
    with editor(kind) as space:
        if kind in KEY_EDITORS:
            space.dopesheet.show_only_selected = True
        assert [text for _, text in facts_and_notes(rig, 5.0)[1]] == [KEYED_BONES]
        assert keys.reduce_keys.poll()
        assert not keys.restore_keys.poll()
        assert keys.reduce_keys(mode="dq_sclerp", shared=True, tolerance=0.05) == {"FINISHED"}
        assert all(map(is_reduced, bones))
        (count,) = {len(key_frames(bone)) for bone in bones}
        said = capfd.readouterr().out
        assert f"7 bones: 630 keys became {7 * count}, largest error " in said
        assert f"; Frames: {count} with keys" in said
        assert keys.restore_keys() == {"FINISHED"}
        assert not any(map(is_reduced, bones))


def test_the_modes_meant_are_those_of_the_scope(tool):
    select_keys(tool, 11.0)
    bpy.ops.rigid_motion.set_mode(mode="dq_sclerp", on=SELECTED)
    bpy.context.scene.frame_set(5)
    assert modes_meant(bpy.context, transform_of(tool), WHOLE) == {"BLENDER", "dq_sclerp"}
    assert modes_meant(bpy.context, transform_of(tool), SELECTED) == {"dq_sclerp"}
    assert modes_meant(bpy.context, transform_of(tool), CURRENT) == {"BLENDER"}
    bpy.context.scene.frame_set(50)
    assert modes_meant(bpy.context, transform_of(tool), CURRENT) == set()
    assert modes_meant(bpy.context, None, WHOLE) == set()
