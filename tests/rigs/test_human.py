"""Modes on Rigify's human: all of its controls at once, where the pages say a screw helps, and where nothing strays.

Between two keys of a mode, the hand stays when Rigify's own operator switches its parent.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from rigid_motion import animation
from rigid_motion.animation import bake, problem_of, set_mode, unbake
from tests.animation.bones.poses import seen
from tests.animation.bones.rigs import pose_mode, select_bones
from tests.animation.scenes import key
from tests.rigs import scenes
from tests.rigs.human import controls


@pytest.fixture
def rig(human: bpy.types.Object, extension: bpy.types.Context) -> bpy.types.Object:
    return human


def ends_of_bones(rig: bpy.types.Object) -> np.ndarray:
    """Return the heads and tails of all bones on some frames, in armature space."""
    result = []
    for frame in range(1, 32, 4):
        bpy.context.scene.frame_set(frame)
        result.append([(*bone.head, *bone.tail) for bone in rig.pose.bones])
    return np.array(result)


def test_all_of_its_controls_take_a_mode_and_everything_that_hangs_on_them_follows_as_it_follows_real_keys(rig):
    posed = controls(rig)[::4]
    for control in posed:
        key(control, (1.0, 15.0, 31.0), location=False)
    set_mode(posed, "dq_sclerp")
    assert {problem_of(control) for control in posed[::20]} == {""}
    shown = ends_of_bones(rig)
    bake(posed)
    reach = float(np.ptp(shown.reshape(-1, 3), axis=0).max())
    assert np.abs(ends_of_bones(rig) - shown).max() < 1e-5 * reach
    unbake(posed)
    assert np.array_equal(ends_of_bones(rig), shown)
    set_mode(posed, "BLENDER")
    assert np.abs(ends_of_bones(rig) - shown).max() > 0.001 * reach
    assert not [
        constraint
        for bone in rig.pose.bones
        for constraint in bone.constraints
        if constraint.name.startswith("Rigid Motion")
    ]


NOTHING = 2e-4
"""An error in metres that counts as none: IK itself leaves the hand 0.1 mm from its control."""


def strays_of(scene: scenes.Scene) -> tuple[float, float]:
    """Return the largest straying in metres, with Blender's in-betweens and with the screw."""
    native = scene.farthest()
    animation.set_mode(scene.controls, "dq_sclerp")
    return native, scene.farthest()


def pull_a_lever(rig: bpy.types.Object) -> scenes.Scene:
    lever = bpy.data.objects.new("Lever", None)
    bpy.context.scene.collection.objects.link(lever)
    return scenes.pull_a_lever(rig, lever)


@pytest.mark.parametrize(("scene", "metres"), [(pull_a_lever, 0.165), (scenes.twist, 0.039), (scenes.cut, 0.272)])
def test_by_the_screw_fists_and_feet_stay_and_an_arm_that_swings_by_ik_stays_stretched(rig, scene, metres):
    native, screw = strays_of(scene(rig))
    assert native == pytest.approx(metres, abs=0.001)
    assert screw < NOTHING


def test_joints_keyed_by_quaternions_need_no_screw(rig):
    native, screw = strays_of(scenes.cut_by_joints(rig))
    assert native < NOTHING
    assert screw < NOTHING


@pytest.mark.parametrize(("order", "centimetres"), [("YXZ", 6.8), ("ZYX", 28.4)])
def test_joints_keyed_by_euler_angles_gain_much(rig, order, centimetres):
    native, screw = strays_of(scenes.cut_by_joints(rig, order))
    assert 100.0 * native == pytest.approx(centimetres, abs=0.1)
    assert screw < NOTHING


HAND = "hand_ik.L"
PARENTS = ("None", "Root", "Torso", "Hips", "Chest", "Head")
STAYS = 1e-5
"""Tolerance in metres, and for components of axes."""


@pytest.fixture
def posed_rig(human, extension) -> Iterator[bpy.types.Object]:
    """The human in Pose Mode with its own operators, in the mode Screw on the left hand and the torso."""
    script = human["rig_ui"].as_module()
    pose_mode(human)
    moved = [key(human.pose.bones[name], (1.0, 21.0)) for name in (HAND, "torso")]
    set_mode(moved, "dq_sclerp")
    yield human
    script.unregister()


def switch(rig: bpy.types.Object, parent: str) -> set[str]:
    """Switch the parent as the button in the sidebar does."""
    (name,) = set(re.findall(r"pose\.(rigify_switch_parent_(?!bake)\w+)", rig["rig_ui"].as_string()))
    settings = {"bone": HAND, "prop_bone": "upper_arm_parent.L", "prop_id": "IK_parent", "locks": (False, False, False)}
    names = str(list(PARENTS)).replace("'", '"')
    settings["parent_names"] = names
    # Without being invoked, the operator has not read the names of the parents.
    operator = bpy.types.Operator.bl_rna_get_subclass_py(f"POSE_OT_{name}")
    operator.init_invoke(SimpleNamespace(**settings, report=print), bpy.context)
    return getattr(bpy.ops.pose, name)("EXEC_DEFAULT", True, selected=str(PARENTS.index(parent)), **settings)


@pytest.mark.parametrize("auto", [False, True], ids=["by hand", "Auto Key"])
def test_between_keys_the_hand_stays_when_parents_are_switched(posed_rig, extension, auto):
    extension.scene.tool_settings.use_keyframe_insert_auto = auto
    select_bones(posed_rig, HAND)
    for frame in (6, 16):
        extension.scene.frame_set(frame)
        for parent in ("Torso", "None"):
            before = seen(posed_rig, HAND)
            switch(posed_rig, parent)
            assert posed_rig.pose.bones["upper_arm_parent.L"]["IK_parent"] == PARENTS.index(parent)
            assert np.abs(seen(posed_rig, HAND) - before).max() < STAYS
            if auto:
                extension.scene.frame_set(frame + 1)
                extension.scene.frame_set(frame)
                assert np.abs(seen(posed_rig, HAND) - before).max() < STAYS
