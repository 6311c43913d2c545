"""The radius for measuring errors: how far an object or a bone reaches from its origin."""

from __future__ import annotations

import bpy
import pytest

from rigid_motion.animation import radius_of
from rigid_motion.animation.transforms import transform_of
from rigid_motion.animation.transforms.sizes import first_tolerance, reaches_of, rig_size
from tests.animation.bones.rigs import Rest, new_rig
from tests.animation.scenes import new_object


def test_an_object_reaches_what_it_is_drawn_with_and_what_is_parented_to_it(live_file):
    mesh = bpy.data.meshes.new("Box")
    mesh.from_pydata([(0, 0, 0), (1, 2, 2)], [(0, 1)], [])
    alone, scaled, arm = (new_object(name, data=mesh) for name in ("Alone", "Scaled", "Arm"))
    root, empty, pivot, tip = (new_object(name) for name in ("Root", "Empty", "Pivot", "Tip"))
    camera = new_object("Camera", data=bpy.data.cameras.new("Camera"))
    light = new_object("Lamp", data=bpy.data.lights.new("Lamp", "POINT"))
    root.scale, scaled.scale, scaled.parent = (3.0, 3.0, 3.0), (2.0, 2.0, 2.0), root
    empty.empty_display_size, empty.scale, camera.data.display_size = 0.25, (2.0, 2.0, 2.0), 0.5
    pivot.location, pivot.empty_display_size = (10.0, 0.0, 0.0), 0.5
    arm.parent, arm.location = pivot, (4.0, 0.0, 0.0)
    tip.parent, tip.location = arm, (0.0, -8.0, 3.0)
    reaches = {alone: 3.0, scaled: 18.0, empty: 0.5, camera: 0.5, pivot: 89.0**0.5, arm: 73.0**0.5, light: 0.1}
    for obj, reach in reaches.items():
        assert radius_of(obj) == pytest.approx(reach), obj.name
    bpy.context.scene.unit_settings.scale_length = 0.01
    assert radius_of(light) == pytest.approx(10.0), "what has no size counts as ten centimetres"


def test_a_bone_reaches_all_that_it_deforms_or_carries_and_three_centimetres_of_a_grown_up(live_file):
    rests = [Rest("Hips", (0.0, 0.0, 0.0), (0.0, 0.0, 0.9)), Rest("Spine", (0.0, 0.0, 0.9), (0.0, 0.0, 1.69), "Hips")]
    tiny = [Rest(name, (0.0, 0.0, 1.7), (0.0, 0.0, 1.701), "Spine") for name in ("Hand", "Finger")]
    rig = new_rig(bones=(*rests, *tiny))
    rig.scale = (0.5, 0.5, 0.5)
    bpy.context.view_layer.update()
    least = 0.03
    assert reaches_of(rig) == pytest.approx({"Hips": 0.9, "Spine": 0.79, "Hand": least, "Finger": least})
    mesh = bpy.data.meshes.new("Skin")
    mesh.from_pydata([(0.0, 0.0, 1.7), (0.0, 5.0, 1.7), (0.0, 3.0, 1.7), (9.0, 0.0, 0.0)], [], [])
    skin = new_object("Skin", data=mesh)
    skin.matrix_world = rig.matrix_world
    for name, vertices in (("Hand", (0, 1, 2)), ("Spine", (0,)), ("Else", (3,))):
        skin.vertex_groups.new(name=name).add(vertices, 0.2, "REPLACE")
    skin.vertex_groups["Hand"].add((1,), 0.0, "REPLACE")
    assert reaches_of(rig)["Hand"] == pytest.approx(least)
    skin.modifiers.new("Armature", "ARMATURE").object = rig
    sword = new_object("Sword")
    sword.parent, sword.parent_type, sword.parent_bone = rig, "BONE", "Finger"
    sword.location = (0.0, 0.0, 0.8)
    rig.pose.bones["Spine"].rotation_quaternion = (0.6, 0.8, 0.0, 0.0)
    bpy.context.view_layer.update()
    expected = {"Hips": 0.9, "Spine": 0.8, "Hand": 3.0, "Finger": 0.8}
    assert reaches_of(rig) == pytest.approx(expected, abs=1e-5)


def test_made_up_lengths_of_the_last_bones_are_no_part_of_the_size_of_a_rig(live_file):
    hips, spine = (
        Rest("Hips", (0.0, 0.0, 0.0), (0.0, 0.0, 0.8)),
        Rest("Spine", (0.0, 0.0, 0.8), (0.0, 0.0, 1.6), "Hips"),
    )
    rig = new_rig(bones=(hips, spine, Rest("HeadTop", (0.0, 0.0, 1.6), (0.0, 0.0, 58.6), "Spine")))
    rig.scale = (2.0, 2.0, 2.0)
    bpy.context.view_layer.update()
    assert rig_size(rig) == pytest.approx(3.2)
    assert first_tolerance(bpy.context.scene, [transform_of(bone) for bone in rig.pose.bones]) == pytest.approx(9.6e-3)
    assert reaches_of(rig)["HeadTop"] == pytest.approx(0.8)
    assert radius_of(rig.pose.bones["HeadTop"]) == pytest.approx(1.6)
    assert radius_of(rig) == pytest.approx(2.0 * (1.6 + 0.8))
