"""Rigify's human: parents switched between two keys. What is held stays where it is seen."""

from __future__ import annotations

import json
from collections.abc import Iterator

import bpy
import numpy as np
import pytest

from rigid_motion.animation import key_frames, set_mode
from rigid_motion.ui.pose_operators import Switch, switches_in, switches_of
from tests.animation.bones.poses import seen
from tests.animation.bones.rigs import pose_mode, select_bones
from tests.rigs.poses import key_controls

HAND, TORSO, POLE = "hand_ik.L", "torso", "upper_arm_ik_target.L"
PARENTS = {"None": 0, "Root": 1, "Torso": 2, "Hips": 3, "Chest": 4, "Head": 5}
POSES = {
    HAND: ((0.3, -0.2, 0.4), (0.9, 0.7, 1.2)),
    POLE: ((0.1, 0.2, -0.2), (0.4, 0.2, 0.0)),
    TORSO: ((0.2, 0.3, 0.1), (0.2, 0.5, 1.4)),
}
KEYS = 1, 21
STAYS = 1e-5
"""Meters, and parts of axes."""


@pytest.fixture
def rig(human, extension) -> Iterator[bpy.types.Object]:
    """The human in Pose Mode with its own operators, a screw on the left hand, on its pole and on the torso."""
    script = human["rig_ui"].as_module()
    pose_mode(human)
    key_controls(human, POSES, KEYS)
    set_mode([human.pose.bones[name] for name in POSES], "dq_sclerp")
    yield human
    script.unregister()


def go(frame: int) -> None:
    bpy.context.scene.frame_set(frame)


def switch(parent: str, bone: str = HAND) -> set[str]:
    """As the menu does."""
    one = next(item for item in switches_of(bpy.context) if item.bone == bone)
    return bpy.ops.rigid_motion.switch_parent("EXEC_DEFAULT", True, parent=_choice(one, parent))


def _choice(one: Switch, parent: str) -> str:
    return json.dumps((one.bone, one.prop_bone, one.prop_id, one.parents.index(parent)))


def is_keyed(rig: bpy.types.Object, frame: int) -> bool:
    return frame in key_frames(rig.pose.bones[HAND])


@pytest.mark.parametrize(
    ("auto", "keyed"), [(False, False), (True, False), (True, True)], ids=["by hand", "Auto Key", "the switch keyed"]
)
def test_between_keys_the_hand_stays_when_parents_are_switched(rig, extension, auto, keyed):
    """What the parent is goes by keys or not: where it does, Auto Key sets more."""
    extension.scene.tool_settings.use_keyframe_insert_auto = auto
    if keyed:
        assert rig.keyframe_insert('pose.bones["upper_arm_parent.L"]["IK_parent"]', frame=KEYS[0])
    select_bones(rig, HAND)
    for frame in (6, 16):
        go(frame)
        for parent in ("Torso", "None"):
            before = seen(rig, HAND)
            assert switch(parent) == {"FINISHED"}
            assert rig.pose.bones["upper_arm_parent.L"]["IK_parent"] == PARENTS[parent]
            assert np.abs(seen(rig, HAND) - before).max() < STAYS
            assert is_keyed(rig, frame) == auto
            if auto:
                go(frame + 1)
                go(frame)
                assert np.abs(seen(rig, HAND) - before).max() < STAYS


def test_rigify_s_own_operator_moves_the_hand(rig):
    """If this fails, ours is not needed any more."""
    select_bones(rig, HAND)
    go(11)
    (one,) = switches_of(bpy.context)
    switch("Root")  # Rigify's has the names of the parents from then on
    go(12)
    go(11)
    before = seen(rig, HAND)
    settings = dict(zip(one._fields[2:], one[2:], strict=True))
    getattr(bpy.ops.pose, one.operator)("EXEC_DEFAULT", True, selected=str(PARENTS["Head"]), **settings)
    assert np.abs(seen(rig, HAND) - before).max() > 0.05


def test_of_a_pole_the_place_stays(rig, extension):
    extension.scene.tool_settings.use_keyframe_insert_auto = True
    rig.pose.bones["upper_arm_parent.L"]["pole_vector"] = True  # it is hidden otherwise
    bpy.context.view_layer.update()
    select_bones(rig, POLE)
    go(11)
    before = seen(rig, POLE)
    for parent in ("Torso", "None", "hand_ik.L"):
        switch(parent, POLE)
        assert np.abs(seen(rig, POLE) - before)[:3, 3].max() < STAYS


def test_switches_are_offered_of_selected_bones_with_a_mode(rig):
    offered = bpy.ops.rigid_motion.switch_parent.poll
    for names in ((HAND,), ("upper_arm_parent.L", "head"), (TORSO,)):
        select_bones(rig, *names)
        assert offered()
    select_bones(rig, "hand_ik.R")
    assert not offered()
    select_bones(rig, HAND)
    set_mode(rig.pose.bones[HAND], "BLENDER")
    assert not offered()
    select_bones(rig, TORSO)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert not offered()


def test_without_rigify_s_operator_the_hand_stays_as_it_is_and_one_line_says_what_to_do(rig, extension):
    select_bones(rig, HAND)
    go(11)
    (one,) = switches_of(extension)
    before = seen(rig, HAND)
    operator = bpy.types.Operator.bl_rna_get_subclass_py(f"POSE_OT_{one.operator}")
    bpy.utils.unregister_class(operator)
    with pytest.raises(RuntimeError, match=r"run its script rig_ui\.py in the Text Editor") as refusal:
        switch("Head")
    bpy.utils.register_class(operator)
    assert str(refusal.value).strip().count("\n") == 0
    assert np.abs(seen(rig, HAND) - before).max() < 1e-6


BUTTON = """
                props = group2.operator('pose.rigify_switch_parent_abc', text="Bob's", icon='DOWNARROW_HLT')
                props.bone = 'hand'
                props.prop_bone = 'arm'
                props.prop_id = 'IK_parent'
                props.parent_names = '["None", "Root"]'
                props.locks = (False, True, False)
                group2.prop(pose_bones['arm'], '["IK_parent"]', text='')
"""


def test_buttons_are_read_from_the_script_of_a_rig():
    (one,) = switches_in(BUTTON)
    assert one.label == "Bob's"
    assert one.operator == "rigify_switch_parent_abc"
    assert one.parents == ["None", "Root"]
    assert one[2:5] == ("hand", "arm", "IK_parent")
    assert one.locks == (False, True, False)
    assert len(switches_in(BUTTON * 3)) == 3
    assert not switches_in(BUTTON.replace("parent_abc", "parent_bake_abc"))


@pytest.mark.parametrize(
    ("written", "instead"),
    [
        ("'hand'", "name()"),
        ("props.bone", "props.bones"),
        ('["None", "Root"]', "[1, 2]"),
        ('\'["None", "Root"]\'', "3"),
        ("(False, True, False)", "None"),
        ("(False, True, False)", "(False,)"),
        ("(False, True, False)", "-" * 50000 + "1"),
        ("'pose.rigify_switch_parent_abc'", "'pose.rigify_switch_parent_abc' + name"),
        ("                props.locks = (False, True, False)\n", ""),
    ],
)
def test_what_is_written_otherwise_is_passed_over(written, instead):
    assert written in BUTTON
    assert switches_in(BUTTON.replace(written, instead)) == ()
