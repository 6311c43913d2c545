"""Stepped modifiers hold the poses of a mode; Noise and its like are added on top. Blender itself says what they do.

Where a Stepped modifier leads is asked of a spare F-curve that has its own frame for a value. Where an object has to be
without modifiers, `tests.animation.oracle` says, with all of them muted.
"""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix, Quaternion

from rigid_motion.animation import bake, problem_of, set_mode, unbake
from rigid_motion.animation.curves.keys import Stepped, held
from tests.animation.bones.poses import assert_same_poses, expected_poses, shown_poses
from tests.animation.bones.rigs import key_bone, new_rig
from tests.animation.keyed import Carrier, curves_of, key_frames, rotation_path, snapshot
from tests.animation.modified import led_to, without_modifiers
from tests.animation.oracle import expected_bases, shown_worlds, world_now
from tests.animation.scenes import give_own_deltas, key, new_object

PLAYED = np.arange(-9.0, 52.0)

STEPS: dict[str, dict[str, object]] = {
    "twos": {"frame_step": 2.0, "frame_offset": 1.0},
    "threes, from zero": {"frame_step": 3.0},
    "long, behind the offset": {"frame_step": 7.0, "frame_offset": 20.0},
    "from a frame on": {"frame_step": 4.0, "use_frame_start": True, "frame_start": 9.0},
    "up to a frame": {"frame_step": 4.0, "frame_offset": 1.0, "use_frame_end": True, "frame_end": 26.0},
}
"""Settings of a Stepped modifier that leads to whole frames."""

BROKEN = {"frame_step": 2.5, "frame_offset": 0.5}


def channels(carrier: Carrier) -> list[bpy.types.FCurve]:
    """The animator's F-curves of location, rotation and scale."""
    result = curves_of(carrier)
    paths = ("location", rotation_path(carrier), "scale")
    return [fcurve for (path, _), fcurve in result.items() if path in paths and len(fcurve.keyframe_points)]


def modify(fcurves: Sequence[bpy.types.FCurve], kind: str, **settings: object) -> list[bpy.types.FModifier]:
    added = []
    for fcurve in fcurves:
        modifier = fcurve.modifiers.new(kind)
        for name, value in settings.items():
            setattr(modifier, name, value)
        added.append(modifier)
    bpy.context.view_layer.update()
    return added


def expected(carrier: Carrier, frames: np.ndarray, own=None) -> np.ndarray:
    with without_modifiers(channels(carrier)):
        return expected_bases(carrier, frames, own)


def assert_same(shown: np.ndarray, reference: np.ndarray) -> None:
    np.testing.assert_allclose(shown, reference, rtol=0, atol=2e-5 * max(1.0, np.abs(reference).max()))


def played(settings: dict[str, object]) -> np.ndarray:
    """Quarter frames where all of them are held: what is held is exact between frames, too."""
    return PLAYED if "use_frame_start" in settings or "use_frame_end" in settings else np.arange(-9.0, 52.0, 0.25)


@pytest.mark.parametrize("settings", [*STEPS.values(), BROKEN], ids=[*STEPS, "broken"])
def test_the_frames_that_are_held_are_blenders(empty_file, settings):
    frames = np.arange(-30.0, 60.0, 0.25)
    ends = {name: settings[f"frame_{name}"] for name in ("start", "end") if settings.get(f"use_frame_{name}")}
    modifier = Stepped(settings["frame_step"], settings.get("frame_offset", 0.0), **ends)
    np.testing.assert_allclose(held([modifier], frames), led_to([settings], frames), atol=1e-3)


@pytest.mark.parametrize("order", ["QUATERNION", "ZXY"])
@pytest.mark.parametrize("frames", [(1.0, 11.0, 24.0, 40.0), (-7.0, 3.0, 12.5, 31.0)], ids=["after zero", "before"])
@pytest.mark.parametrize("settings", STEPS.values(), ids=STEPS)
def test_holds_of_all_kinds(live_file, settings, frames, order):
    obj = key(new_object(rotation_mode=order), frames, seed=4)
    modify(channels(obj), "STEPPED", **settings)
    set_mode(obj, "dq_sclerp")
    frames = played(settings)
    assert_same(shown_worlds([obj], frames)[0], expected(obj, led_to([settings], frames)))


@pytest.mark.parametrize("settings", STEPS.values(), ids=STEPS)
def test_bones_hold_their_poses(live_file, settings):
    rig = new_rig()
    for number, bone in enumerate(rig.pose.bones):
        key_bone(bone, seed=number)
        if number:
            set_mode(bone, "motor_spline")
            modify(channels(bone), "STEPPED", **settings)
    frames = played(settings)
    at = led_to([settings], frames)
    bases = {bone.name: expected(bone, at if number else frames) for number, bone in enumerate(rig.pose.bones)}
    assert_same_poses(rig, frames, *shown_poses([rig], frames), expected_poses(rig, frames, bases))


def test_one_behind_another_and_a_channel_with_a_single_key(live_file):
    obj = key(new_object(), seed=4)
    for axis in range(3):
        obj.keyframe_insert("scale", index=axis, frame=1)
    moving = [fcurve for fcurve in channels(obj) if len(fcurve.keyframe_points) > 1]
    modify(moving, "STEPPED", frame_step=2.0)
    modify(moving, "STEPPED", frame_step=5.0, frame_offset=1.0)
    set_mode(obj, "cga_lerp")
    at = led_to([{"frame_step": 2.0}], led_to([{"frame_step": 5.0, "frame_offset": 1.0}], PLAYED))
    assert_same(shown_worlds([obj], PLAYED)[0], expected(obj, at))


NOISE = {"strength": 1.5, "scale": 4.0, "phase": 3.0}
ADDED: dict[str, tuple[str, dict[str, object]]] = {
    "noise": ("NOISE", NOISE),
    "noise in part": ("NOISE", NOISE | {"use_influence": True, "influence": 0.4}),
    "sine": ("FNGENERATOR", {"use_additive": True, "amplitude": 0.7, "phase_multiplier": 0.4}),
}
"""Types and settings of modifiers that add something."""


def difference(carrier: Carrier, path: str, frames: np.ndarray) -> np.ndarray:
    """What modifiers add to a property on these frames, shape (m, width)."""
    curves = [fcurve for (name, _), fcurve in curves_of(carrier).items() if name == path]

    def values() -> np.ndarray:
        return np.array([[fcurve.evaluate(frame) for fcurve in curves] for frame in frames])

    shown = values()
    with without_modifiers(channels(carrier)):
        return shown - values()


@pytest.mark.parametrize("kind", ADDED)
@pytest.mark.parametrize("mode", ["dq_sclerp", "motor_spline"])
def test_what_is_added_to_a_location_is_on_top_of_the_mode(live_file, kind, mode):
    obj = new_object()
    own = give_own_deltas(obj, 1)
    key(obj, seed=2, scale="even")
    set_mode(obj, mode)
    name, settings = ADDED[kind]
    modify([curves_of(obj)["location", axis] for axis in (0, 2)], name, **settings)
    added = difference(obj, "location", PLAYED)
    assert np.ptp(added[:, 0]) > 0.1
    reference = expected(obj, PLAYED, own)
    reference[:, :3, 3] += added
    assert problem_of(obj) == ""
    assert_same(shown_worlds([obj], PLAYED)[0], reference)


@pytest.mark.parametrize("order", ["QUATERNION", "XYZ"])
def test_what_is_added_to_a_rotation_turns_the_mode_by_what_it_turns_blenders(live_file, order):
    obj = key(new_object(rotation_mode=order), seed=2)
    set_mode(obj, "dq_sclerp")
    path = rotation_path(obj)
    modify([curves_of(obj)[path, 1]], "NOISE", strength=0.8, scale=5.0)
    reference = expected(obj, PLAYED)
    curves = [curves_of(obj)[path, index] for index in range(len(getattr(obj, path)))]

    def turned() -> list[Matrix]:
        rows = [[fcurve.evaluate(frame) for fcurve in curves] for frame in PLAYED]
        return [
            (Quaternion(row).normalized() if order == "QUATERNION" else Euler(row, order)).to_matrix() for row in rows
        ]

    noisy = turned()
    with without_modifiers(channels(obj)):
        for number, (with_noise, without) in enumerate(zip(noisy, turned(), strict=True)):
            reference[number, :3, :3] = reference[number, :3, :3] @ np.array(without.inverted() @ with_noise)
    assert_same(shown_worlds([obj], PLAYED)[0], reference)


def test_a_scale_with_noise_is_blenders_own(live_file):
    obj = key(new_object(), seed=2, scale="even")
    set_mode(obj, "cga_slerp")
    modify([curves_of(obj)["scale", 1]], "NOISE", strength=0.3)
    scales = np.array([[curves_of(obj)["scale", axis].evaluate(frame) for axis in range(3)] for frame in PLAYED])
    shown = np.linalg.norm(shown_worlds([obj], PLAYED)[0][:, :3, :3], axis=1)
    np.testing.assert_allclose(shown, np.abs(scales), rtol=1e-4)


@pytest.mark.parametrize("carrier", ["object", "Euler object", "bone"])
@pytest.mark.parametrize("kind", ["stepped", "noise", "both"])
def test_a_bake_has_what_was_seen_and_comes_undone(live_file, carrier, kind):
    if carrier == "bone":
        rig = new_rig()
        result = key_bone(rig.pose.bones["Upper"], seed=3)
    else:
        result = key(new_object(rotation_mode="XYZ" if carrier == "Euler object" else "QUATERNION"), seed=3)
    set_mode(result, "dq_sclerp")
    if kind != "noise":
        modify(channels(result), "STEPPED", frame_step=3.0)
    if kind != "stepped":
        rotation = curves_of(result)[rotation_path(result), 2]
        modify([curves_of(result)["location", 0], rotation], "NOISE", strength=0.5, scale=6.0)
    frames = np.arange(1.0, 47.0) if kind == "stepped" else np.arange(1.0, 41.0)

    def seen() -> np.ndarray:
        return shown_poses([rig], frames)[0]["Upper"] if carrier == "bone" else shown_worlds([result], frames)[0]

    before, keyed = seen(), snapshot(result)
    bake(result, first=12.0, last=15.0)
    assert not any(fcurve.modifiers for fcurve in channels(result))
    assert_same(seen(), before)
    unbake(result)
    assert snapshot(result) == keyed
    assert_same(seen(), before)


def test_a_key_in_between_keeps_the_pose_that_is_seen_with_its_noise(live_file):
    result = key(new_object(), seed=5)
    set_mode(result, "dq_sclerp")
    modify([curves_of(result)["location", 1], curves_of(result)["rotation_quaternion", 3]], "NOISE", **NOISE)
    bpy.context.scene.frame_set(17)
    before = world_now()
    result.keyframe_insert("location", frame=17)
    result.keyframe_insert("rotation_quaternion", frame=17)
    assert_same(world_now(), before)
    assert 17.0 in key_frames(result).tolist()
    bpy.context.scene.frame_set(18)
    bpy.context.scene.frame_set(17)
    assert_same(world_now(), before)


def test_a_bake_has_every_round_of_cycles_as_it_was_seen(live_file):
    obj = key(new_object(), seed=3)
    set_mode(obj, "dq_sclerp")
    modify(channels(obj), "CYCLES", mode_before="MIRROR")
    modify(channels(obj), "STEPPED", frame_step=7.0)
    modify([curves_of(obj)["location", 0]], "NOISE", strength=0.5, scale=6.0)
    bpy.context.scene.frame_end = 90
    bpy.context.view_layer.update()
    frames = np.arange(1.0, 91.0)
    (before,), keyed = shown_worlds([obj], frames), snapshot(obj)
    bake(obj)
    assert_same(shown_worlds([obj], frames)[0], before)
    unbake(obj)
    assert snapshot(obj) == keyed
