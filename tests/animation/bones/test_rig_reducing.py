"""The reduced keys of rigs, as Blender evaluates them: the tolerance holds at every bone, through all it hangs on."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import (
    Refused,
    is_reduced,
    key_frames,
    modes_of,
    reduce_keys_of,
    reduction_of,
    restore_keys,
    total_reduction,
    write_channel,
)
from rigid_motion.animation.baking import proof
from tests.animation.bones.rigs import Rest, in_turn, new_rig
from tests.animation.keyed import curves_of
from tests.balls import largest_displacements
from tests.rigs.recorded import FRAMES, NAMES, recorded_rig

TOLERANCE, RADIUS = 0.01, 0.05

MOMENTS = np.arange(8.0 * FRAMES[0], 8.0 * FRAMES[-1] + 1.0) / 8.0
"""Eighths of frames: the tolerance holds between frames, too."""

LEG = (
    Rest("Hip", (0.0, 0.0, 1.0), (0.0, 0.001, 0.9)),
    Rest("Thigh", (0.0, 0.0, 0.9), (0.0, 0.001, 0.5), "Hip"),
    Rest("Shin", (0.0, 0.0, 0.5), (0.0, 0.001, 0.1), "Thigh"),
    Rest("Foot", (0.0, 0.0, 0.1), (0.0, 0.001, 0.05), "Shin"),
)


def bones(rig: bpy.types.Object, *names: str) -> list[bpy.types.PoseBone]:
    return [rig.pose.bones[name] for name in names or NAMES]


def matrices(rig: bpy.types.Object, frames: np.ndarray = MOMENTS) -> dict[str, np.ndarray]:
    """Where Blender shows every bone in the world, (n, 4, 4)."""
    result: dict[str, list[np.ndarray]] = {bone.name: [] for bone in rig.pose.bones}
    for frame in frames:
        bpy.context.scene.frame_set(int(frame), subframe=frame % 1.0)
        for bone in rig.pose.bones:
            result[bone.name].append(np.array(rig.matrix_world @ bone.matrix))
    return {name: np.array(rows) for name, rows in result.items()}


def largest(shown: np.ndarray, truth: np.ndarray, radius: float = RADIUS) -> np.ndarray:
    """How far any point of the ball is off on each frame, by singular values."""
    return largest_displacements((shown - truth)[:, :3, 3], radius * (shown - truth)[:, :3, :3])


def errors(rig: bpy.types.Object, truth: dict[str, np.ndarray]) -> dict[str, float]:
    return {name: float(largest(rows, truth[name]).max()) for name, rows in matrices(rig).items()}


@pytest.mark.parametrize("best_of", [False, True])
@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize(("mode", "rotation_mode"), in_turn(["motor_spline", "lerp_slerp"], ["QUATERNION", "XZY"]))
def test_no_bone_gets_further_off_than_the_tolerance(live_file, mode, shared, best_of, rotation_mode):
    rig = recorded_rig(rotation_mode)
    truth = matrices(rig)
    reduce_keys_of(bones(rig), mode, TOLERANCE, RADIUS, shared=shared, best_of=best_of)
    off = errors(rig, truth)
    assert max(off.values()) <= TOLERANCE * (1.0 + 1e-4)
    for bone in bones(rig):
        reduction = reduction_of(bone)
        assert reduction.largest_error == pytest.approx(off[bone.name], abs=2e-6)
        assert (reduction.before, reduction.after) == (len(FRAMES), len(key_frames(bone)))
    keys = [key_frames(bone).tolist() for bone in bones(rig)]
    assert all(len(some) < 0.6 * len(FRAMES) for some in keys)
    if shared:
        assert keys == keys[:1] * len(keys)
    assert total_reduction(bones(rig)).rig.frames == len({frame for some in keys for frame in some})
    if not best_of:
        assert {item for bone in bones(rig) for item in modes_of(bone, key_frames(bone))} == {mode}


@pytest.mark.parametrize("best_of", [False, True])
@pytest.mark.parametrize("mode", ["motor_spline", "lerp_slerp"])
def test_the_tolerance_holds_where_not_all_of_a_recording_is_looked_at_at_once(live_file, monkeypatch, mode, best_of):
    monkeypatch.setattr(proof, "AT_ONCE", 60 * len(NAMES))
    rig = recorded_rig()
    for fcurve in curves_of(rig).values():
        for key in fcurve.keyframe_points:
            key.interpolation = "BEZIER"
    truth = matrices(rig)
    reduce_keys_of(bones(rig), mode, TOLERANCE, RADIUS, best_of=best_of)
    off = errors(rig, truth)
    assert max(off.values()) <= TOLERANCE * (1.0 + 1e-4)
    assert total_reduction(bones(rig)).largest_error == pytest.approx(max(off.values()), abs=2e-6)


@pytest.mark.parametrize("best_of", [False, True])
@pytest.mark.parametrize(("count", "rotation_mode"), in_turn([4, 12], ["QUATERNION", "XZY"]))
def test_so_many_key_poses_are_shared_by_all_bones_and_their_error_is_what_is_said(
    live_file, count, rotation_mode, best_of
):
    rig = recorded_rig(rotation_mode)
    truth = matrices(rig)
    reduce_keys_of(bones(rig), "motor_spline", radius=RADIUS, best_of=best_of, count=count)
    total = total_reduction(bones(rig))
    keys = [key_frames(bone).tolist() for bone in bones(rig)]
    assert keys == keys[:1] * len(keys)
    assert len(keys[0]) == total.rig.frames == count
    assert total.largest_error == pytest.approx(max(errors(rig, truth).values()), abs=2e-6)


def test_a_rig_that_moves_itself_has_its_keys_on_the_key_poses(live_file):
    rig = recorded_rig()
    places = np.stack((np.sin(0.11 * FRAMES), 0.02 * FRAMES, 0.0 * FRAMES), axis=1)
    write_channel(rig, "location", FRAMES, places)
    rig.scale = (0.5, 0.5, 0.5)
    bpy.context.view_layer.update()
    reduce_keys_of([rig, *bones(rig)], "motor_spline", radius=RADIUS, count=9)
    keys = [key_frames(item).tolist() for item in (rig, *bones(rig))]
    assert keys == keys[:1] * len(keys)
    assert len(keys[0]) == 9
    by_nine = total_reduction([rig, *bones(rig)]).largest_error
    restore_keys([rig, *bones(rig)])
    reduce_keys_of([rig, *bones(rig)], "motor_spline", radius=RADIUS, count=20)
    assert total_reduction([rig, *bones(rig)]).largest_error < by_nine


def test_what_hangs_on_a_target_keeps_its_own_keys_and_to_the_tolerance(live_file):
    rig = recorded_rig()
    truth = matrices(rig)
    reduce_keys_of(bones(rig, "Spine"), "motor_spline", TOLERANCE, RADIUS)
    assert len(key_frames(rig.pose.bones["Hand.L"])) == len(FRAMES)
    off = errors(rig, truth)
    assert off["Root"] == 0.0
    assert 0.0 < off["Hand.L"] <= TOLERANCE * (1.0 + 1e-4)


def test_a_bone_that_hardly_moves_is_left_with_one_key(live_file):
    rig = recorded_rig(still=("Head",))
    turns = np.tile((1.0, 0.0, 0.0, 0.0), (len(FRAMES), 1))
    turns[:, 1] = 1e-4 * np.sin(FRAMES)
    write_channel(rig, 'pose.bones["Head"].rotation_quaternion', FRAMES, turns)
    truth = matrices(rig)
    reduce_keys_of(bones(rig), "motor_spline", TOLERANCE, RADIUS)
    assert len(key_frames(rig.pose.bones["Head"])) == 1
    assert max(errors(rig, truth).values()) <= TOLERANCE * (1.0 + 1e-4)


@pytest.mark.parametrize("carried", [False, True])
def test_a_foot_that_stands_is_held(live_file, carried):
    """Under a hip that sways. Carried, the rig moves on, and the hip goes as far back in it."""
    rig = new_rig("Leg", LEG)
    # A pendulum that hangs from the swaying hip, with its end where it is.
    sway = 0.08 * np.sin(0.2 * FRAMES)
    on = 0.02 * FRAMES if carried else 0.0 * FRAMES
    along = rig.data.bones["Hip"].x_axis.x
    assert abs(along) == pytest.approx(1.0)
    write_channel(rig, 'pose.bones["Hip"].location', FRAMES, np.outer(sway - on / along, (1.0, 0.0, 0.0)))
    if carried:
        write_channel(rig, "location", FRAMES, np.outer(on, (1.0, 0.0, 0.0)))
    lean = np.arcsin(sway / 0.8)
    turns = np.zeros((len(FRAMES), 4))
    turns[:, 0], turns[:, 3] = np.cos(lean / 2.0), np.sin(lean / 2.0)
    write_channel(rig, 'pose.bones["Thigh"].rotation_quaternion', FRAMES, turns)
    slides, every, recorded = {}, bones(rig, "Hip", "Thigh"), matrices(rig, FRAMES)["Foot"][:, :3, 3]
    for hold in (False, True):
        reduce_keys_of(every, "lerp_slerp", 0.02, 0.02, hold=hold)
        as_whole = total_reduction(every).rig
        slides[hold] = as_whole.slide_after
        # It stands all the time: what it slides is how far it gets from where it stood at first.
        kept = matrices(rig, FRAMES)["Foot"][:, :3, 3]
        for places, slide in ((recorded, as_whole.slide_before), (kept, slides[hold])):
            assert np.linalg.norm(places - places[0], axis=1).max() == pytest.approx(slide, abs=1e-5)
        restore_keys(every)
    assert slides[True] < 0.6 * slides[False]


def test_bones_that_cannot_be_reduced_say_so_and_the_others_are(live_file):
    rig = recorded_rig(still=("Head",))
    rig.pose.bones["Hand.R"].rotation_mode = "AXIS_ANGLE"
    refused: list[Refused] = []
    reduce_keys_of(bones(rig), "motor_spline", TOLERANCE, RADIUS, refused=refused)
    assert sorted(str(refusal).split()[0] for refusal in refused) == ["Body/Hand.R", "Body/Head"]
    assert is_reduced(rig.pose.bones["Spine"])
    assert not is_reduced(rig.pose.bones["Hand.R"])


@pytest.mark.parametrize("shared", [False, True])
def test_with_no_tolerance_to_speak_of_the_rig_says_once_that_it_needs_its_keys(live_file, shared):
    rig = recorded_rig()
    refused: list[Refused] = []
    assert reduce_keys_of(bones(rig), "motor_spline", 1e-9, RADIUS, shared=shared, refused=refused) is None
    (reason,) = set(map(str, refused))
    assert reason.startswith("Body: its bones need their keys on all of 90 frames")
    assert ("keys of its own" in reason) == shared


def test_a_scale_that_passes_zero_is_named(live_file):
    rig = recorded_rig()
    sizes = np.cos(0.1 * FRAMES)
    write_channel(rig, 'pose.bones["Spine"].scale', FRAMES, np.stack((sizes, sizes, sizes), axis=1))
    with pytest.raises(Refused, match="Body/Spine: its scale passes zero"):
        reduce_keys_of(bones(rig), "motor_spline", TOLERANCE, RADIUS)
    assert not any(map(is_reduced, bones(rig)))
