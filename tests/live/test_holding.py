"""Objects held in a stream: shown in the hand of the rig, and recorded as held in it."""

from __future__ import annotations

import itertools
from functools import cache

import bpy
import numpy as np
import pytest

from rigid_motion.animation import channelbag_of, hold_facts, modes_of
from rigid_motion.animation.transforms import transform_of
from rigid_motion.live import receiving
from rigid_motion.live.driving import seen_hand, unscaled
from rigid_motion.motion import Poses, shell_error
from rigid_motion.motion.poses import inverse, placed
from rigid_motion.streams import Sender, StreamBody
from tests.live.performing import BEGINS, BODY, FIRST, JOINTS, dance, frame_of, in_world, new_rig, record, show
from tests.rigs.human import human

pytestmark = [pytest.mark.network, pytest.mark.any_blender]

TIMES = np.arange(180) / 60.0
DELAY, TOLERANCE = 0.1, 0.005
RADIUS = 0.1
"""Radius of the ball around the tool, whose points are off by the tolerance at most."""

GRIP = Poses([0.1, 0.05, 0.0], [0.6, 0.0, 0.8, 0.0])
HANDS, TAKES = ("LeftHand", "Head"), (60, 100, 140)
"""The joints that hold the sword, and the samples at which each takes it and the last lets go."""

PLAYED = np.arange(40, 160)
"""Samples that are certainly in a recording."""

SLIP = 2e-6
"""Error caused by holding itself, at most, in metres."""


def hand_at(row: int) -> str | None:
    return (None, *HANDS, None)[int(np.searchsorted(TAKES, row, side="right"))]


@cache
def swords() -> Poses:
    """Return the poses (n,) of the sword: on a table, in the hand, at the head, and where it was let go."""
    there, poses = in_world(dance(TIMES)), []
    for row in range(len(TIMES)):
        if (hand := hand_at(row)) is not None:
            pose = placed(there[JOINTS.index(hand), row], GRIP)
        elif row < TAKES[0]:
            pose = Poses([1.0, 0.0, 0.5], [1.0, 0.0, 0.0, 0.0])
        poses.append(pose)
    return Poses([one.positions for one in poses], [one.quaternions for one in poses])


@cache
def datagrams_of(*, holds: bool) -> list[tuple[list[bytes], list[bytes]]]:
    """Return for each sample the datagrams that describe the bodies, and those of the dance with the sword."""
    there, poses, result = swords(), dance(TIMES), []
    sender = Sender([StreamBody.rigid("sword", radius=RADIUS), BODY], TOLERANCE, DELAY, rate=60.0)
    for row, moment in enumerate(TIMES.tolist()):
        if holds:
            sender.hold("sword", hand_at(row) and "dancer", hand_at(row))
        datagrams = sender.add(moment, {"sword": there[row : row + 1], "dancer": poses[:, row]})
        result.append((sender.describe() if row < 2 else [], datagrams))
    return result


def perform(
    sent, clock, *, holds: bool = True, loss: float = 0.0, until: int | None = None, on_row=lambda row: None
) -> None:
    """Send and record a dance with a sword, losing a fraction of the datagrams."""
    rng = np.random.default_rng(3)
    frames = [
        described + [datagram for datagram in datagrams if rng.random() >= loss]
        for described, datagrams in datagrams_of(holds=holds)[:until]
    ]
    record(sent, clock, frames, on_row)


def seen_sword() -> Poses:
    sword = bpy.data.objects["sword"].evaluated_get(bpy.context.evaluated_depsgraph_get())
    return unscaled(np.array(sword.matrix_world, dtype=np.float64))


def play(rows: np.ndarray) -> tuple[Poses, list[Poses]]:
    """Return the poses of the sword at samples (n,) of the recording, in the world and in each of the hands."""
    swords, grips, rig = [], [[], []], next(obj for obj in bpy.context.scene.objects if obj.type == "ARMATURE")
    for row in rows.tolist():
        show(row, DELAY)
        swords.append(seen_sword())
        for hand, poses in zip(HANDS, grips, strict=True):
            poses.append(placed(inverse(seen_hand((rig.name, hand))), swords[-1]))
    return stacked(swords), [*map(stacked, grips)]


def stacked(poses: list[Poses]) -> Poses:
    return Poses([pose.positions for pose in poses], [pose.quaternions for pose in poses])


def off_by(poses: Poses, others: Poses) -> float:
    """Return the largest error of any point of the sword's ball, in metres; `others` are (n,) or ()."""
    return float(shell_error(poses, stacked([others] * len(poses)) if others.shape == () else others, RADIUS).max())


def grip_in(rig: bpy.types.Object, joint: str) -> Poses:
    """Return the grip in the space of a rig's bone, whose joint has no rotation in the rest pose."""
    bone = rig.data.bones[joint]
    head = Poses(np.array(bone.head_local), [1.0, 0.0, 0.0, 0.0])
    return placed(placed(inverse(unscaled(np.array(bone.matrix_local, dtype=np.float64))), head), GRIP)


def influences(obj: bpy.types.Object) -> dict[str, list[tuple[float, float]]]:
    curves = [one for one in channelbag_of(obj).fcurves if one.data_path.endswith(".influence")]
    return {one.data_path.split('"')[1]: [tuple(key.co) for key in one.keyframe_points] for one in curves}


@pytest.mark.parametrize("mode", ["BLENDER", "motor_spline"])
def test_what_was_held_has_keys_in_the_hands_and_stays_in_them_when_they_are_edited(live, sent, clock, mode):
    live.armature, live.mode = (rig := new_rig()), mode
    perform(sent, clock)
    receiving.stop()
    sword, takes = bpy.data.objects["sword"], [frame_of(row, DELAY) for row in TAKES]
    assert [(item.target, item.subtarget) for item in sword.constraints] == [(rig, hand) for hand in HANDS]
    assert influences(sword) == {
        "Held In LeftHand": [(FIRST, 0.0), (takes[0], 1.0), (takes[1], 0.0)],
        "Held In Head": [(FIRST, 0.0), (takes[1], 1.0), (takes[2], 0.0)],
    }
    frames = np.array([key.co.x for key in channelbag_of(sword).fcurves[0].keyframe_points])
    assert np.diff(frames).min() > 0.01, "keys are apart for Blender"
    assert modes_of(transform_of(sword), takes) == [mode] * 3
    held = [np.arange(first, last, 0.5) for first, last in itertools.pairwise(TAKES)]
    before = [play(rows)[1][number] for number, rows in enumerate(held)]
    for poses, hand in zip(before, HANDS, strict=True):
        assert off_by(poses, grip_in(rig, hand)) < 1.02 * TOLERANCE
    loose = PLAYED[(TAKES[0] > PLAYED) | (TAKES[2] < PLAYED)]
    assert off_by(play(loose)[0], swords()[loose]) < 1.02 * TOLERANCE
    moved = play(np.array(TAKES[:2]) + 10)[0]
    for hand in ("LeftUpperArm", "Neck"):
        rig.pose.bones[hand].rotation_mode = "XYZ"
        for fcurve in channelbag_of(rig).fcurves:
            fcurve.mute |= f'"{hand}"' in fcurve.data_path
        rig.pose.bones[hand].rotation_euler = (0.3, 0.5, -0.8)
    for number, rows in enumerate(held):
        assert off_by(play(rows)[1][number], before[number]) < SLIP
    assert np.linalg.norm(play(np.array(TAKES[:2]) + 10)[0].positions - moved.positions, axis=1).min() > 0.05


def test_it_does_not_slip_whatever_is_lost(live, sent, clock):
    live.armature = rig = new_rig()
    perform(sent, clock, loss=0.1)
    receiving.stop()
    for number, (first, last) in enumerate(itertools.pairwise(TAKES)):
        grips = play(np.arange(first, last, 0.5))[1][number]
        assert off_by(grips, grip_in(rig, HANDS[number])) < 1.02 * TOLERANCE


def test_it_is_shown_in_the_hand_of_a_rig_of_another_size_and_place_and_is_recorded_there(live, sent, clock):
    live.armature, slips = (rig := new_rig(larger=1.3)), []
    rig.location.x = 2.0

    def look(row: int) -> None:
        if TAKES[0] + 12 <= row < TAKES[1]:
            bpy.context.view_layer.update()
            grip = placed(inverse(seen_hand(("Rig", "LeftHand"))), seen_sword())
            slips.append(off_by(stacked([grip]), grip_in(rig, "LeftHand")))

    perform(sent, clock, on_row=look)
    assert len(slips) > 20
    assert max(slips) < 1.02 * TOLERANCE
    receiving.stop()
    rows = np.arange(*TAKES[:2], 0.5)
    assert off_by(play(rows)[1][0], grip_in(rig, "LeftHand")) < 1.02 * TOLERANCE


def test_what_is_not_held_any_more_is_shown_and_recorded_in_the_world_over_keys_that_hold_it(live, sent, clock):
    live.armature = new_rig()
    perform(sent, clock)

    def look(row: int) -> None:
        if row == BEGINS - 5:
            show(TAKES[0] + 20, DELAY)
            bpy.context.view_layer.update()
            assert off_by(stacked([seen_sword()]), swords()[0]) < 1.02 * TOLERANCE
            bpy.context.scene.frame_set(FIRST)

    perform(sent, clock, holds=False, on_row=look)
    receiving.stop()
    assert {value for keys in influences(bpy.data.objects["sword"]).values() for _, value in keys} == {0.0}
    assert off_by(play(PLAYED)[0], swords()[PLAYED]) < 1.02 * TOLERANCE


def test_what_held_it_and_is_gone_leaves_it_in_the_world(live, sent, clock):
    def remove(row: int) -> None:
        if row == TAKES[1] + 20:
            bpy.data.objects.remove(bpy.data.objects["dancer"])

    perform(sent, clock, on_row=remove)
    receiving.stop()
    assert not bpy.data.objects["sword"].constraints
    for row in range(40, TAKES[1]):
        show(row, DELAY)
        assert off_by(stacked([seen_sword()]), swords()[row]) < 2.0 * TOLERANCE, row


def test_what_follows_the_sword_cannot_hold_it_and_that_is_said(live, sent, clock):
    live.armature = rig = new_rig()

    def tie(row: int) -> None:
        if row == TAKES[1] + 20:
            rig.pose.bones["Hips"].constraints.new("COPY_LOCATION").target = bpy.data.objects["sword"]

    perform(sent, clock, on_row=tie)
    assert receiving.listening().complaint == (
        "sword cannot be held in LeftHand, which follows it: LeftHand would wait for itself"
    )
    assert not bpy.data.objects["sword"].constraints
    receiving.stop()
    assert off_by(play(PLAYED)[0], swords()[PLAYED]) < 2.0 * TOLERANCE


def test_bodies_hold_one_another_and_skeletons_that_are_held_have_keys_in_the_world(live, sent, clock):
    glove, sword, poses = StreamBody.rigid("glove"), StreamBody.rigid("sword", radius=RADIUS), dance(TIMES)
    there = in_world(poses)[JOINTS.index("LeftHand")]
    sender = Sender([sword, BODY, glove], TOLERANCE, DELAY, rate=60.0)
    sender.hold("sword", "glove")
    sender.hold("dancer", "glove")
    frames = []
    for row, moment in enumerate(TIMES[:120].tolist()):
        hand = there[row : row + 1]
        datagrams = sender.add(moment, {"sword": placed(hand, GRIP), "dancer": poses[:, row], "glove": hand})
        frames.append((sender.describe() if row < 2 else []) + datagrams)
    record(sent, clock, frames)
    receiving.stop()
    obj = bpy.data.objects["sword"]
    assert [(item.target.name, item.subtarget) for item in obj.constraints] == [("glove", "")]
    assert hold_facts(obj).now.name == "glove"
    assert not any(bone.constraints for bone in bpy.data.objects["dancer"].pose.bones)
    for row in (44.0, 64.6):
        show(row, DELAY)
        glove_seen = unscaled(np.array(bpy.data.objects["glove"].matrix_world, dtype=np.float64))
        assert off_by(stacked([placed(inverse(glove_seen), seen_sword())]), GRIP) < 1.02 * TOLERANCE
        head = in_world(dance(np.array([row / 60.0])))[JOINTS.index("Head"), 0].positions
        assert np.linalg.norm(seen_hand(("dancer", "Head")).positions - head) < 2.0 * TOLERANCE


@pytest.mark.slow
def test_a_rig_of_rigify_holds_by_what_follows_its_hands_by_ik_as_well(live, sent, clock):
    live.armature = rig = human()
    perform(sent, clock, until=TAKES[1] + 12)
    receiving.stop()
    assert [item.subtarget for item in bpy.data.objects["sword"].constraints][:1] == ["ORG-hand.L"]
    rows, grips = np.arange(*TAKES[:2], 7), []
    for ik in (0.0, 1.0):
        for bone in rig.pose.bones:
            if "IK_FK" in bone:
                bone["IK_FK"] = 1.0 - ik
        poses = []
        for row in rows.tolist():
            show(row, DELAY)
            poses.append(placed(inverse(seen_hand((rig.name, "DEF-hand.L"))), seen_sword()))
        grips.append(stacked(poses))
    assert off_by(grips[1], grips[0]) < TOLERANCE
