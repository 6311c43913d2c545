"""Bodies received over a network drive objects and rigs."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.live import receiving
from rigid_motion.motion import Poses
from rigid_motion.streams import Sender, StreamBody
from rigid_motion.streams.vmc import write_trackers
from tests.animation.scenes import linked
from tests.live.performing import JOINTS, Sent, dance, frames_of_vmc, heads_of, in_world, new_rig
from tests.rigs.human import human

pytestmark = [pytest.mark.network, pytest.mark.any_blender]

TIMES = np.arange(90) / 60.0
SINGLE = 2e-6
"""Tolerance for single precision, in metres."""


@pytest.mark.parametrize(("prefix", "larger", "turned_by"), [("mixamorig:", 1.0, 0.7), ("", 1.3, 0.2)])
def test_a_performer_moves_the_bones_of_a_rig_of_any_size_rest_and_naming(live, sent, prefix, larger, turned_by):
    live.armature = rig = new_rig(prefix, larger, turned_by)
    world = in_world(dance(TIMES)).positions
    for row, datagrams in enumerate(frames_of_vmc(TIMES)[:30]):
        sent.send(datagrams, 50.0 + TIMES[row])
        if row:
            assert heads_of(rig) == pytest.approx(larger * world[:, row], abs=larger * SINGLE)
    assert [item.bone for item in live.bones] == ["", *(prefix + item.name for item in list(live.bones)[1:])]


def test_a_rig_is_where_its_object_and_its_parent_put_it(live, sent):
    live.armature = rig = new_rig()
    rig.parent = stage = bpy.data.objects.new("Stage", None)
    bpy.context.scene.collection.objects.link(stage)
    stage.rotation_euler.z, stage.location.x, rig.location.y = np.pi / 2, 5.0, 1.0
    # As importers leave rigs: in other axes and units.
    rig.rotation_euler.x, rig.scale = 0.4, (0.5, 0.5, 0.5)
    rig.data.transform(
        rig.matrix_basis.inverted() @ bpy.data.objects["Rig"].matrix_basis.__class__.Translation((0, 1, 0))
    )
    sent.dance(0, 10)
    x, y, z = in_world(dance(TIMES)).positions[:, 9].T
    assert heads_of(rig) == pytest.approx(np.stack((5.0 - (y + 1.0), x, z), axis=1), abs=4 * SINGLE)


def test_without_a_rig_a_body_is_an_armature_with_its_rest(live, sent):
    sent.dance(0, 10)
    (rig,) = bpy.context.scene.objects
    assert rig.type == "ARMATURE"
    assert {bone.name for bone in rig.data.bones} == {"Root", *JOINTS}
    heads = dict(zip(rig.pose.bones.keys(), heads_of(rig), strict=True))
    world = in_world(dance(TIMES)).positions[:, 9]
    for joint, name in enumerate(JOINTS):
        assert heads[name] == pytest.approx(world[joint], abs=SINGLE)


def test_trackers_of_vmc_are_objects_beside_the_performer(live, sent):
    live.armature = rig = new_rig()
    world = in_world(dance(TIMES)).positions
    for row, datagrams in enumerate(frames_of_vmc(TIMES)[:10]):
        ball = {"ball": Poses([TIMES[row], 2.0, 1.0], [0.0, 1.0, 0.0, 0.0])}
        sent.send([*write_trackers(ball), *datagrams], 50.0 + TIMES[row])
    assert heads_of(rig) == pytest.approx(world[:, 9], abs=SINGLE)
    obj = bpy.data.objects["ball"]
    assert tuple(obj.location) == pytest.approx((TIMES[9], 2.0, 1.0), abs=SINGLE)
    assert abs(obj.rotation_quaternion[1]) == pytest.approx(1.0)


def test_another_version_of_the_wire_is_named_in_the_panel(live, sent):
    datagram = Sender([StreamBody.rigid("ball")]).describe()[0]
    sent.send([bytes([datagram[0] - 16]) + datagram[1:]], 50.0)
    version = datagram[0] // 16
    assert f"sends version {version - 1} of the wire, not {version}: update" in receiving.listening().complaint


@pytest.mark.slow
def test_a_rig_of_rigify_follows_by_its_controls(live, sent):
    live.armature = rig = human()
    sent.dance(0, 8)
    bpy.context.view_layer.update()
    assert {item.name: item.bone for item in live.bones}["LeftUpperArm"] == "upper_arm_fk.L"
    world = in_world(dance(TIMES))
    for joint, control in (("LeftHand", "DEF-forearm.L.001"), ("LeftFoot", "DEF-shin.L.001")):
        # Deforming bones point where the performer's do.
        row = JOINTS.index(joint)
        points = world.positions[row, 7] - world.positions[row - 1, 7]
        bone = rig.pose.bones[control]
        result = np.array(bone.tail - bone.head)
        assert result / np.linalg.norm(result) == pytest.approx(points / np.linalg.norm(points), abs=0.02)


def test_a_corrected_table_is_what_moves(live, sent):
    live.armature = rig = new_rig()
    sent.dance(0, 5)
    live.bones[list(live.bones.keys()).index("LeftUpperArm")].bone = ""
    rig.pose.bones["LeftUpperArm"].rotation_quaternion = (0.0, 1.0, 0.0, 0.0)
    sent.dance(5, 10)
    assert rig.pose.bones["LeftUpperArm"].rotation_quaternion[1] == pytest.approx(1.0)
    assert bpy.ops.rigid_motion.live_match() == {"FINISHED"}
    sent.dance(10, 11)
    assert heads_of(rig) == pytest.approx(in_world(dance(TIMES)).positions[:, 10], abs=SINGLE)


def test_two_bodies_of_one_name_are_two(live, sent, port):
    other = Sent(port)
    for row, datagrams in enumerate(frames_of_vmc(TIMES)[:5]):
        sent.send(datagrams, 50.0 + TIMES[row])
        other.send(datagrams, 50.0 + TIMES[row])
    other.close()
    assert sorted(receiving.listening().joints) == ["VMC", "VMC 2"]
    assert sorted(obj.name for obj in bpy.context.scene.objects) == ["VMC", "VMC 2"]


def test_what_vanishes_stays_where_it_was_and_comes_back_as_the_same(live, sent, port):
    sent.dance(0, 5)
    sent.send([], 70.0)
    assert receiving.listening().joints == {}
    assert len(bpy.context.scene.objects) == 1
    other = Sent(port)
    other.dance(0, 5, 80.0)
    other.close()
    assert [obj.name for obj in bpy.context.scene.objects] == ["VMC"]


def test_what_is_deleted_stays_away_until_an_undo(live, sent):
    sent.dance(0, 5)
    bpy.data.objects.remove(bpy.data.objects["VMC"])
    sent.dance(5, 8)
    assert len(bpy.context.scene.objects) == 0
    receiving.HANDLERS["undo_post"]()
    sent.dance(8, 9)
    assert len(bpy.context.scene.objects) == 1


def test_a_frame_with_keys_does_not_take_the_picture_back(live, sent):
    live.armature = rig = new_rig()
    bone = rig.pose.bones["LeftUpperArm"]
    bone.keyframe_insert("rotation_quaternion", frame=1)
    sent.dance(0, 8)
    bpy.context.scene.frame_set(2)
    assert heads_of(rig) == pytest.approx(in_world(dance(TIMES)).positions[:, 7], abs=SINGLE)


def test_linked_rigs_are_left_alone(live, sent, tmp_path):
    new_rig()
    bpy.data.libraries.write(str(tmp_path / "rig.blend"), {bpy.data.objects["Rig"]})
    bpy.data.objects.remove(bpy.data.objects["Rig"])
    live.armature = linked(tmp_path / "rig.blend", "Rig")
    sent.dance(0, 5)
    assert receiving.running.trouble == ""


def test_a_port_that_is_taken_is_named(live, port, sent):
    receiving.stop()
    taken = receiving.Port("127.0.0.1", port)
    with pytest.raises(RuntimeError, match=f"Cannot listen to port {port} of 127.0.0.1"):
        bpy.ops.rigid_motion.live_listen()
    taken.close()
    assert receiving.listening() is None


def test_a_new_file_and_switching_off_close_the_port(live, port, sent):
    bpy.ops.wm.read_homefile(use_empty=True)
    assert receiving.listening() is None
    receiving.Port("127.0.0.1", port).close()


def test_an_error_closes_the_port_and_says_so(live, sent, monkeypatch, caplog):
    monkeypatch.setattr(receiving.Listening, "tick", lambda *_: 1 / 0)
    assert receiving.running.look() is None
    assert receiving.listening() is None
    assert receiving.running.trouble == "division by zero"
