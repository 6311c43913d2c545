"""Tests of VMC input and output against its documentation, and of round trips."""

from __future__ import annotations

import math
import struct

import numpy as np
import pytest
from pythonosc.osc_bundle import OscBundle

from rigid_motion.live.driving import Retargeting, matched
from rigid_motion.motion import Poses, Skeleton
from rigid_motion.motion.humanoid import HUMANOID, humanoid_bones
from rigid_motion.motion.quaternions import multiply
from rigid_motion.streams import Receiver, StreamBody, osc
from rigid_motion.streams.vmc import (
    JOINTS,
    MAX_FRAMES,
    MOST_DEVICES,
    ROOT,
    Performer,
    write,
    write_trackers,
)
from tests.live.performing import JOINTS as NAMES
from tests.live.performing import PARENTS, PLACES
from tests.motion.cases import random_quaternions

pytestmark = [pytest.mark.blender, pytest.mark.any_blender]


def world(body: StreamBody, poses: Poses) -> Poses:
    """Return poses (joints, ...) of a body in the space of its roots."""
    return Skeleton(body.parents).in_root_space(poses)


def about(axis: int, degrees: float) -> np.ndarray:
    quaternion = np.zeros(4)
    quaternion[0], quaternion[1 + axis] = math.cos(math.radians(degrees) / 2), math.sin(math.radians(degrees) / 2)
    return quaternion


def frame(seed: int) -> dict[str, Poses]:
    """Return a random pose of all bones, in their parents' spaces."""
    turns = random_quaternions(np.random.default_rng(seed), len(NAMES))
    return {name: Poses(PLACES[row], turns[row]) for row, name in enumerate(NAMES)}


def heard(datagrams: list[bytes], arrival: float = 0.0, receiver: Receiver | None = None) -> Receiver:
    receiver = receiver or Receiver()
    for datagram in datagrams:
        receiver.take(datagram, arrival)
    return receiver


def test_a_frame_is_what_the_documentation_says_it_is():
    """/VMC/Ext/Bone/Pos (string){name} (float){p.x} {p.y} {p.z} {q.x} {q.y} {q.z} {q.w}, read by python-osc."""
    datagrams = write(
        1.5, {ROOT: Poses([0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]), "Hips": Poses([-1.0, -3.0, 2.0], about(2, 90))}
    )
    (bundle,) = (list(OscBundle(datagram)) for datagram in datagrams)
    said = [(message.address, message.params) for message in bundle]
    assert [address for address, _ in said] == ["/VMC/Ext/Root/Pos", "/VMC/Ext/Bone/Pos", "/VMC/Ext/OK", "/VMC/Ext/T"]
    assert said[0][1] == ["root", 0, 0, 0, 0, 0, 0, 1]
    assert said[1][1][0] == "Hips"
    # A left turn about the vertical has the opposite sign in Unity.
    assert said[1][1][1:] == pytest.approx([1, 2, 3, 0, -math.sqrt(0.5), 0, math.sqrt(0.5)])
    assert said[3][1] == [1.5]
    assert max(map(len, write(0.0, {name: frame(1)["Hips"] for name in JOINTS}))) < 1400


OK_1 = b"/VMC/Ext/OK\0,i\0\0\0\0\0\1"
OK_3 = b"/VMC/Ext/OK\0,iii\0\0\0\0\0\0\0\1\0\0\0\3\0\0\0\0"
OK_4 = b"/VMC/Ext/OK\0,iiii\0\0\0\0\0\0\1\0\0\0\3\0\0\0\0\0\0\0\1"
TIME = b"/VMC/Ext/T\0\0,f\0\0\x41\x20\0\0"
"""At 10 s."""

POSE_7 = b"\x3f\x80\0\0\x40\0\0\0\x40\x40\0\0" + b"\0\0\0\0\x3f\x35\x04\xf3\0\0\0\0\x3f\x35\x04\xf3"
"""At (1, 2, 3), a quarter turn about Unity's y."""

ROOT_7 = b"/VMC/Ext/Root/Pos\0\0\0,sfffffff\0\0\0root\0\0\0\0" + POSE_7
ROOT_13 = b"/VMC/Ext/Root/Pos\0\0\0,sfffffffffffff\0root\0\0\0\0" + POSE_7 + 3 * b"\x3f\x80\0\0" + 12 * b"\0"
HIPS = b"/VMC/Ext/Bone/Pos\0\0\0,sfffffff\0\0\0Hips\0\0\0\0" + POSE_7
TAIL = HIPS.replace(b"Hips", b"Tail")
JOY = b"/VMC/Ext/Blend/Val\0\0,sf\0Joy\0\x3f\x80\0\0"


def bundled(*messages: bytes) -> bytes:
    """Return a bundle for immediate execution, as in the specification of OSC 1.0."""
    return b"#bundle\0" + b"\0\0\0\0\0\0\0\1" + b"".join(len(each).to_bytes(4, "big") + each for each in messages)


@pytest.mark.parametrize("available", [OK_1, OK_3, OK_4], ids=["2.0", "2.5", "2.7"])
@pytest.mark.parametrize("root", [ROOT_7, ROOT_13], ids=["2.0", "2.1"])
@pytest.mark.parametrize("pack", ["one by one", "a frame in a bundle", "a bundle for each"])
def test_bytes_written_after_the_documentation_are_shown(available, root, pack):
    """Every form of https://protocol.vmc.info/marionette-spec, in any packing that OSC allows."""
    messages = [available, root, HIPS, TAIL, JOY, TIME]
    datagrams = {
        "one by one": messages,
        "a frame in a bundle": [bundled(*messages)],
        "a bundle for each": [bundled(each) for each in messages],
    }[pack]
    receiver = heard(datagrams, 1.0, Receiver(delay=0.0))
    (shown,) = receiver.show(1.0).values()
    assert shown.moment == pytest.approx(10.0)
    assert shown.bodies[0].joints == (ROOT, "Hips")
    for joint in range(2):
        assert shown.poses["VMC"].positions[joint] == pytest.approx([-1.0, -3.0, 2.0])
        assert shown.poses["VMC"].quaternions[joint] == pytest.approx(about(2, -90), abs=1e-7)


def test_without_times_a_bone_that_comes_again_begins_a_frame():
    receiver = Receiver(delay=0.0)
    for row in range(4):
        hips = ("Hips", 0.0, 1.0, float(row), 0.0, 0.0, 0.0, 1.0)
        heard([osc.write_message("/VMC/Ext/Bone/Pos", *hips)], 0.1 * row, receiver)
    (keys,) = receiver.keys()
    assert keys.moments == pytest.approx([0.0, 0.1, 0.2])
    assert keys.poses["VMC"].positions[1, :, 1] == pytest.approx([0.0, -1.0, -2.0])


TRACKER = b"/VMC/Ext/Tra/Pos\0\0\0\0,sfffffff\0\0\0LHR-1\0\0\0" + POSE_7
CONTROLLER = b"/VMC/Ext/Con/Pos\0\0\0\0,sfffffff\0\0\0LHR-2\0\0\0" + POSE_7
HEADSET = b"/VMC/Ext/Hmd/Pos\0\0\0\0,sfffffff\0\0\0LHR-3\0\0\0" + POSE_7


@pytest.mark.parametrize("messages", [[TRACKER, CONTROLLER, HEADSET], [ROOT_7, HIPS, TRACKER, CONTROLLER, HEADSET]])
def test_devices_are_rigid_bodies_beside_the_performer(messages):
    """As documented: a serial number and a pose in the world."""
    receiver = heard([*messages, TIME], 1.0, Receiver(delay=0.0))
    (shown,) = receiver.show(1.0).values()
    bodies = shown.bodies
    assert [body.name for body in bodies] == ["VMC"] * (HIPS in messages) + ["LHR-1", "LHR-2", "LHR-3"]
    for body in bodies[-3:]:
        assert body.joints == (body.name,)
        assert shown.poses[body.name].positions == pytest.approx(np.array([[-1.0, -3.0, 2.0]]))
        assert shown.poses[body.name].quaternions == pytest.approx(about(2, -90)[None], abs=1e-7)


def test_a_tracker_that_joins_leaves_the_other_bodies_as_they_are():
    receiver = heard([ROOT_7, HIPS, TRACKER, TIME], 1.0, Receiver(delay=0.0))
    (shown,) = receiver.show(1.0).values()
    before = shown.bodies
    heard([ROOT_7, HIPS, TRACKER, CONTROLLER, TIME.replace(b"\x41\x20", b"\x41\x28")], 1.5, receiver)
    (shown,) = receiver.show(1.5).values()
    after = shown.bodies
    assert after[:2] == before
    assert [body.name for body in after] == ["VMC", "LHR-1", "LHR-2"]


def test_trackers_that_are_written_are_shown_without_times():
    receiver, rng = Receiver(delay=0.0), np.random.default_rng(2)
    places = rng.normal(size=(4, MOST_DEVICES + 5, 3))
    for row in range(4):
        turns = random_quaternions(rng, MOST_DEVICES + 5)
        poses = {f"ball {number}": Poses(places[row, number], turns[number]) for number in range(MOST_DEVICES + 5)}
        heard(write_trackers(poses), 0.1 * row, receiver)
    (keys,) = receiver.keys()
    assert len(keys.poses) == MOST_DEVICES
    for number in range(MOST_DEVICES):
        assert keys.poses[f"ball {number}"].positions[0] == pytest.approx(places[:3, number], abs=1e-6)


def test_a_skeleton_of_another_size_rest_and_naming_does_the_same():
    turns = np.tile((1.0, 0.0, 0.0, 0.0), (len(NAMES), 1))
    turns[NAMES.index("LeftUpperArm")] = about(1, 50)
    held = Skeleton(PARENTS).in_root_space(Poses(PLACES[:, None] * 1.25, turns[:, None]))[:, 0]
    bone_axes = random_quaternions(np.random.default_rng(5), len(NAMES))
    joints, rest = ["mixamorig:" + name for name in NAMES], Poses(held.positions, multiply(held.quaternions, bone_axes))
    performer = Performer(tuple(joints), rest)
    assert list(performer.bones) == [name for name in HUMANOID if name in NAMES]
    # At rest one arm hangs down; in a T-pose no bone is turned.
    sent = performer(rest)
    assert sent["LeftUpperArm"].quaternions == pytest.approx(about(1, 50), abs=1e-9)
    assert sent["LeftHand"].quaternions == pytest.approx([1, 0, 0, 0], abs=1e-9)
    receiver = heard(write(0.0, sent))
    receiver.show(0.0)
    (keys,) = receiver.keys()
    body = keys.bodies[0]
    pairs = matched(body.joints, joints)
    assert pairs == {name: f"mixamorig:{name}" for name in body.joints if name in NAMES}
    rows = np.array([(body.joints.index(one), joints.index(other)) for one, other in pairs.items()])
    above = rows[:, 0].tolist()
    parents = np.array([above.index(body.parents[row]) if body.parents[row] in above else -1 for row in above])
    sliding = np.array([name == "Hips" for name in pairs])
    bones = {name: row for row, name in enumerate(pairs)}
    retarget = Retargeting(world(body, body.rest[:, None])[:, 0], rest, rows, parents, bones, sliding)
    back = retarget(world(body, keys.poses["VMC"][:, :1]))[:, 0]
    assert retarget.scale == pytest.approx(1.0)
    assert np.abs(np.einsum("ij,ij->i", back.quaternions, rest.quaternions[rows[:, 1]])) == pytest.approx(1.0)
    assert back.positions[0] == pytest.approx(rest.positions[0], abs=1e-6)


@pytest.mark.parametrize(
    ("joints", "bones"),
    [
        (("Hips", "LHipJoint", "LeftUpLeg", "LeftLeg", "LowerBack", "Spine", "Spine1", "Neck", "LeftArm"), 8),
        (("pelvis", "spine_01", "spine_02", "clavicle_l", "upperarm_l", "lowerarm_l", "hand_l", "calf_r"), 8),
        (("Bip01 Pelvis", "upper_arm.L", "forearm.L", "hand.L", "f_index.01.L", "thumb.02.R", "shin.L"), 6),
        (("ORG-hand.L", "torso", "hips", "spine_fk", "spine_fk.001", "upper_arm_fk.L", "upper_arm_ik.L", "DEF-x"), 3),
        (("J_Bip_C_Hips", "J_Bip_L_UpperArm", "J_Bip_R_LowerLeg"), 0),
    ],
)
def test_bones_are_found_by_their_usual_names(joints, bones):
    assert len(humanoid_bones(joints)) == bones


def hips(moment: float) -> dict[str, Poses]:
    place = [np.sin(3.0 * moment), 0.3 * np.cos(5.0 * moment), 1.0]
    return {"Hips": Poses(place, [math.cos(moment), 0.0, 0.0, math.sin(moment)])}


@pytest.mark.parametrize("step", [0.3, 0.5, 0.9, 5.0, -0.3, -0.5, -0.9, -5.0])
def test_a_clock_that_is_set_is_no_motion(step):
    """The shown motion is within two samples of the motion 0.1 s ago, before, at and after the step."""
    receiver, off, moments = Receiver(delay=0.1), [], []
    for row in range(240):
        sent = row / 60.0
        heard(write(sent + step * (sent > 2.0), hips(sent)), 7.0 + sent, receiver)
        for drawn in (sent, sent + 0.007):
            for shown in receiver.show(7.0 + drawn).values():
                moments.append(shown.moment)
                off.append(np.linalg.norm(shown.poses["VMC"].positions[1] - hips(drawn - 0.1)["Hips"].positions))
    assert max(off[60:]) < 0.005
    assert np.diff(moments).min() >= 0.0


def test_frames_that_came_late_are_no_clock_that_was_set():
    receiver, frames = Receiver(delay=0.1), [write(row / 60.0, hips(row / 60.0)) for row in range(60)]
    for row in (*range(30), 36, 34, 35, 30, 33, *range(37, 60)):
        heard(frames[row], 7.0 + max(row, 36 * (29 < row < 37)) / 60.0, receiver)
    (keys,) = receiver.keys()
    assert np.round(keys.moments * 60.0, 3).tolist() == [*range(30), *range(36, 60)]


@pytest.mark.parametrize("time", [1e308, -1e308, 3e11, math.inf, math.nan, 5e-324, 1e-300])
def test_times_that_are_none_make_no_frames(time):
    receiver, bone = Receiver(delay=0.0), osc.write_message("/VMC/Ext/Bone/Pos", "Hips", *[0.5] * 7)
    for row, moment in enumerate((0.0, time, 0.5, -time, 1.0)):
        said = b"/VMC/Ext/T\0\0,d\0\0" + struct.pack(">d", moment)
        heard([bundled(bone, said)], row / 2.0, receiver)
    (keys,) = receiver.keys()
    assert np.diff(keys.moments).min() > 1e-7
    for shown in receiver.show(2.0).values():
        assert np.isfinite(shown.poses["VMC"].positions).all()


def test_of_a_datagram_a_few_frames_are_taken():
    """As from a program that saves up frames; a sender of more would be trying to keep us busy."""
    frames = [row for number in range(600) for row in (HIPS, osc.write_message("/VMC/Ext/T", number / 60.0))]
    (keys,) = heard([bundled(*frames)]).keys()
    np.testing.assert_allclose(keys.moments, np.arange(MAX_FRAMES) / 60.0, atol=1e-6)
