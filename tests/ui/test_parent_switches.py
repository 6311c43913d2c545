"""Parent switching with Rigify's own operator, between two keys of a mode: the hand stays where it is seen."""

from __future__ import annotations

import re
from collections.abc import Iterator
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from rigid_motion.animation import set_mode
from tests.animation.bones.poses import seen
from tests.animation.bones.rigs import pose_mode, select_bones
from tests.animation.scenes import key

HAND = "hand_ik.L"
PARENTS = ("None", "Root", "Torso", "Hips", "Chest", "Head")
STAYS = 1e-5
"""Tolerance in metres, and for components of axes."""


@pytest.fixture
def rig(human, extension) -> Iterator[bpy.types.Object]:
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
def test_between_keys_the_hand_stays_when_parents_are_switched(rig, extension, auto):
    extension.scene.tool_settings.use_keyframe_insert_auto = auto
    select_bones(rig, HAND)
    for frame in (6, 16):
        extension.scene.frame_set(frame)
        for parent in ("Torso", "None"):
            before = seen(rig, HAND)
            switch(rig, parent)
            assert rig.pose.bones["upper_arm_parent.L"]["IK_parent"] == PARENTS.index(parent)
            assert np.abs(seen(rig, HAND) - before).max() < STAYS
            if auto:
                extension.scene.frame_set(frame + 1)
                extension.scene.frame_set(frame)
                assert np.abs(seen(rig, HAND) - before).max() < STAYS
