"""Holding from the interface: which objects the operators act on, each operator, and the texts of the panel."""

from __future__ import annotations

from dataclasses import replace

import bpy
import numpy as np
import pytest

from rigid_motion.animation import hold_facts, hold_in, pass_frames
from rigid_motion.animation.transforms import transform_of
from rigid_motion.ui import held_in, holding
from tests.animation.bones.rigs import select_bones, select_only
from tests.animation.keyed import curves_of
from tests.animation.oracle import world_of
from tests.animation.scenes import key, new_object
from tests.ui.rigs import FRAMES, new_rig

operators = bpy.ops.rigid_motion


@pytest.fixture
def stage(extension):
    """A mug, a hand that moves, and another one; the mug is selected first, the moving hand last."""
    mug, left, right = new_object("Mug"), key(new_object("Left"), FRAMES, seed=1), key(new_object("Right"), FRAMES)
    mug.location = (0.4, 0.2, 1.0)
    bpy.context.scene.frame_set(11)
    select_only(left, mug)
    return mug, left, right


def at(frame):
    bpy.context.scene.frame_set(frame)


def test_from_hand_to_hand_let_go_and_the_frames_of_it(stage):
    mug, _, right = stage
    operators.hold_in()
    at(21)
    select_only(right, mug)
    operators.hold_in()
    facts = hold_facts(mug)
    assert (facts.now.target, facts.switch, facts.frames) == (right, 21.0, 4)
    at(31)
    assert operators.let_go(frames=3) == {"FINISHED"}
    assert (hold_facts(mug).now, hold_facts(mug).frames) == (None, 3)
    at(15)
    assert hold_facts(mug).until == 21.0
    assert operators.pass_frames(frames=7) == {"FINISHED"}
    at(21)
    assert hold_facts(mug).frames == 7


def test_the_grip_is_matched(stage):
    mug, left, _ = stage
    operators.hold_in()
    grip = np.linalg.inv(world_of(left)) @ world_of(mug)
    at(21)
    operators.let_go()
    at(31)
    select_only(left, mug)
    operators.hold_in()
    assert np.linalg.inv(world_of(left)) @ world_of(mug) != pytest.approx(grip, abs=1e-2)
    assert operators.match_grip() == {"FINISHED"}
    assert np.linalg.inv(world_of(left)) @ world_of(mug) == pytest.approx(grip, abs=1e-5)


def test_a_known_holder_is_named(stage):
    mug, _, right = stage
    operators.hold_in()
    select_only(mug)
    at(21)
    assert operators.hold_in_known(target=right.name_full) == {"FINISHED"}
    assert hold_facts(mug).now.target == right
    with pytest.raises(RuntimeError, match="The object Nobody no longer exists"):
        operators.hold_in_known(target="Nobody")


def test_what_holds_another_is_not_let_go_with_it(stage):
    mug, left, right = stage
    select_only(right, left)
    operators.hold_in()
    select_only(left, mug)
    operators.hold_in()
    at(15)
    assert [item.carrier for item in holding.held(bpy.context)] == [mug]
    operators.let_go()
    assert (hold_facts(mug).now, hold_facts(left).now.target) == (None, right)
    select_only(mug, left)
    assert {item.carrier for item in holding.held(bpy.context)} == {left, mug}


def test_of_an_active_rig_the_active_bone_holds(stage):
    mug, *_ = stage
    rig = new_rig()
    rig.data.bones.active = rig.data.bones["Hand"]
    bpy.ops.object.mode_set(mode="OBJECT")
    select_only(rig, mug)
    operators.hold_in()
    assert (hold_facts(mug).now.target, hold_facts(mug).now.bone) == (rig, "Hand")
    at(21)
    operators.hold_in(use_bone=False)
    assert (hold_facts(mug).now.target, hold_facts(mug).now.bone) == (rig, "")


def test_in_pose_mode_a_bone_holds_selected_objects_or_else_bones(stage):
    mug, *_ = stage
    rig = new_rig()
    select_bones(rig, "Arm", "Hand")
    mug.select_set(True)
    assert [item.carrier for item in holding.props_for(bpy.context, rig.pose.bones["Hand"])] == [mug]
    mug.select_set(False)
    assert [item.carrier for item in holding.props_for(bpy.context, rig.pose.bones["Hand"])] == [rig.pose.bones["Arm"]]
    mug.select_set(True)
    rig.data.bones.active = rig.data.bones["Hand"]
    assert operators.hold_in() == {"FINISHED"}
    assert hold_facts(mug).now.bone == "Hand"


def test_a_bone_is_held_in_the_active_bone_of_another_rig(extension):
    sword, hand = (new_rig(name) for name in ("Sword", "Body"))
    hand.location = (0.5, 0.0, 0.0)
    bpy.ops.object.mode_set(mode="OBJECT")
    select_only(hand, sword)
    bpy.ops.object.mode_set(mode="POSE")
    select_bones(sword, "Hip")
    select_bones(hand, "Hand")
    hand.data.bones.active = hand.data.bones["Hand"]
    bpy.context.scene.frame_set(5)
    assert operators.hold_in() == {"FINISHED"}
    blade = sword.pose.bones["Hip"]
    assert (hold_facts(blade).now.target, hold_facts(blade).now.bone) == (hand, "Hand")
    assert curves_of(blade)['constraints["Held In Hand"].influence', 0].group.name == "Hip"


@pytest.mark.parametrize("name", ["hold_in", "let_go", "match_grip", "pass_frames"])
def test_one_alone_is_neither_held_nor_let_go(stage, name):
    mug, *_ = stage
    select_only(mug)
    assert not getattr(operators, name).poll()
    reason = holding.FIRST_AND_LAST if name == "hold_in" else holding.NOTHING_HELD
    with pytest.raises(RuntimeError, match=reason.partition(":")[0]):
        getattr(operators, name)()


def test_where_it_passes_the_panel_says_how_far_hands_are_apart_and_sets_over_how_many_frames(stage):
    mug, _, right = stage
    operators.hold_in()
    at(21)
    select_only(right, mug)
    operators.hold_in()
    scene = bpy.context.scene
    assert held_in.apart_text(scene, hold_facts(mug)) == "Hands 0 m, 0.0° apart at 21"
    assert scene.rigid_motion_pass == 4
    scene.rigid_motion_pass = 9
    assert hold_facts(mug).frames == scene.rigid_motion_pass == 9
    curves_of(mug)["location", 0].keyframe_points[-1].co.y += 0.032
    bpy.context.view_layer.update()
    at(5)
    assert held_in.apart_text(scene, hold_facts(mug)) == ""
    at(21)
    assert held_in.apart_text(scene, hold_facts(mug)) == "Hands 3.2 cm, 0.0° apart at 21"


def test_that_uneven_scale_shears_what_passes_and_far_turns_are_said(stage):
    mug, left, right = stage
    right.scale = (1.0, 2.0, 1.0)
    hold_in(mug, left)
    at(21)
    hold_in(mug, right, frames=4)
    prop, facts = transform_of(mug), hold_facts(mug)
    assert [text[:31] for text in held_in.cautions(prop, facts)] == ["Right is scaled unevenly: what "]
    text, _ = held_in.cautions(prop, replace(facts, turned=2.2))
    assert text.startswith("It rotates by 126.1° while it passes")
    left.scale = (3.0, 3.0, 3.0)
    pass_frames(mug, 0)
    assert list(held_in.cautions(prop, hold_facts(mug))) == []


def test_what_may_go_wrong_is_said(stage):
    mug, left, _ = stage
    operators.hold_in()
    prop = transform_of(mug)
    assert list(held_in.cautions(prop, hold_facts(mug))) == []
    left.scale = (1.0, 1.0, 1.0)
    left.keyframe_insert("scale", frame=1)
    left.scale = (2.0, 2.0, 2.0)
    left.keyframe_insert("scale", frame=11)
    left.constraints.new("COPY_LOCATION").target = mug
    grows, cycle = sorted(held_in.cautions(prop, hold_facts(mug)), key=len)
    assert grows == "Left has keys of its scale: what it holds grows and shrinks with it"
    assert cycle.startswith("Left now follows Mug, which it holds: a cycle")
