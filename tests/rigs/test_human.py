"""Rigify's human as tests get it: posed by its controls, once for each who asks, and nothing else in the file."""

from __future__ import annotations

import bpy
from mathutils import Vector

from tests.rigs.human import MECHANISM, controls
from tests.rigs.human import human as another_human


def test_the_hand_goes_where_its_control_goes(human):
    hand = human.pose.bones["hand_ik.L"]
    expected = hand.head + Vector((-0.1, -0.2, 0.1))
    hand.matrix = hand.matrix.Translation(expected - hand.head) @ hand.matrix
    bpy.context.view_layer.update()
    assert (human.pose.bones["DEF-hand.L"].head - expected).length < 1e-4


def test_every_one_is_a_rig_of_its_own(human):
    other = another_human()
    assert other is not human
    assert other.data is not human.data
    assert len(other.pose.bones) == len(human.pose.bones)


def test_what_was_in_the_file_is_there_and_nothing_but_the_rig_has_come(human):
    assert list(bpy.context.scene.objects) == [human]
    assert len(bpy.data.scenes) == 1
    assert bpy.context.mode == "OBJECT"
    assert not [name for name in dir(bpy.types) if "rigify" in name.lower()]
    assert not [item for item in bpy.app.handlers.load_post if item.__module__.startswith("rigify")]


def test_controls_are_what_animators_pose(human):
    names = {bone.name for bone in controls(human)}
    assert {"root", "torso", "hand_ik.L", "foot_ik.R", "foot_heel_ik.L", "forearm_fk.R", "head"} <= names
    assert not any(name.startswith(MECHANISM) for name in names)
    assert len(names) == 216
