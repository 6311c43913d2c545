"""Recording of streams as keys: at the times sent by the codec, or reduced from VMC, which sends every frame."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

import rigid_motion.live.receiving as receiving
from rigid_motion.animation import channelbag_of, modes_of
from rigid_motion.animation.transforms import transform_of
from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import rotate
from rigid_motion.streams import Sender, StreamBody
from tests.live.performing import BEGINS, BODY, FIRST, dance, frames_of_vmc, heads_of, in_world, new_rig, record, show

pytestmark = [pytest.mark.network, pytest.mark.any_blender]

TIMES = np.arange(150) / 60.0
AGAIN = 80
"""The sample at which a sender starts again."""

TOLERANCE = 0.002


def off_by(rig: bpy.types.Object, delay: float = 0.0, part: str = "head") -> float:
    """Return the largest error of heads or tails of a replayed rig, in metres, on samples and frames between."""
    there, worst = in_world(dance(TIMES)), 0.0
    arms = np.array([getattr(bone, f"{part}_local") - bone.head_local for bone in rig.data.bones])
    world = there.positions + rotate(there.quaternions, arms[:, None])
    for row in range(BEGINS + 1 - round(60 * delay), len(TIMES) - 20, 3):
        show(row, delay)
        bpy.context.view_layer.update()
        shown = np.array([rig.matrix_world @ getattr(bone, part) for bone in rig.pose.bones])
        worst = max(worst, float(np.linalg.norm(shown - world[:, row], axis=1).max()))
    return worst


def counts(obj: bpy.types.Object) -> list[int]:
    """Return the number of keys of each rotation channel."""
    return [len(one.keyframe_points) for one in channelbag_of(obj).fcurves if one.data_path.endswith("_quaternion")]


@pytest.mark.parametrize("mode", ["BLENDER", "motor_spline"])
def test_vmc_is_thinned_within_the_tolerance_and_plays_again(live, sent, clock, mode):
    live.armature, live.mode, live.tolerance = (rig := new_rig()), mode, TOLERANCE
    record(sent, clock, frames_of_vmc(TIMES))
    receiving.stop()
    assert rig.animation_data.action.name == "Rig Live"
    assert rig.animation_data.action.frame_range[0] == FIRST
    # Blender's own interpolation of quaternions does not take the shortest way.
    for part in ("head", "tail"):
        assert off_by(rig, part=part) < TOLERANCE * (1.5 if mode == "BLENDER" else 1.05)
    assert max(counts(rig)) < 0.5 * (len(TIMES) - BEGINS)
    assert modes_of(transform_of(rig.pose.bones["LeftUpperArm"]), [FIRST, FIRST + 30]) == [mode, mode]


def test_what_had_come_and_was_not_shown_when_a_recording_began_is_in_it(live, sent, clock):
    live.armature, live.tolerance = (rig := new_rig()), TOLERANCE
    receiving.listening()._receiver.delay = 0.3
    record(sent, clock, frames_of_vmc(TIMES))
    receiving.stop()
    assert off_by(rig, 0.3) < 1.05 * TOLERANCE


def test_what_comes_by_the_codec_has_keys_at_the_moments_that_were_sent(live, sent, clock):
    live.armature = rig = new_rig()
    sender, poses, ball = Sender([BODY, StreamBody.rigid("ball")], 0.005, 0.1, rate=60.0), dance(TIMES), []
    frames = []
    for row, moment in enumerate(TIMES.tolist()):
        ball.append(Poses([[np.sin(moment), 0.0, 1.0]], [[1.0, 0.0, 0.0, 0.0]]))
        frames.append(sender.add(moment, {"dancer": poses[:, row], "ball": ball[-1]}))
    frames[0] = sender.describe() + frames[0]
    record(sent, clock, frames)
    receiving.stop()
    assert off_by(rig, 0.1) < 0.006
    (fcurve, *_) = channelbag_of(bpy.data.objects["ball"]).fcurves
    keys = np.array([key.co[0] for key in fcurve.keyframe_points])
    moments = TIMES[BEGINS] - 0.1 + (keys - FIRST) / 30
    # Times of knots are on a grid of the sender; the first and last are those of the recording itself.
    assert np.ptp(np.round(moments[1:-1] * 60) - moments[1:-1] * 60) < 1e-2
    assert 5 < len(keys) < 0.6 * len(TIMES)
    assert counts(rig)[0] == len(keys)


def test_an_action_that_was_there_is_kept(live, sent, clock):
    live.armature = rig = new_rig()
    rig.pose.bones["Head"].keyframe_insert("rotation_quaternion", frame=1)
    before = rig.animation_data.action
    record(sent, clock, frames_of_vmc(TIMES)[:80])
    assert rig.animation_data.action != before
    assert before.use_fake_user


def test_what_never_moves_has_a_single_key(live, sent, clock):
    live.armature = rig = new_rig()
    frames = [frames_of_vmc(TIMES[:1] * 0)[0][:-1] + frame[-1:] for frame in frames_of_vmc(TIMES)[:60]]
    record(sent, clock, frames)
    receiving.stop()
    assert min(counts(rig)) == 1


def test_nothing_recorded_is_said(live, sent, clock):
    assert bpy.ops.rigid_motion.live_record() == {"FINISHED"}
    assert bpy.ops.rigid_motion.live_finish() == {"CANCELLED"}
    assert not bpy.ops.rigid_motion.live_finish.poll()


def test_what_is_deleted_while_it_is_recorded_has_no_keys_and_no_error(live, sent, clock):
    live.armature = rig = new_rig()
    for row, datagrams in enumerate(frames_of_vmc(TIMES)[:40]):
        sent.send(datagrams, clock[0] + TIMES[row])
        if row == 5:
            bpy.ops.rigid_motion.live_record()
        if row == 20:
            bpy.data.objects.remove(rig)
    assert bpy.ops.rigid_motion.live_finish() == {"CANCELLED"}


def test_a_sender_that_begins_again_is_recorded_on(live, sent, clock):
    live.armature = rig = new_rig()
    first, again = Sender([BODY], rate=60.0), Sender([BODY], rate=60.0)
    poses, frames = dance(TIMES), []
    for row, moment in enumerate(TIMES.tolist()):
        sender, own = (first, moment) if row < AGAIN else (again, moment - TIMES[AGAIN] + 900.0)
        begins = sender.describe() if row in (0, AGAIN) else []
        frames.append(begins + sender.add(own, poses[:, row]))
    record(sent, clock, frames)
    receiving.stop()
    world = in_world(poses).positions
    for row in (50, 70, 110, 130):
        show(row, 0.1)
        assert np.linalg.norm(heads_of(rig) - world[:, row], axis=1).max() < 0.03
