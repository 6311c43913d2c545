"""Rigs and objects of Blender are sent to other programs as VMC."""

from __future__ import annotations

import math
import socket

import bpy
import numpy as np
import pytest

from rigid_motion.live import sending
from rigid_motion.motion import Skeleton
from rigid_motion.streams import Receiver, osc
from rigid_motion.streams.vmc import ROOT
from tests.live.performing import JOINTS, heads_of, new_rig

pytestmark = pytest.mark.network


@pytest.fixture
def listener(extension):
    """The socket of another program that receives."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        other.setblocking(False)
        extension.scene.rigid_motion_live.to_port = other.getsockname()[1]
        yield other


def received(other: socket.socket) -> list[bytes]:
    result = []
    try:
        while True:
            result.append(other.recv(4096))
    except BlockingIOError:
        return result


@pytest.mark.parametrize(("prefix", "turned_by"), [("", 0.0), ("mixamorig:", 0.8)])
def test_a_rig_is_a_performer(listener, prefix, turned_by):
    rig = new_rig(prefix, 1.1, turned_by)
    rig.select_set(True)
    rng = np.random.default_rng(3)
    assert bpy.ops.rigid_motion.live_send() == {"FINISHED"}
    receiver = Receiver(0.0)
    for turn in range(3):
        for bone in rig.pose.bones:
            bone.rotation_quaternion = rng.normal(size=4) * (0.0 if turn == 0 else 1.0) + (1.0, 0.0, 0.0, 0.0)
        heads = heads_of(rig)
        sending.sending().tick(sending.sending()._begun + turn / 60)
        for datagram in received(listener):
            receiver.take(datagram, turn / 60)
        (shown,) = receiver.show(turn / 60).values()
        (keys,) = receiver.keys()
        (body,) = keys.bodies
        assert body.joints == (ROOT, *(name for name in body.joints[1:] if name in JOINTS))
        result = dict(zip(body.joints, Skeleton(body.parents).in_root_space(shown.poses["VMC"]).positions, strict=True))
        for name, head in zip(JOINTS, heads, strict=True):
            assert result[name] == pytest.approx(head, abs=1e-5)


def test_other_objects_are_trackers_with_their_constraints(listener):
    bpy.ops.object.empty_add(location=(1.0, 2.0, 3.0), rotation=(0.0, 0.0, math.pi / 2))
    leader = bpy.context.object
    bpy.ops.object.empty_add()
    follower = bpy.context.object
    follower.constraints.new("COPY_TRANSFORMS").target = leader
    follower.name = "Prop"
    assert bpy.ops.rigid_motion.live_send() == {"FINISHED"}
    sending.sending().tick(0.0)
    (message,) = (message for datagram in received(listener) for message in osc.read(datagram))
    assert message.address == "/VMC/Ext/Tra/Pos"
    assert message.arguments[0] == "Prop"
    half = math.sqrt(0.5)
    assert message.arguments[1:] == pytest.approx((-1.0, 3.0, -2.0, 0.0, -half, 0.0, half), abs=1e-6)


def test_what_is_deleted_or_has_no_known_bones_is_not_sent(listener):
    new_rig("Tentacle")
    bpy.ops.object.empty_add()
    bpy.data.objects["Rig"].select_set(True)
    assert bpy.ops.rigid_motion.live_send() == {"FINISHED"}
    bpy.data.objects.remove(bpy.data.objects["Empty"])
    sending.running.look()
    assert received(listener) == []
    assert bpy.ops.rigid_motion.live_stop_sending() == {"FINISHED"}
    assert sending.sending() is None


def test_nothing_selected_is_nothing_to_send(extension):
    assert not bpy.ops.rigid_motion.live_send.poll()
