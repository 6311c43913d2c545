"""Reduced keys of rigs as Blender evaluates them: the tolerance holds at every bone, through all its parents.

Nothing is promised for bones that follow constraints and drivers. They are named.
"""

from __future__ import annotations

import itertools

import bpy
import numpy as np
import pytest

from rigid_motion.animation import NATIVE, Refused, reduce_keys_of, reduction_of, restore_keys, write_channel
from rigid_motion.animation.baking import search
from rigid_motion.animation.baking.motions import not_promised
from tests.animation.bones.poses import shown_poses
from tests.animation.bones.rigs import Rest, in_turn, new_rig
from tests.animation.keyed import key_frames, mode_at
from tests.animation.oracle import shown_worlds
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
    """Return the displayed world matrices of every bone, (n, 4, 4)."""
    (worlds,), (poses,) = shown_worlds([rig], frames), shown_poses([rig], frames)
    return {name: worlds @ shown for name, shown in poses.items()}


def largest(shown: np.ndarray, truth: np.ndarray, radius: float = RADIUS) -> np.ndarray:
    """Return the largest error of any point of the ball on each frame, by singular values."""
    return largest_displacements((shown - truth)[:, :3, 3], radius * (shown - truth)[:, :3, :3])


def errors(rig: bpy.types.Object, truth: dict[str, np.ndarray], frames: np.ndarray = MOMENTS) -> dict[str, float]:
    return {name: float(largest(rows, truth[name]).max()) for name, rows in matrices(rig, frames).items()}


@pytest.mark.parametrize(
    ("case", "rotation_mode"),
    in_turn(itertools.product([4, 12, None], ["motor_spline", NATIVE]), ["QUATERNION", "XZY"]),
)
def test_a_rig_that_moves_itself_has_its_keys_on_the_key_poses_and_their_error_is_what_is_said(
    live_file, monkeypatch, case, rotation_mode
):
    """A recording may also be processed in parts. For Blender's own curves, the error is that on whole frames."""
    (count, mode), moments = case, FRAMES if NATIVE in case else MOMENTS
    monkeypatch.setattr(search, "AT_ONCE", 60 * len(NAMES))
    rig = recorded_rig(rotation_mode)
    write_channel(rig, "location", FRAMES, np.stack((np.sin(0.11 * FRAMES), 0.02 * FRAMES, 0.0 * FRAMES), axis=1))
    rig.scale = (0.5, 0.5, 0.5)
    bpy.context.view_layer.update()
    truth, (place,), every = matrices(rig, moments), shown_worlds([rig], moments), [rig, *bones(rig)]
    reduction = reduce_keys_of(every, mode, TOLERANCE, 0.5 * RADIUS, shared=count is None, count=count)
    keys = [key_frames(item).tolist() for item in every]
    assert keys == keys[:1] * len(keys)
    for item, some in zip(every, keys, strict=True):
        assert (reduction_of(item).before, reduction_of(item).after) == (len(FRAMES), len(some))
        assert {mode_at(item, frame) for frame in some} == {"BLENDER" if mode == NATIVE else mode}
    assert len(keys[0]) == reduction.rig.frames == (count or len(keys[0])) < 0.5 * len(FRAMES)
    worst = max(*errors(rig, truth, moments).values(), largest(shown_worlds([rig], moments)[0], place).max())
    assert reduction.largest_error == pytest.approx(worst, abs=2e-6)
    assert count or worst <= TOLERANCE * (1.0 + 1e-4)


def test_what_hangs_on_a_target_keeps_its_own_keys_and_to_the_tolerance_and_its_error_counts(live_file):
    rig = recorded_rig(still=("Head",))
    truth = matrices(rig)
    reduction = reduce_keys_of(bones(rig, "Spine"), "motor_spline", TOLERANCE, RADIUS)
    assert len(key_frames(rig.pose.bones["Hand.L"])) == len(FRAMES)
    off = errors(rig, truth)
    assert off["Root"] == 0.0
    assert 0.0 < off["Spine"] < max(off["Head"], off["Hand.L"]) <= TOLERANCE * (1.0 + 1e-4)
    assert reduction.largest_error == pytest.approx(max(off.values()), abs=2e-6)


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
    """The hip above sways. If carried, the rig moves on, and the hip moves back in it by the same distance."""
    rig = new_rig("Leg", LEG)
    # A pendulum that hangs from the swaying hip, with its end fixed.
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
    slides, every, recorded = [], bones(rig, "Hip", "Thigh"), matrices(rig, FRAMES)["Foot"][:, :3, 3]
    for hold in (False, True):
        reduce_keys_of(every, "lerp_slerp", 0.02, 0.02, hold=hold)
        reduction, kept = reduction_of(every).rig, matrices(rig, FRAMES)["Foot"][:, :3, 3]
        # It stands all the time, so its slide is its largest distance from its first place.
        for places, slide in ((recorded, reduction.slide_before), (kept, reduction.slide_after)):
            assert np.linalg.norm(places - places[0], axis=1).max() == pytest.approx(slide, abs=1e-5)
        slides.append(reduction.slide_after)
        restore_keys(every)
    assert slides[1] < 0.6 * slides[0]


def test_bones_that_cannot_be_reduced_say_so_and_the_others_are(live_file):
    rig = recorded_rig(still=("Head",))
    rig.pose.bones["Hand.R"].rotation_mode = "AXIS_ANGLE"
    waves = np.cos(0.1 * FRAMES[:, None] * (1.0, 1.3, 1.7))
    write_channel(rig, 'pose.bones["Arm.L"].scale', FRAMES, 1.0 + 0.3 * waves)
    write_channel(rig, 'pose.bones["Hand.L"].scale', FRAMES, waves[:, :1].repeat(3, axis=1))
    truth = matrices(rig)
    refused: list[Refused] = []
    reduce_keys_of(bones(rig), "motor_spline", TOLERANCE, RADIUS, refused=refused)
    reasons = {str(refusal).split()[0].removeprefix("Body/"): str(refusal) for refusal in refused}
    assert sorted(reasons) == ["Arm.L", "Hand.L", "Hand.R", "Head"]
    assert all("not uniform or passes zero" in reasons[name] for name in ("Arm.L", "Hand.L"))
    assert [bone.name for bone in bones(rig) if reduction_of(bone) is not None] == ["Root", "Spine", "Arm.R"]
    assert max(errors(rig, truth).values()) <= TOLERANCE * (1.0 + 1e-4)


@pytest.mark.parametrize("shared", [False, True])
def test_with_no_tolerance_to_speak_of_the_rig_says_once_that_it_needs_its_keys(live_file, shared):
    refused: list[Refused] = []
    assert reduce_keys_of(bones(recorded_rig()), tolerance=1e-9, radius=RADIUS, shared=shared, refused=refused) is None
    assert {str(one).partition(":")[0] for one in refused} == {"Body needs its 90 keys to stay within the tolerance"}


@pytest.mark.parametrize(
    ("bone", "kind", "settings", "named"),
    [
        ("Arm.L", "DAMPED_TRACK", {}, ("Arm.L", "Hand.L")),
        ("Arm.L", "LIMIT_ROTATION", {"mute": True}, ()),
        ("Arm.L", "COPY_ROTATION", {"influence": 0.0}, ()),
        ("Hand.L", "IK", {"chain_count": 2}, ("Arm.L", "Hand.L")),
        ("Hand.L", "IK", {"chain_count": 0}, NAMES),
    ],
)
def test_what_follows_a_constraint_is_named_and_what_hangs_on_it(live_file, bone, kind, settings, named):
    rig = recorded_rig()
    constraint = rig.pose.bones[bone].constraints.new(kind)
    for name, value in settings.items():
        setattr(constraint, name, value)
    assert not_promised(rig) == named
    constraint.keyframe_insert("influence")
    assert not_promised(rig) == (named or ("Arm.L", "Hand.L"))


@pytest.mark.parametrize(("mute", "named"), [(True, ()), (False, ("Head",))])
def test_what_follows_a_driver_is_named_unless_that_is_muted(live_file, mute, named):
    rig = recorded_rig(still=("Head",))
    rig.pose.bones["Head"].driver_add("rotation_quaternion", 1).mute = mute
    assert not_promised(rig) == named
